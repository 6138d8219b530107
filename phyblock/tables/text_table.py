"""A table as text: what Markdown, LaTeX and the terminal are all made from."""

from __future__ import annotations

import math
from collections.abc import Collection, Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from phyblock.text import one_line

__all__ = [
    "NO_VALUE",
    "SPREAD",
    "Column",
    "TextTable",
    "between",
    "level_name",
    "number",
    "spread",
    "track_column",
    "track_text",
    "with_interval",
]

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
    """Cells as they are shown, row by row, with a caption and notes, each on one line.

    Names that models and people gave stand in them: newlines and control characters become spaces.
    """

    caption: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        columns = (Column(one_line(c.name), one_line(c.group), c.is_text) for c in self.columns)
        plain = {
            "caption": one_line(self.caption),
            "columns": tuple(columns),
            "rows": tuple(tuple(map(one_line, row)) for row in self.rows),
            "notes": tuple(map(one_line, self.notes)),
        }
        for name, value in plain.items():
            object.__setattr__(self, name, value)

    def without(self, names: Collection[str]) -> TextTable:
        """The table but for the columns of these names."""
        return self.with_columns(
            [place for place, column in enumerate(self.columns) if column.name not in names]
        )

    def with_columns(self, kept: Sequence[int]) -> TextTable:
        """The columns with these numbers, from 0."""
        return replace(
            self,
            columns=tuple(self.columns[place] for place in kept),
            rows=tuple(tuple(row[place] for place in kept) for row in self.rows),
        )


def number(value: float, digits: int = 1, *, signed: bool = False) -> str:
    """A number with `digits` decimals, `NO_VALUE` for NaN."""
    if math.isnan(value):
        return NO_VALUE
    # Adding 0.0 turns a rounded -0.0 into 0.0.
    rounded = round(float(value), digits) + 0.0
    return f"{rounded:{'+' if signed and rounded else ''}.{digits}f}"


def spread(mean: float, sd: float) -> str:
    """`47.1 ± 1.2`; the mean alone where there is no standard deviation."""
    return number(mean) if math.isnan(sd) else f"{number(mean)}{SPREAD}{number(sd)}"


def between(lo: float, hi: float, *, signed: bool = False) -> str:
    """`[44.0, 50.3]`; `NO_VALUE` where there is no interval."""
    if math.isnan(lo) or math.isnan(hi):
        return NO_VALUE
    return f"[{number(lo, signed=signed)}, {number(hi, signed=signed)}]"


def with_interval(row: Mapping[Hashable, Any], name: str = "") -> tuple[str, str]:
    """A value and its interval, out of the columns `value`, `lo` and `hi`, or of those of a name:
    `<name>`, `<name>_lo` and `<name>_hi`.
    """
    value, lo, hi = (name, f"{name}_lo", f"{name}_hi") if name else ("value", "lo", "hi")
    return number(row[value]), between(row[lo], row[hi])


def level_name(level: str) -> str:
    """`Level 3` or `Overall`."""
    return f"Level {level}" if level.isdigit() else level.capitalize()


def track_column(tracks: Sequence[str]) -> tuple[Column, ...]:
    """The column that says of which track a row is; none where there is one track alone."""
    return (Column("Track", is_text=True),) if len(tracks) > 1 else ()


def track_text(track: str, tracks: Sequence[str]) -> tuple[str, ...]:
    """What stands in the `track_column`."""
    return (track.replace("_", " "),) if len(tracks) > 1 else ()
