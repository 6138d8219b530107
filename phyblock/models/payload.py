"""From a request to the JSON of the OpenAI chat protocol, which litellm speaks too."""

from __future__ import annotations

import base64
from typing import Any

from phyblock.errors import DataError, Problem
from phyblock.models.base import Image, Message, Request
from phyblock.models.config import ModelConfig

__all__ = ["data_uri", "mime_type", "wire_messages", "wire_params"]

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


def wire_messages(messages: tuple[Message, ...]) -> list[dict[str, Any]]:
    """Chat messages, texts and pictures in the order given; a lone text is a plain string."""
    return [{"role": message.role, "content": _content(message)} for message in messages]


def wire_params(config: ModelConfig, request: Request) -> dict[str, Any]:
    """Sampling parameters to send: the request's, overridden by the model's; None is not sent."""
    merged = {**request.params, **config.params}
    return {name: value for name, value in merged.items() if value is not None}


def _content(message: Message) -> str | list[dict[str, Any]]:
    if len(message.parts) == 1 and isinstance(message.parts[0], str):
        return message.parts[0]
    return [_part(part) for part in message.parts]


def _part(part: str | Image) -> dict[str, Any]:
    if isinstance(part, str):
        return {"type": "text", "text": part}
    return {"type": "image_url", "image_url": {"url": data_uri(part)}}
