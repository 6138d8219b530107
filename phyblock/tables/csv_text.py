"""Data frames as CSV text."""

from __future__ import annotations

import pandas as pd

from phyblock.text import csv_cell

__all__ = ["to_csv"]


def to_csv(frame: pd.DataFrame, float_format: str | None = None) -> str:
    """A frame as CSV, without its index; no text in it is taken for a formula (see `csv_cell`)."""
    safe = frame.rename(columns=csv_cell)
    for name, kind in safe.dtypes.items():
        if not pd.api.types.is_numeric_dtype(kind):
            cells = [csv_cell(value) for value in safe[name]]
            safe[name] = pd.Series(cells, index=safe.index, dtype=object)
    text: str = safe.to_csv(index=False, float_format=float_format, lineterminator="\n")
    return text
