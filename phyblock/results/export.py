"""The samples of a run as rows, for other tools."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from phyblock.files import OutFolder
from phyblock.records.files import RecordLines, read_prompts, record_types
from phyblock.records.record import PictureMark, PromptMessage, Record
from phyblock.results.load import TOKENS, Run
from phyblock.results.text import to_csv

_SAME = (
    *("sample", "track", "model", "scene", "seed", "levels", "parents", "n_blocks", "outcome"),
    *("finish", "rule", "cost_usd", "latency_s", "attempts", *TOKENS, "cached"),
)
"""Columns that frames of records also have, with types that know of missing values."""
_TEXTS = ("prompt", "reply", "reasoning", "provider_model", "error", "asked")


def export_frame(run: Run) -> pd.DataFrame:
    """Return one row per sample: prompt, model, reply, parsed answer and counts.

    Counts are `tp_<setting>`, `fp_<setting>`, `fn_<setting>` of the headline matcher, all levels by
    the `aov` criterion (for episodes over placed blocks). Columns have the same types for any rows;
    values that a track does not have are missing. `levels`, `parents` and `plan` are lists.
    """
    types = {**dict.fromkeys(_TEXTS, "string"), "plan": "object"}
    for record in record_types():
        types |= {column: kind for column, (kind, _) in record.exported.items()}
    for setting in run.design.suite.settings:
        types |= {f"{name}_{setting.lower()}": "Int64" for name in ("tp", "fp", "fn")}
    frame = run.records[list(_SAME)]
    lists = frame[["levels", "parents"]].map(list)
    nullable = {"object": "string", "float64": "Float64"}
    frame = frame.astype({n: nullable.get(str(kind), kind) for n, kind in frame.dtypes.items()})
    frame[["levels", "parents"]] = lists
    if run.design.suite.vary.factors:
        frame.insert(5, "variant", run.records["variant"].astype("string"))
    prompts = read_prompts(run.path)
    rows = [_row(run, one, prompts) for one in RecordLines(run.path).at(run.records["start"])]
    return frame.join(pd.DataFrame(rows, frame.index, list(types)).astype(types))


def _row(
    run: Run, record: Record, prompts: Mapping[str, Sequence[PromptMessage]]
) -> dict[str, Any]:
    """Return the values of a record that a frame of records does not have."""
    reply, plan = record.reply, getattr(record.parse, "plan", None)
    messages = None if record.prompt is None else prompts.get(record.prompt.messages)
    parts = [part for message in messages or () for part in message.parts]
    found: dict[str, Any] = {
        # As it was sent, pictures by their labels; None if none was stored.
        "prompt": None if messages is None else "\n".join(
            f"[picture: {part.image}]" if isinstance(part, PictureMark) else part for part in parts
        ),
        "reply": reply and reply.text,
        "reasoning": reply and reply.reasoning,
        "provider_model": reply and reply.provider_model,
        "error": record.error and record.error.message,
        "asked": record.asked,
        "plan": None if plan is None else list(plan),
        **record.export_row(),
    }  # fmt: skip
    for score in record.scores:
        is_headline = score.matcher in (None, "", run.design.matcher)
        if is_headline and score.criterion in ("aov", "placed"):
            counts = {"tp": score.tp, "fp": score.fp, "fn": score.fn}
            found |= {f"{name}_{score.setting.lower()}": n for name, n in counts.items()}
    return found


def write_csv(run: Run, folder: Path) -> tuple[Path, ...]:
    """Write the rows of a run as `records.csv`, lists as JSON; return its path.

    Raises StoreError if it cannot be written, or would replace a file that is not phyblock's.
    """
    frame = export_frame(run)
    for name in ("levels", "parents", "plan"):
        as_json = [json.dumps(v) if isinstance(v, list) else v for v in frame[name]]
        frame[name] = pd.Series(as_json, dtype="object")
    return OutFolder(folder).write({"records.csv": to_csv(frame)})
