"""Records of a run as flat rows that any tool can read, with what was asked and answered."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from importlib import import_module
from typing import Any

from phyblock.errors import Problem, SpecError
from phyblock.run.prompts import read_prompts
from phyblock.run.reading import read_records
from phyblock.tables.load import Run

__all__ = ["as_json", "export_rows", "needs", "newest_records", "prompt_text"]

_REPLY = ("finish", "cost_usd", "latency_s", "provider_model", "attempts", "cached")
_USAGE = ("prompt_tokens", "completion_tokens", "reasoning_tokens")
_QUESTION = ("id", "subtask", "category", "rotation")
_ANSWER = ("right", "given", "correct")


def needs(package: str, extra: str, form: str) -> None:
    """Raise SpecError that names the extra to install where a package of a format is not there."""
    try:
        import_module(package)
    except ImportError as error:
        name, hint = package.partition(".")[0], f"pip install 'phyblock[{extra}]'"
        raise SpecError(Problem(f"--to {form}", f"needs the package {name}", hint=hint)) from error


def newest_records(run: Run) -> list[dict[str, Any]]:
    """The newest record of every sample, models in the suite's order."""
    order = {name: place for place, name in enumerate(run.design.model_names)}
    return sorted(
        read_records(run.path).values(),
        key=lambda r: (r["track"], order.get(r["model"], len(order)), r["sample"]),
    )


def export_rows(run: Run) -> Iterator[dict[str, Any]]:
    """One row a sample: what was asked, of whom, the reply, what was read, and the counts.

    Counts are `tp_<setting>`, `fp_<setting>`, `fn_<setting>` of the headline matcher, all levels
    by the `aov` criterion (step planning: over placed blocks). Every row has the same columns;
    what a track does not have is None. `levels`, `parents` and `plan` are lists.
    """
    prompts = read_prompts(run.path)
    for record in newest_records(run):
        reply, error = record.get("reply") or {}, record.get("error") or {}
        question, answer = record.get("question") or {}, record.get("answer") or {}
        parse = record.get("parse") or {}
        usage = reply.get("usage") or {}
        yield {
            **{name: record[name] for name in ("sample", "track", "model", "scene", "seed")},
            "levels": [int(level) for level in record["levels"]],
            "parents": [str(parent) for parent in record.get("parents") or ()],
            "n_blocks": record["n_blocks"],
            "outcome": record["outcome"],
            "prompt": prompt_text(record, prompts),
            "reply": reply.get("text"),
            "reasoning": reply.get("reasoning"),
            **{name: reply.get(name) for name in _REPLY},
            **{name: usage.get(name) for name in _USAGE},
            "error": error.get("message"),
            "rule": parse.get("rule"),
            "plan": parse.get("plan"),
            **{f"question_{name}": question.get(name) for name in _QUESTION},
            **{f"answer_{name}": answer.get(name) for name in _ANSWER},
            "ending": record.get("ending"),
            **_counts(run, record),
        }


def prompt_text(record: Mapping[str, Any], prompts: Mapping[str, Any]) -> str | None:
    """The prompt as it was sent, pictures by their labels; None where none was stored."""
    messages = prompts.get((record.get("prompt") or {}).get("messages") or "")
    if messages is None:
        return None
    parts = (part for message in messages for part in message["parts"])
    return "\n".join(
        part if isinstance(part, str) else f"[picture: {part['image']}]" for part in parts
    )


def _counts(run: Run, record: Mapping[str, Any]) -> dict[str, int | None]:
    found: dict[str, int | None] = {
        f"{name}_{setting.lower()}": None
        for setting in run.design.suite.settings
        for name in ("tp", "fp", "fn")
    }
    for score in record["scores"]:
        if score["criterion"] in ("aov", "placed") and score.get("matcher") in (
            None,
            "",
            run.design.matcher,
        ):
            found |= {f"{n}_{score['setting'].lower()}": score[n] for n in ("tp", "fp", "fn")}
    return found


def as_json(value: object) -> object:
    """Lists as JSON text, for formats of flat cells."""
    return json.dumps(value) if isinstance(value, list) else value
