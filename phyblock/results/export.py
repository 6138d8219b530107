"""A run in the formats of other tools: CSV, Parquet, Hugging Face datasets; a row a sample."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from phyblock.files import OutFolder, writing
from phyblock.records.files import read_prompts, read_records, record_types
from phyblock.records.record import PictureMark, PromptMessage, Record
from phyblock.resources import needs
from phyblock.results.estimates import numbers_of, stored_counts
from phyblock.results.load import Run
from phyblock.results.text import to_csv as csv_text

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
    """Return the counts of measures beside `scores`: `count_<name>_<column>`."""
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


_WHOLE = (
    "n_blocks",
    "attempts",
    "prompt_tokens",
    "completion_tokens",
    "reasoning_tokens",
)
_TRUTH = ("cached",)
_NUMBERS = ("cost_usd", "latency_s")
_NOT_TEXT = ("seed", "levels", "parents", "plan")


def export_frame(run: Run) -> pd.DataFrame:
    """`export_rows` as a frame whose columns have the same types whatever the rows are."""
    rows = list(export_rows(run))
    columns = list(rows[0]) if rows else []
    counts = tuple(name for name in columns if name[:3] in ("tp_", "fp_", "fn_"))
    kinds = dict.fromkeys((*_WHOLE, *counts), "Int64")
    kinds |= dict.fromkeys(_TRUTH, "boolean") | dict.fromkeys(_NUMBERS, "Float64")
    kinds |= dict.fromkeys((name for name in columns if name.startswith("count_")), "Float64")
    kinds |= track_columns()
    data = {}
    for name in columns:
        kind = kinds.get(name, "object" if name in _NOT_TEXT[1:] else "string")
        values = [row[name] for row in rows]
        data[name] = pd.Series(values, dtype="int64" if name == "seed" else kind)
    return pd.DataFrame(data)


def to_csv(run: Run, folder: Path) -> tuple[Path, ...]:
    """`records.csv`: a row a sample; lists stand as JSON."""
    frame = export_frame(run)
    for name in _NOT_TEXT[1:]:
        if name in frame:
            frame[name] = frame[name].map(as_json)
    path = folder / "records.csv"
    path.write_bytes(csv_text(frame).encode("utf-8", "replace"))
    return (path,)


def to_parquet(run: Run, folder: Path) -> tuple[Path, ...]:
    """`records.parquet`: a row a sample, lists as lists.

    Raises SpecError where the `pyarrow` package is not installed.
    """
    needs("pyarrow", "hf", "parquet")
    path = folder / "records.parquet"
    export_frame(run).to_parquet(path, index=False, engine="pyarrow")
    return (path,)


def to_hf(run: Run, folder: Path) -> tuple[Path, ...]:
    """A folder that `datasets.load_from_disk` opens, and `load_dataset` by its Parquet file.

    Raises SpecError where the `datasets` package is not installed.
    """
    needs("datasets", "hf", "hf")
    from datasets import Dataset, utils  # type: ignore[import-untyped]

    (path,) = to_parquet(run, folder)
    dataset = Dataset.from_pandas(export_frame(run), preserve_index=False)
    utils.disable_progress_bars()
    dataset.save_to_disk(folder / "dataset")
    return path, folder / "dataset"


EXPORTS: dict[str, Callable[[Run, Path], tuple[Path, ...]]] = {
    "csv": to_csv,
    "parquet": to_parquet,
    "hf": to_hf,
}
"""Formats of one table by the word after `--to`."""


FORMATS = tuple(EXPORTS)
"""Words for `--to`."""


def export_run(run: Run, form: str, folder: Path | None = None) -> tuple[Path, ...]:
    """Write a run in another format into `folder` (export/FORMAT in the run's); what was written.

    Raises StoreError where the folder cannot be written or a file is in the way that we never
    wrote, SpecError where a package is missing.
    """
    out = OutFolder(folder or run.path)
    below = "" if folder else f"export/{form}/"
    target = out.path / below
    with writing(target), out.making(below) as made:
        files = EXPORTS[form](run, made)
    return tuple(target / file.relative_to(made) for file in files)
