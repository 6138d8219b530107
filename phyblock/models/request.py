"""Requests, the protocol of models, and the JSON of the OpenAI chat protocol."""

from __future__ import annotations

import base64
import functools
import itertools
import json
import secrets
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from operator import attrgetter
from typing import Any, Protocol

from phyblock.config.models import ModelConfig
from phyblock.errors import DataError, PhyblockError, Problem
from phyblock.records.record import Call, Reply
from phyblock.text import hex_digest
from phyblock.types import ImageDetail, Role

_MARK = secrets.token_hex(16)
"""Placeholder of a picture, which no text can contain."""
_MAGIC = (
    (b"\x89PNG\r\n\x1a\n", "image/png"),
    (b"\xff\xd8\xff", "image/jpeg"),
    (b"GIF8", "image/gif"),
    (b"RIFF", "image/webp"),
)


@dataclass(frozen=True)
class Image:
    """An encoded picture as sent; `label` is "goal", "candidates", ..."""

    data: bytes = field(repr=False)
    label: str
    width_px: int
    height_px: int

    @functools.cached_property
    def sha256(self) -> str:
        """Hex digest of the encoded bytes."""
        return hex_digest(self.data)

    @functools.cached_property
    def data_uri(self) -> str:
        """The picture as a `data:` URI, its type taken from its bytes: providers refuse wrong ones.

        It is cached for several models. Raises DataError unless it is PNG, JPEG, GIF or WebP.
        """
        mime = next((name for magic, name in _MAGIC if self.data.startswith(magic)), "")
        if not mime:
            where, found = f"picture {self.label!r}", repr(self.data[:8])
            raise DataError(Problem(where, "is not a picture", "", found, "PNG, JPEG, GIF or WebP"))
        return f"data:{mime};base64,{base64.b64encode(self.data).decode('ascii')}"


@dataclass(frozen=True)
class Message:
    """One chat message: text and pictures in the order in which they are sent."""

    role: Role
    parts: tuple[str | Image, ...]


@dataclass(frozen=True)
class Request:
    """One question to a model.

    `key` names the question inside its `track`; recordings are looked up by both. `params` are
    sampling parameters by their OpenAI names, `prompt_version` is a digest of the template,
    `subject` the input of baselines, `sample` an id. `response_format` asks for JSON, not text.
    """

    key: str
    seed: int
    messages: tuple[Message, ...]
    params: Mapping[str, object]
    prompt_version: str
    subject: object
    response_format: Mapping[str, object] | None = None
    track: str = ""
    sample: str = ""

    @property
    def images(self) -> tuple[Image, ...]:
        """The pictures in the order sent."""
        parts = itertools.chain.from_iterable(message.parts for message in self.messages)
        return tuple(part for part in parts if isinstance(part, Image))


class Model(Protocol):
    """Anything that answers requests: a provider, a recording, a baseline."""

    @property
    def name(self) -> str:
        """Its name in tables."""

    @property
    def needs_messages(self) -> bool:
        """True if prompts and pictures must be made for it.

        False for recordings, which are looked up by a request's key (their original prompts are not
        known), and for baselines, which use only the request's subject.
        """

    async def ask(self, request: Request) -> Reply | None:
        """Return the reply, or None if a recording has none for the request.

        Raises RetryableError if all attempts failed, SampleError or RefusedError if this request
        cannot succeed, UnavailableError if the model cannot answer at all, BudgetReachedError if
        the call exceeds the cost limit, and HaltedError if a person ended the session.

        When cancelled while it waits for its turn, it gives up at once. When cancelled during a
        request, which is paid for, it returns the answer; a second cancellation gives it up too.
        """

    async def aclose(self) -> None:
        """Release connections; the model is not used afterwards."""


class Journal(Protocol):
    """The journal of calls, written before they are sent and when they have ended."""

    def kept(self, key: str) -> Reply | None:
        """Return the reply to a request of an earlier command, or None."""

    async def sent(self, model: str, sample: str, key: str, most_usd: float | None) -> Call:
        """Write a call that is about to be sent."""

    async def ended(self, call: Call, billed_usd: float | None, reply: Reply | None) -> None:
        """Write the end of a call."""


class HaltedError(PhyblockError):
    """The run was ended before this request was sent."""


def wire_params(config: ModelConfig, request: Request) -> dict[str, Any]:
    """Return the fields to send besides the messages: the request's sampling parameters,
    overridden by the model's, and the answer format if the model accepts one; None is not sent.
    """
    merged = {**request.params, **config.params}
    if config.response_format == "always" and request.response_format is not None:
        merged["response_format"] = request.response_format
    return {name: value for name, value in merged.items() if value is not None}


def json_body(fields: Mapping[str, Any], request: Request, detail: ImageDetail | None) -> bytes:
    """Return a request body. Pictures bypass the encoder: base64 has nothing to escape."""
    pictures = [image.data_uri for image in request.images]
    body = {**fields, "messages": wire_messages(request.messages, detail, lambda _: _MARK)}
    first, *others = json.dumps(body, allow_nan=False).split(_MARK)
    return "".join((first, *itertools.chain(*zip(pictures, others, strict=True)))).encode()


def wire_messages(
    messages: tuple[Message, ...],
    detail: ImageDetail | None,
    url_of: Callable[[Image], str] = attrgetter("data_uri"),
) -> list[dict[str, Any]]:
    """Return chat messages, texts and pictures in the order given; a single text is a plain string.

    `detail` is the detail of pictures; None is the provider's default.
    """

    def part(part: str | Image) -> dict[str, Any]:
        if isinstance(part, str):
            return {"type": "text", "text": part}
        looked_at = {} if detail is None else {"detail": detail}
        return {"type": "image_url", "image_url": {"url": url_of(part), **looked_at}}

    def content(message: Message) -> str | list[dict[str, Any]]:
        if len(message.parts) == 1 and isinstance(message.parts[0], str):
            return message.parts[0]
        return [part(each) for each in message.parts]

    return [{"role": message.role, "content": content(message)} for message in messages]
