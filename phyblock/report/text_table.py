"""A table as text: what Markdown, LaTeX and the terminal are all made from."""

from __future__ import annotations

import math
from dataclasses import dataclass

__all__ = ["NO_VALUE", "SPREAD", "Column", "TextTable", "number", "spread"]

NO_VALUE = "–"  # noqa: RUF001
"""What stands in a cell that has no value; it is not a zero."""
SPREAD = " ± "
"""What stands between a mean and its standard deviation."""


@dataclass(frozen=True)
class Column:
    """A column; neighbors of one `group` share a heading. Numbers are aligned to the right."""

    name: str
    group: str = ""
    is_text: bool = False


@dataclass(frozen=True)
class TextTable:
    """Cells as they are shown, row by row, with a caption and notes."""

    caption: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()


def number(value: object, digits: int = 1, *, signed: bool = False) -> str:
    """A number with `digits` decimals, `NO_VALUE` for NaN."""
    shown = float(str(value))
    if math.isnan(shown):
        return NO_VALUE
    rounded = round(shown, digits) + 0.0
    return f"{rounded:{'+' if signed and rounded else ''}.{digits}f}"


def spread(mean: object, sd: object) -> str:
    """`47.1 ± 1.2`; the mean alone where there is no standard deviation."""
    return number(mean) if math.isnan(float(str(sd))) else f"{number(mean)}{SPREAD}{number(sd)}"
