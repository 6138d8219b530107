"""A chat completion that a server sent: validated, then made a reply."""

from __future__ import annotations

import re
from collections.abc import Mapping

from phyblock.errors import RetryableError
from phyblock.models.base import Reply
from phyblock.models.raw_replies import read_chat_completion

__all__ = ["read_completion"]

_THINKING = re.compile(r"\s*<(think|thinking)>(.*?)</\1>\s*(.*)", re.DOTALL)


def read_completion(body: object, latency_s: float) -> Reply:
    """The reply in a decoded body of a 200.

    Thoughts that a server leaves in the text between think tags become reasoning, as litellm does
    it. Raises RetryableError when the body is no chat completion, or one without choices.
    """
    raw = read_chat_completion(body)
    if raw is None:
        keys = ", ".join(map(str, body)) if isinstance(body, Mapping) else type(body).__name__
        raise RetryableError(f"malformed reply: no choices in it (found {keys})", status=200)
    text, reasoning = raw.text, raw.reasoning
    if not reasoning and (match := _THINKING.match(text)):
        reasoning, text = match[2], match[3]
    return Reply(
        text, reasoning, raw.finish, raw.usage, latency_s=latency_s, provider_model=raw.model
    )
