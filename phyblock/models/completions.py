"""A chat completion that a server sent: validated, then made a reply."""

from __future__ import annotations

import re
from collections.abc import Mapping

from phyblock.errors import ModelError, RetryableError
from phyblock.models.replay import read_chat_completion
from phyblock.records.reply import Reply, Usage

__all__ = ["read_completion"]

_THINKING = re.compile(r"\s*<(think|thinking)>(.*?)</\1>\s*(.*)", re.DOTALL)


def read_completion(body: object, latency_s: float, status: int = 200) -> Reply:
    """The reply in a decoded body of a success.

    Thoughts that a server leaves in the text between think tags become reasoning, as litellm does
    it. Raises RetryableError when the body is no chat completion, or one without choices, or when
    it cannot be read for another reason.
    """
    try:
        return _read(body, latency_s, status)
    except ModelError:
        raise
    except Exception as error:
        # It was answered, and is billed, whatever keeps us from reading it.
        why = f"malformed reply: {type(error).__name__}: {error}"
        raise RetryableError(f"HTTP {status}: {why}", status=status) from None


def _read(body: object, latency_s: float, status: int) -> Reply:
    raw = read_chat_completion(body)
    if raw is None:
        why = f"malformed reply: no choices in it (found {_found(body)})"
        raise RetryableError(f"HTTP {status}: {why}", status=status)
    text, reasoning = raw.text, raw.reasoning
    if not reasoning and (match := _THINKING.match(text)):
        reasoning, text = match[2], match[3]
    usage = _believed(raw.usage, text, reasoning)
    return Reply(
        text=text,
        reasoning=reasoning,
        finish=raw.finish,
        usage=usage,
        latency_s=latency_s,
        provider_model=raw.provider_model,
    )


def _believed(usage: Usage, text: str, reasoning: str) -> Usage:
    """The usage without zeros that stand for "not known": nothing is made of no tokens.

    litellm puts them where a server sends no usage; no prompt of ours is empty.
    """
    prompt, completion, thoughts = (
        usage.prompt_tokens or None,
        usage.completion_tokens,
        usage.reasoning_tokens,
    )
    if completion == 0 and (prompt is None or text or reasoning):
        completion = None
    return usage.model_copy(
        update={
            "prompt_tokens": prompt,
            "completion_tokens": completion,
            "reasoning_tokens": None if thoughts == 0 and reasoning else thoughts,
        }
    )


def _found(body: object) -> str:
    """What a body holds in the place of a reply, with what it says in words."""
    if not isinstance(body, Mapping):
        return type(body).__name__
    said = [body[name] for name in ("message", "detail") if isinstance(body.get(name), str)]
    return ": ".join([", ".join(map(str, body)) or "nothing", *said])
