"""Faults by name: what a server can do to whoever asks it, one behaviour each.

`WIRE_FAULTS` holds them all; each is a mode of `Faults`, beside those that the chassis knows. A
behaviour gets the server and a request, and ends it; `Ending` says what has to come of that.
"""

from __future__ import annotations

import asyncio
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


@dataclass(frozen=True)
class Fault:
    """A behaviour, and what must come of it."""

    behave: Behaviour
    ending: Ending = "retryable"


def reset_connection(request: web.Request) -> web.Response:
    """Send a TCP reset in the place of (the rest of) an answer."""
    transport = request.transport
    if transport is not None:
        lingering = struct.pack("ii", 1, 0)
        raw = transport.get_extra_info("socket")
        raw.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, lingering)
        transport.abort()
    return web.Response()


async def _reset(_: LocalServer, __: Seen, request: web.Request) -> web.Response:
    return reset_connection(request)


async def _redirect(
    server: LocalServer, _: Seen, request: web.Request, *, status: int, away: bool
) -> web.Response:
    there = server.elsewhere if away else f"{request.scheme}://{request.host}"
    location = f"{there}{request.path}?session=h1dden#h1dden"
    return web.Response(status=status, headers={"Location": location})


def _sent(
    body: Any = None, status: int = 200, ending: Ending = "retryable", **headers: str
) -> Fault:
    """An answer with this status and body: bytes as they are, anything else as JSON. A function
    makes it of a good reply and the request.
    """

    async def behave(server: LocalServer, seen: Seen, _: web.Request) -> web.Response:
        made = body(server.reply(seen, "ok"), seen) if callable(body) else body
        data = made if made is None or isinstance(made, bytes) else json.dumps(made).encode()
        named = {name.replace("_", "-"): value for name, value in headers.items()}
        if data is not None:
            named = {"Content-Type": "application/json", **named}
        return web.Response(body=data, status=status, headers=named)

    return Fault(behave, ending)


def _usage(value: Any) -> Fault:
    """Each count of a reply's usage becomes `value`; "missing" takes the whole away."""

    def change(body: dict[str, Any], _: Seen) -> dict[str, Any]:
        name = "usageMetadata" if "usageMetadata" in body else "usage"
        counts = body.pop(name)
        return body if value == "missing" else {**body, name: dict.fromkeys(counts, value)}

    return _sent(change, ending="reply")


def _texts(value: Any, text: str) -> Any:
    """A copy in which each text of a reply, wherever its protocol puts it, is `text`."""
    if isinstance(value, dict):
        changed = {key: _texts(item, text) for key, item in value.items()}
        named = [name for name in ("text", "content") if isinstance(value.get(name), str)]
        return changed | dict.fromkeys(named, text)
    return [_texts(item, text) for item in value] if isinstance(value, list) else value


def _emptied(value: Any) -> Fault:
    """The list that holds the answers becomes `value`."""

    def change(body: dict[str, Any], _: Seen) -> dict[str, Any]:
        name = next(name for name in ("choices", "candidates", "content") if name in body)
        return {**body, name: value}

    return _sent(change)


def _with_key(body: dict[str, Any], seen: Seen) -> dict[str, Any]:
    """The key stands in every text and in the model's name."""
    for name in {"model", "modelVersion"} & body.keys():
        body[name] = f"{body[name]}-{seen.key}"
    return _texts(body, f"{seen.reply_text}\nYour key is {seen.key}.")


def _echo(said: Callable[[str], str]) -> Fault:
    """An error that says the key."""
    return _sent(
        lambda _, seen: {"error": {"message": said(seen.key), "code": None}}, 400, "sample"
    )


def _stream(chunk: bytes, pause_s: float = 0.0, **headers: str) -> Fault:
    """A body that never ends."""

    async def behave(_: LocalServer, __: Seen, request: web.Request) -> web.StreamResponse:
        named = {name.replace("_", "-"): value for name, value in headers.items()}
        response = web.StreamResponse(headers={"Content-Type": "application/json", **named})
        await response.prepare(request)
        try:
            while True:
                await response.write(chunk)
                await asyncio.sleep(pause_s)
        except ConnectionError:
            return response

    return Fault(behave)


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


def _raw(data: bytes) -> Fault:
    """Bytes that are no HTTP, or more of it than anyone reads."""

    async def behave(_: LocalServer, __: Seen, request: web.Request) -> web.Response:
        request.transport.write(data)
        request.transport.close()
        return web.Response()

    return Fault(behave)


def _bomb(encoding: str) -> Fault:
    """A JSON text of 40 MiB in a few hundred kilobytes; twice compressed where two are named."""

    @cache
    def packed() -> bytes:
        plain = b'{"choices": "' + b"0" * 40 * 2**20 + b'"}'
        data = zlib.compress(plain, 1) if encoding == "deflate" else gzip.compress(plain, 1)
        return gzip.compress(data) if "," in encoding else data

    return _sent(lambda *_: packed(), Content_Encoding=encoding)


def _packed(
    compress: Callable[[bytes], bytes], encoding: str, ending: Ending = "retryable"
) -> Fault:
    """A good reply, compressed."""
    return _sent(
        lambda body, _: compress(json.dumps(body).encode()),
        ending=ending,
        Content_Encoding=encoding,
    )


def _half(data: bytes) -> bytes:
    return data[: len(data) // 2]


def _nested(body: dict[str, Any], _: Seen) -> dict[str, Any]:
    deep: list[Any] = []
    for _level in range(400):
        deep = [deep]
    return {**body, "extra": deep}


def _error(message: Any, code: Any) -> dict[str, Any]:
    return {"error": {"message": message, "type": "api_error", "param": None, "code": code}}


_DEEP = b'{"choices": ' + b"[" * 100_000 + b"]" * 100_000 + b"}"
_QUOTA = "You exceeded your current quota"

WIRE_FAULTS: Mapping[str, Fault] = {
    **{
        f"redirect-{status}-{'away' if away else 'here'}": Fault(
            partial(_redirect, status=status, away=away), "unavailable"
        )
        for status in (301, 302, 303, 307, 308)
        for away in (False, True)
    },
    "redirect-nowhere": _sent(status=302, ending="unavailable"),
    "redirect-garbled": _sent(status=302, ending="unavailable", Location="http://[::1/v1"),
    # Bodies that come with status 200 and are no reply.
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
    # Answers by their status alone.
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
    # Good replies in which something is changed.
    "null-choices": _emptied(None),
    "choices-of-strings": _emptied(["a", "b"]),
    "choices-object": _emptied({"0": {}}),
    "deep-beside-choices": _sent(_nested),
    "surrogate": _sent(lambda body, _: _texts(body, "Step1: \ud800 index 1"), ending="reply"),
    "echo-key-in-reply": _sent(_with_key, ending="reply"),
    "usage-missing": _usage("missing"),
    "usage-null": _usage(None),
    "usage-zero": _usage(0),
    "usage-negative": _usage(-1_000_000),
    "usage-huge": _usage(10**30),
    "usage-true": _usage(True),
    "usage-fraction": _usage(12.5),
    "usage-text": _usage("many"),
    # The key in an error: quoted as JSON, in a text cut short, or in a page.
    "echo-key-json": _echo("bad key {}".format),
    "echo-key-cut": _echo((485 * "x" + " {}").format),
    "echo-key-page": _sent(
        lambda _, seen: f"<html>{'x' * 60} {seen.key}</html>".encode(), Content_Type="text/html"
    ),
    # Connections that break, and bodies that end early, never end or explode.
    "reset": Fault(_reset),
    "cut": _sent(lambda body, _: _half(json.dumps(body).encode())),
    "html": _sent(b"<html>Bad gateway</html>", Content_Type="text/html"),
    "reset-midway": Fault(partial(_reset_midway, claimed=0, resets=True)),
    "short-body": Fault(partial(_reset_midway, claimed=5_000, resets=False)),
    "no-http": _raw(b"HELO mail.example\r\n\r\n"),
    "no-head": _raw(b""),
    "huge-header": _raw(b"HTTP/1.1 200 OK\r\nX: " + b"x" * 200_000 + b"\r\n\r\n"),
    "bad-chunk": _raw(b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\nxyz\r\n"),
    "endless": _stream(b" " * 65_536),
    "endless-gzip": _stream(gzip.compress(b" " * 2**20), Content_Encoding="gzip"),
    "drip": _stream(b" ", pause_s=0.02),
    "gzip": _packed(gzip.compress, "gzip", "reply"),
    "deflate": _packed(zlib.compress, "deflate", "reply"),
    "gzip-cut": _packed(lambda plain: _half(gzip.compress(plain)), "gzip"),
    "gzip-that-is-none": _packed(bytes, "gzip"),
    "brotli-that-is-none": _packed(gzip.compress, "br"),
    "gzip-bomb": _bomb("gzip"),
    "deflate-bomb": _bomb("deflate"),
    "gzip-twice-bomb": _bomb("gzip, gzip"),
}
