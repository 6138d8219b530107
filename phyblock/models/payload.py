"""From a request to the JSON of the OpenAI chat protocol, which litellm speaks too.

`wire_messages` gives messages as litellm takes them, `json_body` a whole request body as bytes;
both say the same. Pictures make up nearly all of a body, so they enter it without passing through
the JSON encoder: base64 has nothing to escape.
"""

from __future__ import annotations

import base64
import json
import secrets
from collections.abc import Callable, Mapping
from typing import Any

from phyblock.config.models import ModelConfig
from phyblock.errors import DataError, Problem
from phyblock.models.base import Image, Message, Request
from phyblock.types import ImageDetail

__all__ = ["data_uri", "json_body", "mime_type", "wire_messages", "wire_params"]

_MAGIC = (
    (b"\x89PNG\r\n\x1a\n", "image/png"),
    (b"\xff\xd8\xff", "image/jpeg"),
    (b"GIF8", "image/gif"),
)


def mime_type(image: Image) -> str:
    """MIME type by the bytes themselves: providers refuse a label that they do not bear out.

    Raises DataError when the picture is none of PNG, JPEG, GIF and WebP.
    """
    for magic, name in _MAGIC:
        if image.data.startswith(magic):
            return name
    if image.data[:4] == b"RIFF" and image.data[8:12] == b"WEBP":
        return "image/webp"
    where = f"picture {image.label!r}"
    found = repr(image.data[:8])
    raise DataError(Problem(where, "is no picture", "", found, "PNG, JPEG, GIF or WebP"))


def data_uri(image: Image) -> str:
    """The picture as a `data:` URI."""
    return f"data:{mime_type(image)};base64,{base64.b64encode(image.data).decode('ascii')}"


def wire_messages(
    messages: tuple[Message, ...], detail: ImageDetail | None
) -> list[dict[str, Any]]:
    """Chat messages, texts and pictures in the order given; a lone text is a plain string.

    `detail` is how closely pictures are looked at; None leaves it to the provider.
    """
    return _messages(messages, data_uri, detail)


def json_body(
    fields: Mapping[str, Any], messages: tuple[Message, ...], detail: ImageDetail | None
) -> bytes:
    """A request body: `messages` in place of that field, beside all others."""
    pictures: list[bytes] = []

    def placeholder(image: Image) -> str:
        pictures.append(f"data:{mime_type(image)};base64,".encode() + base64.b64encode(image.data))
        return mark

    mark = secrets.token_hex(16)
    body = {**fields, "messages": _messages(messages, placeholder, detail)}
    first, *others = json.dumps(body, allow_nan=False).encode().split(mark.encode())
    pieces = [first]
    for picture, piece in zip(pictures, others, strict=True):
        pieces += [picture, piece]
    return b"".join(pieces)


def wire_params(config: ModelConfig, request: Request) -> dict[str, Any]:
    """What to send beside the messages: the request's sampling parameters, overridden by the
    model's, and the format of the answer where the model takes one; None is not sent.
    """
    merged = {**request.params, **config.params}
    if config.sends_format and request.response_format is not None:
        merged["response_format"] = request.response_format
    return {name: value for name, value in merged.items() if value is not None}


def _messages(
    messages: tuple[Message, ...], url_of: Callable[[Image], str], detail: ImageDetail | None
) -> list[dict[str, Any]]:
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
