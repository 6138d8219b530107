"""Raw provider replies, as recordings hold them, to text, reasoning, end and tokens.

Each shape is a small reader that returns None for anything that is not of its shape. Known are the
six shapes of the official outputs and their near relatives.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from phyblock.errors import DataError, Problem
from phyblock.records.reply import Usage
from phyblock.text import well_formed
from phyblock.types import Finish

__all__ = [
    "RawReply",
    "finish_of",
    "read_chat_completion",
    "read_raw_reply",
    "token_count",
]

_MOST_TOKENS = 10**9
"""Counts above this are believed by nobody: a hundred times the longest context that there is."""

_FINISH: Mapping[str, Finish] = {
    "stop": "stop",
    "end_turn": "stop",
    "stop_sequence": "stop",
    "eos": "stop",
    "eos_token": "stop",
    "length": "length",
    "max_tokens": "length",
    "model_context_window_exceeded": "length",
    "content_filter": "refusal",
    "content_filtered": "refusal",
    "refusal": "refusal",
    "safety": "refusal",
    "recitation": "refusal",
    "blocklist": "refusal",
    "prohibited_content": "refusal",
    "spii": "refusal",
    "image_safety": "refusal",
}
"""Words for the end of a reply, in lower case, by provider's dialect."""


@dataclass(frozen=True)
class RawReply:
    """What a raw reply says; `shape` names the form in which it was found.

    Characters of its texts that no file can hold (lone surrogates) are replaced.
    """

    shape: str
    text: str
    reasoning: str = ""
    finish: Finish = "unknown"
    usage: Usage = field(default_factory=Usage)
    model: str = ""

    def __post_init__(self) -> None:
        for name in ("text", "reasoning", "model"):
            object.__setattr__(self, name, well_formed(getattr(self, name)))


def finish_of(word: object) -> Finish:
    """The end that a provider's word stands for."""
    return _FINISH.get(str(word).rpartition(".")[2].lower(), "unknown")


def read_raw_reply(raw: object, where: str) -> RawReply:
    """Read a decoded JSON document; `where` names it in errors.

    Raises DataError when it has no known shape.
    """
    for reader in _READERS:
        reply = reader(raw)
        if reply is not None:
            return reply
    found = f"keys {', '.join(map(str, raw))}" if isinstance(raw, Mapping) else type(raw).__name__
    allowed = "a chat completion, an Anthropic message, a Gemini response, predict, text, response"
    raise DataError(Problem(where, "is no recorded reply of a known shape", "", found, allowed))


def read_chat_completion(raw: object) -> RawReply | None:
    """OpenAI and all that copy it: `choices[0].message`, or `choices[0].text` of completions."""
    choice = _first(_get(raw, "choices"))
    if not isinstance(choice, Mapping):
        return None
    message = choice.get("message", choice)
    if not isinstance(message, Mapping) or not {"content", "text", "refusal"} & message.keys():
        return None
    text, thoughts = _parts(message.get("content", message.get("text")))
    refusal = message.get("refusal")
    return RawReply(
        "chat completion",
        text or (refusal if isinstance(refusal, str) else ""),
        _joined([_text(message.get("reasoning_content") or message.get("reasoning")), thoughts]),
        "refusal" if refusal and not text else finish_of(choice.get("finish_reason")),
        _usage(_get(raw, "usage"), "prompt_tokens", "completion_tokens"),
        _text(_get(raw, "model")),
    )


def _dashscope(raw: object) -> RawReply | None:
    """DashScope's own form: an `output` with `choices`, or with a `text`."""
    output = _get(raw, "output")
    inner = read_chat_completion(output)
    if inner is None and isinstance(_get(output, "text"), str):
        finish = finish_of(_get(output, "finish_reason"))
        inner = RawReply("", output["text"], finish=finish)
    if inner is None:
        return None
    usage = _usage(_get(raw, "usage"), "input_tokens", "output_tokens")
    return RawReply("DashScope", inner.text, inner.reasoning, inner.finish, usage)


def _anthropic(raw: object) -> RawReply | None:
    """Anthropic Messages: `content` is a list of text and thinking blocks."""
    content = _get(raw, "content")
    if not isinstance(content, list) or not all(isinstance(b, Mapping) for b in content):
        return None
    text, thoughts = _parts(content)
    return RawReply(
        "Anthropic message, thinking" if thoughts else "Anthropic message",
        text,
        thoughts,
        finish_of(_get(raw, "stop_reason")),
        _anthropic_usage(_get(raw, "usage")),
        _text(_get(raw, "model")),
    )


def _gemini(raw: object) -> RawReply | None:
    """Gemini generateContent, in the REST names or those of the Python client.

    An answer without candidates is an empty reply when it says why or what it took.
    """
    if not isinstance(raw, Mapping) or "candidates" not in raw:
        return None
    candidate = _first(raw["candidates"])
    blocked = _get(_get(raw, "promptFeedback", "prompt_feedback"), "blockReason", "block_reason")
    counts = _get(raw, "usageMetadata", "usage_metadata")
    if not isinstance(candidate, Mapping) and not blocked and counts is None:
        return None
    parts = _get(_get(candidate, "content"), "parts")
    text, thoughts = _parts(parts if isinstance(parts, list) else [])
    finish = finish_of(_get(candidate, "finishReason", "finish_reason"))
    usage = Usage(
        prompt_tokens=token_count(_get(counts, "promptTokenCount", "prompt_token_count")),
        completion_tokens=token_count(
            _get(counts, "candidatesTokenCount", "candidates_token_count")
        ),
        reasoning_tokens=token_count(_get(counts, "thoughtsTokenCount", "thoughts_token_count")),
        cached_tokens=token_count(
            _get(counts, "cachedContentTokenCount", "cached_content_token_count")
        ),
    )
    model = _text(_get(raw, "modelVersion", "model_version"))
    return RawReply("Gemini", text, thoughts, "refusal" if blocked else finish, usage, model)


def _conversation(raw: object) -> RawReply | None:
    """LLaVA's training form: a list of turns, of which the model's last one counts."""
    turns = _get(raw, "conversations", "conversation", "messages")
    if not isinstance(turns, list):
        return None
    for turn in reversed(turns):
        if _get(turn, "from", "role") in ("gpt", "assistant", "model"):
            text, thoughts = _parts(_get(turn, "value", "content"))
            return RawReply("conversation", text, thoughts)
    return None


def _single_field(raw: object) -> RawReply | None:
    """A dump with the reply under one name; `predict` stands beside a dataset's own `output`."""
    for name in ("predict", "prediction", "text", "response", "answer", "outputs", "output"):
        value = _get(raw, name)
        if isinstance(value, list) and len(value) == 1:
            value = value[0]
        if isinstance(value, str):
            return RawReply(name, value)
    inner = _get(raw, "response", "body")
    if isinstance(inner, Mapping):
        return next((reply for reader in _READERS if (reply := reader(inner))), None)
    return None


def _bare(raw: object) -> RawReply | None:
    if isinstance(raw, list) and len(raw) == 1:
        raw = raw[0]
        if isinstance(raw, Mapping):
            return next((reply for reader in _READERS if (reply := reader(raw))), None)
    return RawReply("text", raw) if isinstance(raw, str) else None


_READERS: tuple[Callable[[object], RawReply | None], ...] = (
    read_chat_completion,
    _dashscope,
    _anthropic,
    _gemini,
    _conversation,
    _single_field,
    _bare,
)


def _parts(content: object) -> tuple[str, str]:
    """Text and thoughts of a content: a string, or a list of parts in any dialect."""
    if isinstance(content, str):
        return content, ""
    texts: list[str] = []
    thoughts: list[str] = []
    for part in content if isinstance(content, list) else []:
        thinking = _text(_get(part, "thinking"))
        if thinking:
            thoughts.append(thinking)
        elif _get(part, "thought") is True:
            thoughts.append(_text(_get(part, "text")))
        else:
            texts.append(part if isinstance(part, str) else _text(_get(part, "text")))
    return "".join(texts), _joined(thoughts)


def _joined(texts: list[str]) -> str:
    return "\n".join(text for text in texts if text)


def _usage(counts: object, prompt: str, completion: str) -> Usage:
    details = _get(counts, "completion_tokens_details", "output_tokens_details")
    kept = _get(counts, "prompt_tokens_details", "input_tokens_details")
    cached = _get(kept, "cached_tokens")
    if cached is None:
        cached = _get(counts, "cached_tokens", "prompt_cache_hit_tokens")
    return Usage(
        prompt_tokens=token_count(_get(counts, prompt)),
        completion_tokens=token_count(_get(counts, completion)),
        reasoning_tokens=token_count(_get(details, "reasoning_tokens")),
        cached_tokens=token_count(cached),
        cache_write_tokens=token_count(_get(kept, "cache_write_tokens", "cache_creation_tokens")),
    )


def _anthropic_usage(counts: object) -> Usage:
    """Anthropic's own counts, where `input_tokens` are those that no cache knows."""
    usage = _usage(counts, "input_tokens", "output_tokens")
    cached = token_count(_get(counts, "cache_read_input_tokens"))
    written = token_count(_get(counts, "cache_creation_input_tokens"))
    if usage.prompt_tokens is None:
        return usage
    prompt = usage.prompt_tokens + (cached or 0) + (written or 0)
    return usage.model_copy(
        update={"prompt_tokens": prompt, "cached_tokens": cached, "cache_write_tokens": written}
    )


def token_count(value: object) -> int | None:
    """A number of tokens as a server wrote it; None, not known, for what cannot be one."""
    if not isinstance(value, int) or isinstance(value, bool):
        return None
    return value if 0 <= value <= _MOST_TOKENS else None


def _get(raw: object, *names: str) -> Any:
    """The first of the names that a mapping holds with a value, else None."""
    if not isinstance(raw, Mapping):
        return None
    return next((raw[name] for name in names if raw.get(name) is not None), None)


def _first(items: object) -> object:
    return items[0] if isinstance(items, list) and items else None


def _text(value: object) -> str:
    return value if isinstance(value, str) else ""
