"""Stored records as flat rows, and rows as data frames of fixed columns and types."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import pandas as pd

from phyblock.run.records import paid_usd
from phyblock.scoring import ERROR_TYPES

__all__ = ["TEXTS", "flat_record", "flat_scores", "frame_of"]

TEXTS = ("text", "reasoning")
"""Columns that may be long."""

_RECORD_TYPES: dict[str, str] = {
    "sample": "object",
    "track": "object",
    "model": "object",
    "scene": "object",
    "levels": "object",
    "parents": "object",
    "n_blocks": "Int64",
    "seed": "int64",
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
    "parser": "object",
    "rule": "object",
    "plan": "object",
    "dropped": "object",
    "question": "object",
    "subtask": "object",
    "rotation": "Int64",
    "right": "object",
    "given": "object",
    "time": "object",
}

_SCORE_TYPES: dict[str, str] = {
    "sample": "object",
    "track": "object",
    "model": "object",
    "scene": "object",
    "seed": "int64",
    "outcome": "object",
    "criterion": "object",
    "matcher": "object",
    "setting": "object",
    "tp": "int64",
    "fp": "int64",
    "fn": "int64",
    **dict.fromkeys(ERROR_TYPES, "Int64"),
}

_TYPES = {"records": _RECORD_TYPES, "scores": _SCORE_TYPES}


def flat_record(record: Mapping[str, Any]) -> dict[str, Any]:
    """One row of the records frame.

    Raises KeyError, TypeError, ValueError or AttributeError for what is not a record.
    """
    reply = record.get("reply") or {}
    error = record.get("error") or {}
    prompt = record.get("prompt") or {}
    parse = record.get("parse") or {}
    return {
        **_sample(record),
        "levels": tuple(int(level) for level in record["levels"]),
        "parents": tuple(record.get("parents") or ()),
        "n_blocks": record.get("n_blocks"),
        **{name: reply.get(name) for name in _REPLY},
        **{name: (reply.get("usage") or {}).get(name) for name in _USAGE},
        "paid_usd": paid_usd(record) if reply else None,
        "error_kind": error.get("kind"),
        "error_status": error.get("status"),
        "error_message": error.get("message"),
        "template": prompt.get("template"),
        "prompt_version": prompt.get("version"),
        **{name: parse.get(name) for name in ("parser", "rule", "plan", "dropped")},
        **_question(record),
        "time": record.get("time"),
    }


_REPLY = (
    *TEXTS,
    "finish",
    "cost_usd",
    "latency_s",
    "provider_model",
    "attempts",
    "cached",
    "seed_sent",
)
_USAGE = ("prompt_tokens", "completion_tokens", "reasoning_tokens")


def _question(record: Mapping[str, Any]) -> dict[str, Any]:
    """Which question it is, the letters that are right and those given; for other tracks None."""
    question, answer = record.get("question") or {}, record.get("answer") or {}
    return {
        "question": question.get("id"),
        "subtask": question.get("subtask"),
        "rotation": question.get("rotation"),
        "right": answer.get("right"),
        "given": answer.get("given"),
    }


def flat_scores(record: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Rows of the scores frame; raises as `flat_record`."""
    sample = _sample(record)
    return [
        {
            **sample,
            "criterion": score["criterion"],
            "matcher": score["matcher"] or "",
            "setting": score["setting"],
            **{name: int(score[name]) for name in ("tp", "fp", "fn")},
            **{name: (score.get("errors") or {}).get(name) for name in ERROR_TYPES},
        }
        for score in record["scores"] or ()
    ]


def _sample(record: Mapping[str, Any]) -> dict[str, Any]:
    return {
        **{name: str(record[name]) for name in ("sample", "track", "model", "scene")},
        "seed": int(record["seed"]),
        "outcome": str(record["outcome"]),
    }


def frame_of(kind: Literal["records", "scores"], rows: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """Rows as a frame whose columns and types do not depend on the rows.

    Columns of text stay Python objects, so that long replies are never copied.
    """
    return pd.DataFrame(
        {
            name: pd.Series([row[name] for row in rows], dtype=dtype)
            for name, dtype in _TYPES[kind].items()
        }
    )
