"""Records of a run as flat rows that any tool can read, with what was asked and answered."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from phyblock.records.files import read_records, record_types
from phyblock.records.record import PictureMark, PromptMessage, Record
from phyblock.run.store import read_prompts
from phyblock.tables.load import Run
from phyblock.tracks.estimates import numbers_of, stored_counts

__all__ = ["as_json", "export_rows", "newest_records", "prompt_text", "track_columns"]

_SAMPLE = ("sample", "track", "model", "scene", "seed")
_REPLY = ("finish", "cost_usd", "latency_s", "provider_model", "attempts", "cached")
_USAGE = ("prompt_tokens", "completion_tokens", "reasoning_tokens")


def newest_records(run: Run) -> list[Record]:
    """The newest record of every sample, models in the suite's order."""
    order = {name: place for place, name in enumerate(run.design.model_names)}
    return sorted(
        read_records(run.path),
        key=lambda r: (r.track, order.get(r.model, len(order)), r.sample),
    )


def export_rows(run: Run) -> Iterator[dict[str, Any]]:
    """One row a sample: what was asked, of whom, the reply, what was read, and the counts.

    Counts are `tp_<setting>`, `fp_<setting>`, `fn_<setting>` of the headline matcher, all levels
    by the `aov` criterion (of episodes: over placed blocks); `count_<name>_<column>` are those of
    other measures. Every row has the same columns;
    what a track does not have is None. `levels`, `parents` and `plan` are lists.
    """
    prompts = read_prompts(run.path)
    for record in newest_records(run):
        reply, error = record.reply, record.error
        plan = getattr(record.parse, "plan", None)
        yield {
            **{name: getattr(record, name) for name in _SAMPLE},
            **({"variant": record.way.key} if run.design.suite.vary.factors else {}),
            "levels": list(record.levels),
            "parents": list(record.parents),
            "n_blocks": record.n_blocks,
            "outcome": record.outcome,
            "prompt": prompt_text(record, prompts),
            "reply": reply and reply.text,
            "reasoning": reply and reply.reasoning,
            **{name: getattr(reply, name, None) for name in _REPLY},
            **{name: getattr(reply and reply.usage, name, None) for name in _USAGE},
            "error": error and error.message,
            "asked": record.asked,
            "rule": getattr(record.parse, "rule", None),
            "plan": None if plan is None else list(plan),
            **dict.fromkeys(track_columns()),
            **record.export_row(),
            **_counts(run, record),
            **_own_counts(run, record),
        }


def prompt_text(record: Record, prompts: Mapping[str, Sequence[PromptMessage]]) -> str | None:
    """The prompt as it was sent, pictures by their labels; None where none was stored."""
    messages = None if record.prompt is None else prompts.get(record.prompt.messages)
    if messages is None:
        return None
    parts = (part for message in messages for part in message.parts)
    return "\n".join(
        f"[picture: {part.image}]" if isinstance(part, PictureMark) else part for part in parts
    )


def _counts(run: Run, record: Record) -> dict[str, int | None]:
    found: dict[str, int | None] = {
        f"{name}_{setting.lower()}": None
        for setting in run.design.suite.settings
        for name in ("tp", "fp", "fn")
    }
    for score in record.scores:
        is_headline = score.matcher in (None, "", run.design.matcher)
        if is_headline and score.criterion in ("aov", "placed"):
            counts = {"tp": score.tp, "fp": score.fp, "fn": score.fn}
            found |= {f"{name}_{score.setting.lower()}": n for name, n in counts.items()}
    return found


def track_columns() -> dict[str, str]:
    """Columns that tracks add, with their types in pandas."""
    return {name: kind for record in record_types() for name, kind in record.exported.items()}


def _own_counts(run: Run, record: Record) -> dict[str, float | None]:
    """What measures count beside `scores`: `count_<name>_<column>`."""
    found: dict[str, float | None] = {}
    for track in run.design.suite.tracks:
        for counted in stored_counts(track):
            names = [f"count_{counted.name}_{column}" for column in counted.columns]
            mine = record.counts if record.track == track else {}
            numbers = numbers_of(counted, mine, record.sample)
            found |= dict(zip(names, numbers, strict=True)) if numbers else dict.fromkeys(names)
    return found


def as_json(value: object) -> object:
    """Lists as JSON text, for formats of flat cells."""
    return json.dumps(value) if isinstance(value, list) else value
