"""Records as CSV, Parquet, and as a Hugging Face dataset."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pandas as pd

from phyblock.report.export.rows import as_json, export_rows, track_columns
from phyblock.resources import needs
from phyblock.tables.csv_text import to_csv as csv_text
from phyblock.tables.load import Run

__all__ = ["EXPORTS", "export_frame", "to_csv", "to_hf", "to_parquet"]

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
