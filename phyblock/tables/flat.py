"""Records as data frames of fixed columns and types, column by column as they are read.

A record is let go as soon as its values are in the columns. Equal values are one object, so that
what is kept of a record is little more than its numbers.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import pandas as pd

from phyblock.records.files import record_types
from phyblock.records.record import Record, Score
from phyblock.scoring.plan import BLOCK_OUTCOMES, ERROR_TYPES

__all__ = ["BLOCK_COLUMNS", "MATCHED", "TOKENS", "Flattened", "joined_counts"]

BLOCK_COLUMNS = {name: f"blocks_{name}" for name in BLOCK_OUTCOMES}
"""Columns of scores that say what became of the goal's blocks."""
MATCHED = ("tp", "fp", "fn")
"""Columns that count steps and blocks by whether they match."""

_TEXTS = ("text", "reasoning")
"""Columns that may be long."""

_RECORD_TYPES: dict[str, str] = {
    "sample": "object",
    "track": "object",
    "model": "object",
    "scene": "object",
    "item": "object",
    "levels": "object",
    "parents": "object",
    "n_blocks": "Int64",
    "seed": "int64",
    "variant": "object",
    "outcome": "object",
    "text": "object",
    "reasoning": "object",
    "finish": "object",
    "prompt_tokens": "Int64",
    "completion_tokens": "Int64",
    "reasoning_tokens": "Int64",
    "cost_usd": "float64",
    "paid_usd": "float64",
    "latency_s": "float64",
    "provider_model": "object",
    "attempts": "Int64",
    "cached": "boolean",
    "seed_sent": "boolean",
    "error_kind": "object",
    "error_status": "Int64",
    "error_message": "object",
    "template": "object",
    "prompt_version": "object",
    "asked": "object",
    "rule": "object",
    "time": "object",
    "counts": "object",
}
"""Columns that records of all tracks have; each track adds its own."""

_SCORE_TYPES: dict[str, str] = {
    "sample": "object",
    "track": "object",
    "model": "object",
    "scene": "object",
    "seed": "int64",
    "variant": "object",
    "outcome": "object",
    "criterion": "object",
    "matcher": "object",
    "setting": "object",
    **dict.fromkeys(MATCHED, "int64"),
    **dict.fromkeys((*ERROR_TYPES, *BLOCK_COLUMNS.values(), *Score.FURTHER), "Int64"),
}

_OF_SAMPLE = ("sample", "track", "model", "scene", "seed", "variant", "outcome")
"""Columns of scores that are those of the record."""
_REPLY = ("finish", "cost_usd", "latency_s", "provider_model", "attempts", "cached", "seed_sent")
TOKENS = ("prompt_tokens", "completion_tokens", "reasoning_tokens")
"""Columns that count tokens."""
_COUNTS = (*MATCHED, *ERROR_TYPES, *BLOCK_COLUMNS.values(), *Score.FURTHER)
_LABELS = ("criterion", "matcher", "setting")
_UNKNOWN = -(2**62)
"""Stands for a count that there is not."""


class Flattened:
    """The columns of both frames while records are read; `texts` keeps those of replies."""

    def __init__(self, *, texts: bool = True) -> None:
        self._texts = texts
        self._rows: dict[str, int] = {}
        self._types = dict(_RECORD_TYPES)
        for kind in record_types():
            self._types.update(kind.columns)
        self._records: dict[str, list[Any]] = {name: [] for name in self._types}
        self._first, self._n_scores = array("q"), array("q")
        self._labels: dict[str, list[str]] = {name: [] for name in _LABELS}
        self._counts = {name: array("q") for name in _COUNTS}
        self._shared: dict[Any, Any] = {}

    def add(self, record: Record) -> None:
        """Take in a record; it replaces an earlier one of its sample."""
        row = self._rows.setdefault(record.sample, len(self._rows))
        # A slice beyond the end appends.
        values = self._flat(record)
        for name, column in self._records.items():
            column[row : row + 1] = (values.get(name),)
        self._first[row : row + 1] = array("q", (len(self._counts["tp"]),))
        self._n_scores[row : row + 1] = array("q", (len(record.scores),))
        for score in record.scores:
            self._add_score(score)

    def frames(self, place: Callable[[str], int]) -> tuple[pd.DataFrame, pd.DataFrame]:
        """One row a sample, and one a score, by track, `place` of the model, scene and seed.

        Columns and types do not depend on the records. Columns of text stay Python objects, so
        that long replies are never copied. What was read is used up: call it once.
        """
        order = self._order(place)
        columns = {}
        for name, kind in self._types.items():
            column = self._records.pop(name)
            columns[name] = pd.Series(_objects(column)[order], dtype=kind, copy=False)
        records = pd.DataFrame(columns, copy=False)
        return records, self._scores(records, order)

    def _order(self, place: Callable[[str], int]) -> np.ndarray[Any, np.dtype[np.intp]]:
        names = ("track", "model", "scene", "seed", "sample")
        track, model, scene, seed, sample = (self._records[name] for name in names)
        rows = sorted(
            range(len(sample)),
            key=lambda n: (track[n], place(model[n]), model[n], scene[n], seed[n], sample[n]),
        )
        return np.array(rows, dtype=np.intp)

    def _scores(
        self, records: pd.DataFrame, order: np.ndarray[Any, np.dtype[np.intp]]
    ) -> pd.DataFrame:
        lengths = np.array(self._n_scores, dtype=np.intp)[order]
        ends = np.cumsum(lengths)
        shifts = np.array(self._first, dtype=np.intp)[order] - (ends - lengths)
        kept = np.repeat(shifts, lengths) + np.arange(lengths.sum())
        owners = np.repeat(np.arange(len(order)), lengths)
        columns = {}
        for name, kind in _SCORE_TYPES.items():
            if name in _OF_SAMPLE:
                values = records[name].to_numpy()[owners]
            elif name in _LABELS:
                values = _objects(self._labels.pop(name))[kept]
            else:
                values = _counts(self._counts.pop(name), kept, kind)
            columns[name] = pd.Series(values, dtype=kind, copy=False)
        return pd.DataFrame(columns, copy=False)

    def _add_score(self, score: Score) -> None:
        for name, label in zip(
            _LABELS, (score.criterion, score.matcher or "", score.setting), strict=True
        ):
            self._labels[name].append(self._share(label))
        errors, blocks = score.errors or {}, score.blocks or {}
        counts = (
            *(getattr(score, name) for name in MATCHED),
            *(errors.get(name) for name in ERROR_TYPES),
            *(blocks.get(name) for name in BLOCK_OUTCOMES),
            *(getattr(score, name) for name in Score.FURTHER),
        )
        for name, count in zip(_COUNTS, counts, strict=True):
            self._counts[name].append(_UNKNOWN if count is None else count)

    def _share(self, value: Any) -> Any:
        """The one object that stands for all that equal it."""
        return self._shared.setdefault(value, value)

    def _flat(self, record: Record) -> dict[str, Any]:
        """One row of the records frame."""
        row = _row(record)
        if not self._texts:
            row.update(dict.fromkeys(_TEXTS))
        for name, value in row.items():
            if isinstance(value, (str, tuple)) and name not in _TEXTS:
                row[name] = self._share(value)
        return row


def _row(record: Record) -> dict[str, Any]:
    reply, error, prompt = record.reply, record.error, record.prompt
    return {
        **{name: getattr(record, name) for name in _OF_SAMPLE},
        "variant": record.way.key,
        **{name: getattr(record, name) for name in ("item", "levels", "parents", "n_blocks")},
        **{name: getattr(reply, name, None) for name in (*_TEXTS, *_REPLY)},
        **{name: getattr(reply and reply.usage, name, None) for name in TOKENS},
        "paid_usd": reply and record.paid_usd,
        "error_kind": error and error.kind,
        "error_status": error and error.status,
        "error_message": error and error.message,
        "template": prompt and prompt.template,
        "prompt_version": prompt and prompt.version,
        "asked": record.asked,
        "rule": _rule(record.parse),
        "time": record.time or None,
        "counts": record.counts or None,
        **record.row(),
    }


def _objects(values: Iterable[Any]) -> np.ndarray[Any, Any]:
    """Values as they are, also where they are sequences themselves."""
    objects = list(values)
    made = np.empty(len(objects), dtype=object)
    made[:] = objects
    return made


def _counts(column: array[int], rows: np.ndarray[Any, np.dtype[np.intp]], kind: str) -> Any:
    values = np.frombuffer(column, dtype=np.int64)[rows] if column else np.zeros(0, np.int64)
    return pd.arrays.IntegerArray(values, values == _UNKNOWN) if kind == "Int64" else values


def _rule(parse: Any) -> str | None:
    """The rule that matched, of whatever a track says of its parsing."""
    rule = parse.get("rule") if isinstance(parse, dict) else getattr(parse, "rule", None)
    return None if rule is None else str(rule)


def joined_counts(columns: pd.DataFrame) -> pd.DataFrame:
    """Counts that a join brought, 0 where it found none."""
    # Out of an empty frame columns of any type come, and pandas fills these with a warning.
    return columns.astype("float64").fillna(0).astype("int64")
