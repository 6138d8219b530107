"""Bodies made fit for litellm, which takes token counts as they come, or fails on them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace

from phyblock.models.http_client import Answer
from phyblock.models.raw_replies import token_count

__all__ = ["readable_body"]

_USAGES = ("usage", "usageMetadata", "usage_metadata", "meta")


def readable_body(answer: Answer, body: object) -> Answer:
    """The answer with 0, which is read as unknown, in the place of counts that cannot be one.

    `body` is its decoded body. An answer without such counts is returned as it is, byte for byte.
    """
    if not isinstance(body, Mapping):
        return answer
    counts = {name: _believable(body[name]) for name in _USAGES if name in body}
    if all(body[name] == counts[name] for name in counts):
        return answer
    return replace(answer, body=json.dumps({**body, **counts}).encode())


def _believable(value: object, name: str = "") -> object:
    """A usage with 0 for every number of tokens that is none, at any depth."""
    if isinstance(value, Mapping):
        return {key: _believable(item, str(key)) for key, item in value.items()}
    if isinstance(value, list):
        return [_believable(item) for item in value]
    is_count = "token" in name.lower() or isinstance(value, int | float)
    return value if not is_count or token_count(value) is not None else 0
