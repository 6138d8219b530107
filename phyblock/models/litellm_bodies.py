"""Bodies made fit for litellm, which takes token counts as they come, or fails on them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace

from phyblock.models.http_client import Answer
from phyblock.models.replay import token_count

__all__ = ["readable_body"]

_USAGE_BESIDE = {
    "choices": ("usage", {}),
    "content": ("usage", {"input_tokens": 0, "output_tokens": 0}),
    "candidates": ("usageMetadata", {}),
}
"""Where a body with this field says what it took, and how it would say that it does not know."""


def readable_body(answer: Answer, body: object) -> Answer:
    """The answer with 0, which is read as unknown, in the place of counts that cannot be one.

    `body` is its decoded body. An answer whose counts are all in order is returned as it is, byte
    for byte.
    """
    if not isinstance(body, Mapping):
        return answer
    usages = [usage for field, usage in _USAGE_BESIDE.items() if field in body]
    if not usages:
        return answer
    name, unknown = usages[0]
    told = body.get(name)
    counts = _believable(told) if isinstance(told, Mapping) else unknown
    return answer if told == counts else _with(answer, {**body, name: counts})


def _with(answer: Answer, body: Mapping[str, object]) -> Answer:
    return replace(answer, body=json.dumps(body).encode())


def _believable(value: object, name: str = "") -> object:
    """A usage with 0 for every number of tokens that is none, at any depth."""
    if isinstance(value, Mapping):
        return {key: _believable(item, str(key)) for key, item in value.items()}
    if isinstance(value, list):
        return [_believable(item) for item in value]
    is_count = "token" in name.lower() or isinstance(value, int | float)
    return value if not is_count or token_count(value) is not None else 0
