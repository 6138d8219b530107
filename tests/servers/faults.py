"""Faults by name: what a server can do to whoever asks it, one behaviour each.

`WIRE_FAULTS` holds them all; each is a mode of `Faults`, beside those that the chassis knows. A
behaviour gets the server, the request as it was read, and the request itself, and ends it. None
draws a random number: which fault meets which request is decided by `Faults.draw`.

`Ending` says what has to come of a fault, if nothing else happens, whatever the protocol.
"""

from __future__ import annotations

import asyncio
import copy
import gzip
import json
import socket
import struct
import zlib
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from functools import cache, partial
from typing import TYPE_CHECKING, Any, Literal

from aiohttp import web

if TYPE_CHECKING:
    from tests.servers.chassis import LocalServer, Seen

Ending = Literal["reply", "retryable", "unavailable", "sample"]
Behaviour = Callable[["LocalServer", "Seen", web.Request], Awaitable[web.StreamResponse]]

_BOMB_BYTES = 40 * 2**20
_DRIP_S = 0.02


@dataclass(frozen=True)
class Fault:
    """A behaviour, and what must come of it."""

    behave: Behaviour
    ending: Ending


def _fault(behave: Callable[..., Any], *, ending: Ending = "retryable", **options: Any) -> Fault:
    return Fault(partial(behave, **options), ending)


def reset_connection(request: web.Request) -> web.Response:
    """Send a TCP reset in the place of (the rest of) an answer."""
    transport = request.transport
    if transport is not None:
        lingering = struct.pack("ii", 1, 0)
        raw = transport.get_extra_info("socket")
        raw.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, lingering)
        transport.abort()
    return web.Response()


async def _redirect(
    server: LocalServer, _: Seen, request: web.Request, *, status: int, away: bool
) -> web.Response:
    there = server.elsewhere if away else f"{request.scheme}://{request.host}"
    location = f"{there}{request.path}?session=h1dden#h1dden"
    return web.Response(status=status, headers={"Location": location})


def _sent(
    body: Any = None, status: int = 200, ending: Ending = "retryable", **headers: str
) -> Fault:
    """An answer with this status and body: bytes as they are, anything else as JSON."""
    data = body if body is None or isinstance(body, bytes) else json.dumps(body).encode()

    async def behave(_: LocalServer, __: Seen, ___: web.Request) -> web.Response:
        kind = None if data is None else "application/json"
        named = {name.replace("_", "-"): value for name, value in headers.items()}
        return web.Response(body=data, status=status, headers=named, content_type=kind)

    return Fault(behave, ending)


async def _changed(
    server: LocalServer,
    seen: Seen,
    _: web.Request,
    *,
    change: Callable[[dict[str, Any], Seen], Any],
) -> web.Response:
    """Answer with a good reply that was changed."""
    body = copy.deepcopy(server.reply(seen, "ok"))
    data = json.dumps(change(body, seen)).encode()
    return web.Response(body=data, content_type="application/json")


def _usage(value: Any) -> Callable[[dict[str, Any], Seen], Any]:
    """Each count of a reply's usage becomes `value`; "missing" takes the whole away."""

    def change(body: dict[str, Any], _: Seen) -> dict[str, Any]:
        name = "usageMetadata" if "usageMetadata" in body else "usage"
        counts = body.pop(name)
        if value != "missing":
            body[name] = dict.fromkeys(counts, value)
        return body

    return change


def _texts(value: Any, text: str) -> Any:
    """A copy in which each text of a reply, wherever its protocol puts it, is `text`."""
    if isinstance(value, dict):
        return {
            key: text
            if key in ("text", "content") and isinstance(item, str)
            else _texts(item, text)
            for key, item in value.items()
        }
    return [_texts(item, text) for item in value] if isinstance(value, list) else value


def _emptied(value: Any) -> Callable[[dict[str, Any], Seen], Any]:
    """The list that holds the answers becomes `value`."""

    def change(body: dict[str, Any], _: Seen) -> dict[str, Any]:
        name = next(name for name in ("choices", "candidates", "content") if name in body)
        return {**body, name: value}

    return change


def _with_key(body: dict[str, Any], seen: Seen) -> dict[str, Any]:
    """The key stands in every text and in the model's name."""
    for name in ("model", "modelVersion"):
        if name in body:
            body[name] = f"{body[name]}-{seen.key}"
    return _texts(body, f"{seen.reply_text}\nYour key is {seen.key}.")


async def _echo(
    _: LocalServer, seen: Seen, __: web.Request, *, status: int, shape: str
) -> web.Response:
    """Say the key in an error: quoted as JSON, in a text cut short, or in a page."""
    if shape == "page":
        page = f"<html>{'x' * 60} {seen.key}</html>"
        return web.Response(text=page, status=status, content_type="text/html")
    said = f"bad key {seen.key}" if shape == "json" else f"{'x' * 485} {seen.key}"
    return web.json_response({"error": {"message": said, "code": None}}, status=status)


async def _stream(
    _: LocalServer,
    __: Seen,
    request: web.Request,
    *,
    chunk: bytes,
    pause_s: float,
    encoding: str = "",
) -> web.StreamResponse:
    """Answer with a body that never ends."""
    response = web.StreamResponse(headers={"Content-Type": "application/json"})
    if encoding:
        response.headers["Content-Encoding"] = encoding
    await response.prepare(request)
    try:
        while True:
            await response.write(chunk)
            await asyncio.sleep(pause_s)
    except ConnectionError:
        return response


async def _reset_midway(
    server: LocalServer, seen: Seen, request: web.Request, *, claimed: int, resets: bool
) -> web.StreamResponse:
    """Send half of a good reply, then lose the connection or end it."""
    whole = json.dumps(server.reply(seen, "ok")).encode()
    response = web.StreamResponse(headers={"Content-Type": "application/json"})
    response.content_length = len(whole) + claimed
    await response.prepare(request)
    await response.write(whole[: len(whole) // 2])
    if resets:
        reset_connection(request)
    elif request.transport is not None:
        request.transport.close()
    return response


async def _raw(_: LocalServer, __: Seen, request: web.Request, *, data: bytes) -> web.Response:
    """Answer with bytes that are no HTTP, or more of it than anyone reads."""
    request.transport.write(data)
    request.transport.close()
    return web.Response()


@cache
def _bomb(encoding: str) -> bytes:
    """A JSON text of 40 MiB in a few hundred kilobytes; twice compressed where two are named."""
    plain = b'{"choices": "' + b"0" * _BOMB_BYTES + b'"}'
    if encoding == "deflate":
        return zlib.compress(plain, 1)
    packed = gzip.compress(plain, 1)
    return gzip.compress(packed) if "," in encoding else packed


async def _explode(_: LocalServer, __: Seen, ___: web.Request, *, encoding: str) -> web.Response:
    headers = {"Content-Encoding": encoding}
    return web.Response(body=_bomb(encoding), headers=headers, content_type="application/json")


async def _packed(
    server: LocalServer, seen: Seen, _: web.Request, *, encoding: str, share: float = 1.0
) -> web.Response:
    """A good reply, compressed, of which only a share arrives (at 0: not compressed at all)."""
    plain = json.dumps(server.reply(seen, "ok")).encode()
    packed = zlib.compress(plain) if encoding == "deflate" else gzip.compress(plain)
    body = packed[: int(len(packed) * share)] if share else plain
    headers = {"Content-Encoding": encoding}
    return web.Response(body=body, headers=headers, content_type="application/json")


def _nested(body: dict[str, Any], _: Seen) -> dict[str, Any]:
    deep: list[Any] = []
    for _level in range(400):
        deep = [deep]
    return {**body, "extra": deep}


def _error(message: Any, code: Any) -> dict[str, Any]:
    return {"error": {"message": message, "type": "api_error", "param": None, "code": code}}


_DEEP = b'{"choices": ' + b"[" * 100_000 + b"]" * 100_000 + b"}"
_QUOTA = "You exceeded your current quota"

_ERRORS_IN_200: Mapping[str, Fault] = {
    "200-quota": _sent(_error(_QUOTA, "insufficient_quota"), ending="unavailable"),
    "200-code-401": _sent(_error("No auth credentials found", "401"), ending="unavailable"),
    "200-code-401-number": _sent(_error("No auth credentials found", 401), ending="unavailable"),
    "200-code-429": _sent(_error("Upstream is down", 429)),
    "200-code-500": _sent(_error("Upstream is down", 500)),
    "200-code-object": _sent(_error("Upstream is down", {"status": 401})),
    "200-code-huge": _sent(_error("Upstream is down", 10**30)),
    "200-message-object": _sent(_error({"text": "Upstream is down"}, None)),
    "200-error-string": _sent({"error": "Upstream is down"}),
    "200-error-list": _sent({"error": ["Upstream is down"]}),
    "200-error-empty": _sent({"error": {}}),
    "200-error-and-null-choices": _sent({**_error("Upstream is down", 502), "choices": None}),
    "200-string": _sent("Upstream is down"),
    "200-null": _sent(b"null"),
    "200-number": _sent(b"7"),
    "200-list": _sent([]),
    "200-empty-object": _sent({}),
    "200-empty": _sent(b""),
    "200-no-utf-8": _sent(b'{"choices": "\xff\xfe"}'),
    "200-nan": _sent(b'{"choices": NaN}'),
    "200-deep": _sent(_DEEP),
    "200-huge-number": _sent(b'{"choices": ' + b"9" * 100_000 + b"}"),
}
"""Bodies that come with status 200 and are no reply."""

_STATUSES: Mapping[str, Fault] = {
    "201-empty": _sent(b"", 201),
    "202-accepted": _sent({"status": "queued"}, 202),
    "204": _sent(None, 204),
    "400-string": _sent({"error": "Invalid value for messages"}, 400, "sample"),
    "401-string": _sent({"error": "Unauthorized"}, 401, "unavailable"),
    "402": _sent(_error("Insufficient credits", 402), 402, "unavailable"),
    "408": _sent(b"", 408),
    "429-bare": _sent({"error": "Too many requests"}, 429),
    "429-soon": _sent({"error": "Too many requests"}, 429, Retry_After="0"),
    "429-broken-wish": _sent({"error": "Too many"}, 429, Retry_After="soon"),
    "429-endless-wish": _sent({"error": "Too many"}, 429, Retry_After="1e400"),
    "429-no-wish": _sent({"error": "Too many"}, 429, Retry_After="nan"),
    "500-string": _sent({"error": "Internal error"}, 500),
    "500-deep": _sent(_DEEP, 500),
    "502-page": _sent(b"<html>Bad gateway</html>", 502),
    "503": _sent(_error("Overloaded", None), 503),
    "529": _sent(_error("Overloaded", None), 529),
}
"""Answers by their status alone."""

_CHANGES: Mapping[str, Fault] = {
    "null-choices": _fault(_changed, change=_emptied(None)),
    "choices-of-strings": _fault(_changed, change=_emptied(["a", "b"])),
    "choices-object": _fault(_changed, change=_emptied({"0": {}})),
    "deep-beside-choices": _fault(_changed, change=_nested),
    "surrogate": _fault(
        _changed, ending="reply", change=lambda body, _: _texts(body, "Step1: \ud800 index 1")
    ),
    "echo-key-in-reply": _fault(_changed, ending="reply", change=_with_key),
    "usage-missing": _fault(_changed, ending="reply", change=_usage("missing")),
    "usage-null": _fault(_changed, ending="reply", change=_usage(None)),
    "usage-zero": _fault(_changed, ending="reply", change=_usage(0)),
    "usage-negative": _fault(_changed, ending="reply", change=_usage(-1_000_000)),
    "usage-huge": _fault(_changed, ending="reply", change=_usage(10**30)),
    "usage-true": _fault(_changed, ending="reply", change=_usage(True)),
    "usage-fraction": _fault(_changed, ending="reply", change=_usage(12.5)),
    "usage-text": _fault(_changed, ending="reply", change=_usage("many")),
}
"""Good replies in which something is changed."""

WIRE_FAULTS: Mapping[str, Fault] = {
    **{
        f"redirect-{status}-{'away' if away else 'here'}": _fault(
            _redirect, ending="unavailable", status=status, away=away
        )
        for status in (301, 302, 303, 307, 308)
        for away in (False, True)
    },
    "redirect-nowhere": _sent(status=302, ending="unavailable"),
    "redirect-garbled": _sent(status=302, ending="unavailable", Location="http://[::1/v1"),
    **_ERRORS_IN_200,
    **_STATUSES,
    **_CHANGES,
    "echo-key-json": _fault(_echo, ending="sample", status=400, shape="json"),
    "echo-key-cut": _fault(_echo, ending="sample", status=400, shape="cut"),
    "echo-key-page": _fault(_echo, status=200, shape="page"),
    "reset-midway": _fault(_reset_midway, claimed=0, resets=True),
    "short-body": _fault(_reset_midway, claimed=5_000, resets=False),
    "no-http": _fault(_raw, data=b"HELO mail.example\r\n\r\n"),
    "no-head": _fault(_raw, data=b""),
    "huge-header": _fault(_raw, data=b"HTTP/1.1 200 OK\r\nX: " + b"x" * 200_000 + b"\r\n\r\n"),
    "bad-chunk": _fault(_raw, data=b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\nxyz\r\n"),
    "endless": _fault(_stream, chunk=b" " * 65_536, pause_s=0),
    "endless-gzip": _fault(_stream, chunk=gzip.compress(b" " * 2**20), pause_s=0, encoding="gzip"),
    "drip": _fault(_stream, chunk=b" ", pause_s=_DRIP_S),
    "gzip": _fault(_packed, ending="reply", encoding="gzip"),
    "deflate": _fault(_packed, ending="reply", encoding="deflate"),
    "gzip-cut": _fault(_packed, encoding="gzip", share=0.5),
    "gzip-that-is-none": _fault(_packed, encoding="gzip", share=0.0),
    "brotli-that-is-none": _fault(_packed, encoding="br"),
    "gzip-bomb": _fault(_explode, encoding="gzip"),
    "deflate-bomb": _fault(_explode, encoding="deflate"),
    "gzip-twice-bomb": _fault(_explode, encoding="gzip, gzip"),
}
"""Every fault by its name."""
