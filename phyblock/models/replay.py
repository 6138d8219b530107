"""Recorded replies and baselines, which answer instead of a model."""

from __future__ import annotations

from codecs import BOM_UTF8
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from phyblock.config.models import ModelConfig
from phyblock.errors import DataError, Problem, RefusedError, SampleError, SpecError, reason_of
from phyblock.files import read_bytes
from phyblock.models.client import read_raw_reply
from phyblock.models.request import Request
from phyblock.records.files import RECORDS, RecordLines
from phyblock.records.record import Record, Reply, Usage, decode
from phyblock.registry import baseline_names, baseline_rules
from phyblock.text import drawn_bytes

_NO_TOKENS = Usage(prompt_tokens=0, completion_tokens=0)
_FREE = {"cost_usd": 0.0, "attempts": 0, "cached": False}


@dataclass(frozen=True)
class LocalModel:
    """A local, free model: recorded replies, or a rule. It needs neither prompts nor pictures."""

    name: str
    answer: Callable[[Request], Reply | None]
    needs_messages: bool = False

    async def ask(self, request: Request) -> Reply | None:
        """Return the answer to the request, or None if nothing was recorded.

        Raises the recorded error, DataError for a bad file, SpecError for a track without a rule.
        """
        reply = self.answer(request)
        return None if reply is None else reply.model_copy(update=_FREE)

    async def aclose(self) -> None:
        """Do nothing: nothing is held open."""


def open_replay(config: ModelConfig) -> LocalModel:
    """Open the recording of a configuration.

    With `records.jsonl` it is a run, else raw replies. Raises DataError if it is missing or empty.
    """
    folder, name = Path(config.replay or ""), config.name
    if not (folder / RECORDS).is_file():
        if not any(folder.glob("*.json")):
            allowed = f"a file a scene such as 000.json, or {RECORDS}"
            raise DataError(Problem(str(folder), "holds no recorded replies", allowed=allowed))
        return LocalModel(name, partial(_read_file, folder))
    # By model, then by track, key and seed.
    found_in: dict[str, dict[tuple[str, str, int], Record]] = {}
    for _, record in RecordLines(folder):
        if not record.variant:
            of_model = found_in.setdefault(record.model, {})
            of_model[record.track, record.key, record.seed] = record
    if name not in found_in and len(found_in) != 1:
        where, allowed = str(folder / RECORDS), ", ".join(found_in)
        raise DataError(Problem(where, "has no records of this model", "model", name, allowed))
    known = found_in.get(name) or next(iter(found_in.values()))

    def recorded(request: Request) -> Reply | None:
        record = known.get((request.track, request.key, request.seed))
        error = None if record is None else record.error
        if error is not None and error.kind in ("sample", "refused"):
            cls = RefusedError if error.kind == "refused" else SampleError
            raise cls(error.message, status=error.status)
        return None if record is None else record.reply

    return LocalModel(name, recorded)


def open_baseline(config: ModelConfig) -> LocalModel:
    """Return the baseline of a configuration. Raises SpecError if there is none.

    Its random numbers depend only on its name, the seed and the request's key, not on order.
    """
    name = config.name
    if name not in baseline_names():
        allowed = ", ".join(baseline_names())
        raise SpecError(Problem(f"model {name}", "is not a baseline", "", name, allowed))
    rules = baseline_rules(name)

    def answer(request: Request) -> Reply:
        if (rule := rules.get(request.track)) is None:
            raise SpecError(Problem(f"model {name}", "has no rule for this track"))
        digest = drawn_bytes(f"{name}|{request.seed}|{request.key}")
        text = rule(request.subject, np.random.default_rng(int.from_bytes(digest, "big")))
        return Reply(text=text, usage=_NO_TOKENS, provider_model=name)

    return LocalModel(name, answer)


def _read_file(folder: Path, request: Request) -> Reply | None:
    """Return the raw reply in `<key>.json`, for any seed."""
    path = folder / f"{request.key}.json"
    if not path.is_file():
        return None
    try:
        data = read_bytes(path).removeprefix(BOM_UTF8)
    except (OSError, ValueError) as error:
        raise DataError(Problem(str(path), f"cannot be read: {reason_of(error)}")) from error
    return read_raw_reply(decode(TypeAdapter(Any), data, str(path)), str(path))
