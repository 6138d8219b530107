"""Recorded replies and baselines that answer instead of a model, and raw replies of providers.

Known are the shapes of the official outputs: chat completions, Anthropic messages, Gemini responses
(as the REST API and as its Python client write them), and a text under `predict`, `text` or
`response`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from phyblock.config.models import ModelConfig
from phyblock.errors import DataError, Problem, RefusedError, SampleError, SpecError, reason_of
from phyblock.files import load_json, read_text
from phyblock.models.request import Request
from phyblock.records.files import RECORDS, RecordLines
from phyblock.records.record import Record, Reply, Usage
from phyblock.registry import baseline_names, baseline_rules
from phyblock.stable import drawn_bytes
from phyblock.text import well_formed
from phyblock.types import Finish

_NO_TOKENS = Usage(prompt_tokens=0, completion_tokens=0)
_MOST_TOKENS = 10**9
"""A hundred times the longest context that there is."""

_FINISH: Mapping[str, Finish] = {
    **dict.fromkeys(("stop", "end_turn", "stop_sequence", "eos", "eos_token"), "stop"),
    **dict.fromkeys(("length", "max_tokens", "model_context_window_exceeded"), "length"),
    **dict.fromkeys(("content_filter", "content_filtered", "refusal", "safety"), "refusal"),
    **dict.fromkeys(("recitation", "blocklist", "prohibited_content"), "refusal"),
    **dict.fromkeys(("spii", "image_safety"), "refusal"),
}
"""Words for the end of a reply, in lower case, by provider's dialect."""


_FREE = {"cost_usd": 0.0, "attempts": 0, "cached": False}


class LocalModel:
    """A model that answers without a network and for free: recorded replies, or a rule.

    It looks at no prompt and no picture, and so none is made for it.
    """

    needs_messages = False

    def __init__(self, name: str, answer: Callable[[Request], Reply | None]) -> None:
        self.name = name
        self._answer = answer

    async def ask(self, request: Request) -> Reply | None:
        """Return the answer to the request; None where nothing was recorded.

        Raises the error that was recorded; DataError for a recording that cannot be read, or an
        oracle that lacks a candidate; SpecError for a track that a baseline has no rule for.
        """
        reply = self._answer(request)
        return None if reply is None else reply.model_copy(update=_FREE)

    async def aclose(self) -> None:
        """Nothing is held open."""


def open_replay(config: ModelConfig) -> LocalModel:
    """Open the recording that a configuration names.

    A folder with `records.jsonl` is a run of phyblock, any other a folder of raw replies. Raises
    DataError when there is no such folder, or no JSON in it.
    """
    folder = config.recording
    if folder is None or not folder.is_dir():
        where, found = f"model {config.name}", str(folder)
        raise DataError(Problem(where, "recordings not found", "replay", found, "a folder"))
    if (folder / RECORDS).is_file():
        return LocalModel(config.name, partial(_recorded, _read_records(folder, config.name)))
    if not any(folder.glob("*.json")):
        allowed = f"a file a scene such as 000.json, or {RECORDS}"
        raise DataError(Problem(str(folder), "holds no recorded replies", allowed=allowed))
    return LocalModel(config.name, partial(_read_file, folder))


def open_baseline(config: ModelConfig) -> LocalModel:
    """Return the baseline that a configuration names; SpecError where there is none.

    What it draws depends on its name, the seed and the request's key alone, not on the order in
    which it is asked.
    """
    name = config.name
    if name not in baseline_names():
        allowed = ", ".join(baseline_names())
        raise SpecError(Problem(f"model {name}", "is no baseline", "", name, allowed))
    rules = baseline_rules(name)

    def answer(request: Request) -> Reply:
        if (rule := rules.get(request.track)) is None:
            raise SpecError(Problem(f"model {name}", "has no rule for this track"))
        digest = drawn_bytes(f"{name}|{request.seed}|{request.key}")
        text = rule(request.subject, np.random.default_rng(int.from_bytes(digest, "big")))
        return Reply(text=text, usage=_NO_TOKENS, provider_model=name)

    return LocalModel(name, answer)


def _read_file(folder: Path, request: Request) -> Reply | None:
    """Return the raw reply in `<key>.json`, whatever the seed."""
    path = folder / f"{request.key}.json"
    if not path.is_file():
        return None
    try:
        raw = load_json(read_text(path))
    except OSError as error:
        raise DataError(Problem(str(path), f"cannot be read: {reason_of(error)}")) from error
    except ValueError as error:
        where = f"{path}:{getattr(error, 'lineno', 1)}:{getattr(error, 'colno', 1)}"
        raise DataError(Problem(where, f"is not JSON: {error}")) from error
    return read_raw_reply(raw, str(path))


_Records = dict[tuple[str, str, int], Record]


def _read_records(folder: Path, model: str) -> _Records:
    """Read the records of one model, or of the only one, by track, key and seed."""
    found: dict[str, _Records] = {}
    for _, record in RecordLines(folder):
        if not record.variant:
            found.setdefault(record.model, {})[record.track, record.key, record.seed] = record
    if model in found or len(found) == 1:
        return found.get(model) or next(iter(found.values()))
    where = str(folder / RECORDS)
    message = "has no records of this model"
    raise DataError(Problem(where, message, "model", model, ", ".join(found)))


def _recorded(known: _Records, request: Request) -> Reply | None:
    """Return the reply recorded for a request, or None; raise the error that was recorded."""
    record = known.get((request.track, request.key, request.seed))
    error = None if record is None else record.error
    if error is not None and error.kind in ("sample", "refused"):
        cls = RefusedError if error.kind == "refused" else SampleError
        raise cls(error.message, status=error.status)
    return None if record is None else record.reply


def read_raw_reply(raw: object, where: str) -> Reply:
    """Read a decoded JSON document; `where` names it in errors.

    Raises DataError when it has no known shape.
    """
    for read in (read_chat_completion, _anthropic, _gemini, _text_alone):
        if (reply := read(raw)) is not None:
            return reply
    found = f"keys {', '.join(map(str, raw))}" if isinstance(raw, Mapping) else type(raw).__name__
    allowed = "a chat completion, an Anthropic message, a Gemini response, predict, text, response"
    raise DataError(Problem(where, "is no recorded reply of a known shape", "", found, allowed))


def read_chat_completion(raw: object) -> Reply | None:
    """Read OpenAI's shape and its copies: `choices[0].message`, or `choices[0].text`."""
    choice = _get(raw, "choices.0")
    message = choice.get("message", choice) if isinstance(choice, Mapping) else None
    if not isinstance(message, Mapping) or not {"content", "text", "refusal"} & message.keys():
        return None
    text, thoughts = _parts(message.get("content", message.get("text")))
    beside = _text(message.get("reasoning_content") or message.get("reasoning"))
    refusal, details = message.get("refusal"), "usage.prompt_tokens_details"
    cached = f"{details}.cached_tokens", "usage.cached_tokens", "usage.prompt_cache_hit_tokens"
    written = f"{details}.cache_write_tokens", f"{details}.cache_creation_tokens"
    usage = Usage(
        prompt_tokens=_count(raw, "usage.prompt_tokens"),
        completion_tokens=_count(raw, "usage.completion_tokens"),
        reasoning_tokens=_count(raw, "usage.completion_tokens_details.reasoning_tokens"),
        cached_tokens=_count(raw, *cached),
        cache_write_tokens=_count(raw, *written),
    )
    return _reply(
        text or _text(refusal),
        "\n".join(filter(None, (beside, thoughts))),
        "refusal" if refusal and not text else _finish(_get(choice, "finish_reason")),
        usage,
        _get(raw, "model"),
    )


def _anthropic(raw: object) -> Reply | None:
    """Read Anthropic Messages, whose `input_tokens` are those that no cache knows."""
    content = _get(raw, "content")
    if not isinstance(content, list) or not all(isinstance(b, Mapping) for b in content):
        return None
    fresh, out = _count(raw, "usage.input_tokens"), _count(raw, "usage.output_tokens")
    usage = Usage(completion_tokens=out)
    if fresh is not None:
        cached = _count(raw, "usage.cache_read_input_tokens")
        written = _count(raw, "usage.cache_creation_input_tokens")
        usage = Usage(
            prompt_tokens=fresh + (cached or 0) + (written or 0),
            completion_tokens=out,
            cached_tokens=cached,
            cache_write_tokens=written,
        )
    return _reply(*_parts(content), _finish(_get(raw, "stop_reason")), usage, _get(raw, "model"))


def _gemini(raw: object) -> Reply | None:
    """Read generateContent; without candidates it is empty if it says why or what it took."""
    if not isinstance(raw, Mapping) or "candidates" not in raw:
        return None
    candidate = _get(raw, "candidates.0")
    blocked = _get(_get(raw, "promptFeedback", "prompt_feedback"), "blockReason", "block_reason")
    counts = _get(raw, "usageMetadata", "usage_metadata")
    if not isinstance(candidate, Mapping) and not blocked and counts is None:
        return None
    usage = Usage(
        prompt_tokens=_count(counts, "promptTokenCount", "prompt_token_count"),
        completion_tokens=_count(counts, "candidatesTokenCount", "candidates_token_count"),
        reasoning_tokens=_count(counts, "thoughtsTokenCount", "thoughts_token_count"),
        cached_tokens=_count(counts, "cachedContentTokenCount", "cached_content_token_count"),
    )
    finish = _finish(_get(candidate, "finishReason", "finish_reason"))
    text, thoughts = _parts(_get(candidate, "content.parts"))
    model = _get(raw, "modelVersion", "model_version")
    return _reply(text, thoughts, "refusal" if blocked else finish, usage, model)


def _text_alone(raw: object) -> Reply | None:
    """Read a dump with the reply under one name."""
    text = _get(raw, "predict", "text", "response")
    return _reply(text) if isinstance(text, str) else None


def _reply(
    text: str,
    reasoning: str = "",
    finish: Finish = "unknown",
    usage: Usage | None = None,
    model: object = "",
) -> Reply:
    """Return a reply in which characters that no file can hold (lone surrogates) are replaced."""
    return Reply(
        text=well_formed(text),
        reasoning=well_formed(reasoning),
        finish=finish,
        usage=usage or Usage(),
        provider_model=well_formed(_text(model)),
    )


def _finish(word: object) -> Finish:
    """Return the end that a provider's word stands for."""
    return _FINISH.get(str(word).rpartition(".")[2].lower(), "unknown")


def _parts(content: object) -> tuple[str, str]:
    """Return text and thoughts of a content: a string, or a list of parts in any dialect."""
    if isinstance(content, str):
        return content, ""
    texts: list[str] = []
    thoughts: list[str] = []
    for part in content if isinstance(content, list) else []:
        if thinking := _text(_get(part, "thinking")):
            thoughts.append(thinking)
        elif _get(part, "thought") is True:
            thoughts.append(_text(_get(part, "text")))
        else:
            texts.append(part if isinstance(part, str) else _text(_get(part, "text")))
    return "".join(texts), "\n".join(text for text in thoughts if text)


def _get(raw: object, *paths: str) -> Any:
    """Return the first value other than null that a path leads to, such as `choices.0.text`;
    else None. The name 0 stands for the first item of a list.
    """
    for path in paths:
        value = raw
        for name in path.split("."):
            if name == "0":
                value = value[0] if isinstance(value, list) and value else None
            else:
                value = value.get(name) if isinstance(value, Mapping) else None
        if value is not None:
            return value
    return None


def _count(raw: object, *paths: str) -> int | None:
    """Return the first number of tokens that can be one; None, not known, where there is none."""
    found = (_get(raw, path) for path in paths)
    counts = (count for count in found if isinstance(count, int) and not isinstance(count, bool))
    return next((count for count in counts if 0 <= count <= _MOST_TOKENS), None)


def _text(value: object) -> str:
    return value if isinstance(value, str) else ""
