"""Tables as text, CSV, Markdown and LaTeX."""

from __future__ import annotations

import functools
import io
import itertools
import math
import re
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import jinja2

from phyblock.text import csv_cell, one_line

if TYPE_CHECKING:
    import pandas as pd


NO_VALUE = "–"  # noqa: RUF001
"""Content of a cell without a value, as opposed to zero."""
Row = Mapping[Hashable, Any]


@dataclass(frozen=True)
class Column:
    """A column; neighbors of one `group` share a heading. Numbers are aligned to the right.

    `show` returns its text for a row. Columns shown `once` are empty if all equal the row above.
    """

    name: str
    group: str = ""
    is_text: bool = False
    show: Callable[[Row], str] = lambda _: NO_VALUE
    once: bool = False

    @classmethod
    def text(cls, key: str, heading: str, *, once: bool = False) -> Self:
        """Return a column of text."""
        return cls(heading, "", True, lambda row: str(row[key]), once)

    @classmethod
    def track(cls, tracks: Sequence[str]) -> list[Self]:
        """Return the column with the track of a row, or none if there is only one track."""
        show = cls("Track", "", True, lambda row: str(row["track"]).replace("_", " "))
        return [show] if len(tracks) > 1 else []

    @classmethod
    def whole(cls, key: str, heading: str, group: str = "") -> Self:
        """Return a column of whole numbers."""
        return cls(heading, group, show=lambda row: f"{row[key]:,}")

    @classmethod
    def value(
        cls, key: str, heading: str, group: str = "", digits: int = 1, *, signed: bool = False
    ) -> Self:
        """Return a column of numbers with `digits` decimals."""
        return cls(heading, group, show=lambda row: number(row[key], digits, signed=signed))

    @classmethod
    def interval(
        cls, group: str = "", lo: str = "lo", hi: str = "hi", *, signed: bool = False
    ) -> Self:
        """Return a column of intervals between two columns of the frame."""
        return cls("95 % CI", group, show=lambda row: between(row[lo], row[hi], signed=signed))


@dataclass(frozen=True)
class TextTable:
    """Cells as text by row, with a caption and notes, each on one line; `frame` has the numbers.

    Cells hold names that models and people chose: newlines and control characters become spaces.
    """

    caption: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()
    frame: Any = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        columns = (replace(c, name=one_line(c.name), group=one_line(c.group)) for c in self.columns)
        object.__setattr__(self, "caption", one_line(self.caption))
        object.__setattr__(self, "columns", tuple(columns))
        object.__setattr__(self, "rows", tuple(tuple(map(one_line, row)) for row in self.rows))
        object.__setattr__(self, "notes", tuple(map(one_line, self.notes)))

    @classmethod
    def of(
        cls, frame: pd.DataFrame, caption: str, columns: Sequence[Column], notes: Iterable[str] = ()
    ) -> TextTable:
        """Return the table with a text for each row of the frame and column."""
        rows, above = [], None
        for row in frame.to_dict("records"):
            texts = [column.show(row) for column in columns]
            once = [text for text, column in zip(texts, columns, strict=True) if column.once]
            if once == above:
                texts = ["" if c.once else text for text, c in zip(texts, columns, strict=True)]
            above = once
            rows.append(tuple(texts))
        return cls(caption, tuple(columns), tuple(rows), tuple(notes), frame)

    def files(self, name: str) -> dict[str, str | bytes]:
        """Return the table as CSV, Markdown and LaTeX, by the names of the files."""
        return {
            f"{name}.csv": to_csv(self.frame, "%.6f"),
            f"{name}.md": to_markdown(self),
            f"{name}.tex": to_latex(self, f"phyblock-{Path(name).name}"),
        }

    def plain(self) -> dict[str, Any]:
        """Return the table as plain values for JSON."""
        columns = [[column.name, column.group, column.is_text] for column in self.columns]
        return {"caption": self.caption, "columns": columns, "rows": self.rows, "notes": self.notes}


def number(value: float, digits: int = 1, *, signed: bool = False) -> str:
    """Return a number with `digits` decimals, `NO_VALUE` for NaN."""
    if math.isnan(value):
        return NO_VALUE
    # Adding 0.0 turns a rounded -0.0 into 0.0.
    rounded = round(float(value), digits) + 0.0
    return f"{rounded:{'+' if signed and rounded else ''}.{digits}f}"


def between(lo: float, hi: float, *, signed: bool = False) -> str:
    """Return `[44.0, 50.3]`, or `NO_VALUE` without an interval."""
    if math.isnan(lo) or math.isnan(hi):
        return NO_VALUE
    return f"[{number(lo, signed=signed)}, {number(hi, signed=signed)}]"


def captioned(caption: str, words: Sequence[str]) -> str:
    """Return the caption with the words at its end, in brackets."""
    return f"{caption} [{', '.join(words)}]" if words else caption


def level_name(level: str) -> str:
    """Return `Level 3` or `Overall`."""
    return f"Level {level}" if level.isdigit() else level.replace("_", " ").capitalize()


def to_csv(frame: pd.DataFrame, float_format: str | None = None) -> str:
    """Return a frame as CSV without its index; formulas are escaped (see `csv_cell`)."""
    import pandas as pd

    safe = frame.rename(columns=csv_cell)
    for name, kind in safe.dtypes.items():
        if not pd.api.types.is_numeric_dtype(kind):
            cells = [csv_cell(value) for value in safe[name]]
            safe[name] = pd.Series(cells, index=safe.index, dtype=object)
    rows = CsvRows()
    safe.to_csv(rows, index=False, float_format=float_format, lineterminator="\r\n")
    return rows.getvalue()


class CsvRows(io.StringIO):
    """Rows of CSV, each of which arrives with CR LF and is kept with LF.

    Before Python 3.13, only CR LF as the end of rows puts cells with a carriage return in quotes.
    """

    def write(self, row: str) -> int:
        """Append a row."""
        return super().write(row.removesuffix("\r\n") + "\n")


_ESCAPES_LATEX = str.maketrans(
    {c: f"\\{c}" for c in "&%$#_{}"}
    | {c: f"{{{c}}}" for c in "[]*"}
    | {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}
    | {"<": r"\textless{}", ">": r"\textgreater{}", "|": r"\textbar{}", NO_VALUE: r"\textendash{}"}
    | {"`": r"\textasciigrave{}", '"': r"\char34{}", "“": "``", "”": "''", "\n": " "}
    | {"±": r"$\pm$", "×": r"$\times$"}  # noqa: RUF001
)
_LIGATURE = re.compile("-(?=-)")


def escape(text: str) -> str:
    """Return text as LaTeX prints it literally."""
    return _LIGATURE.sub("-{}", text.translate(_ESCAPES_LATEX))


_ESCAPES = str.maketrans({c: f"\\{c}" for c in "\\`*_[]<>|#~$"} | {"&": "&amp;", "\n": " "})


def to_markdown(table: TextTable) -> str:
    """Return the caption in bold, the table, and the notes as a list.

    Group headings join the column names, because Markdown has one heading row.
    """
    head = (f"{column.group} {column.name}".strip() for column in table.columns)
    rule = ["---" if column.is_text else "--:" for column in table.columns]
    rows = [[text.translate(_ESCAPES) for text in row] for row in (tuple(head), *table.rows)]
    lines = "\n".join(f"| {' | '.join(row)} |" for row in (rows[0], rule, *rows[1:]))
    notes = "\n".join(f"- {note.translate(_ESCAPES)}" for note in table.notes)
    parts = (f"**{table.caption.translate(_ESCAPES)}**", lines, notes)
    return "\n\n".join(filter(None, parts)) + "\n"


@functools.cache
def latex_template() -> jinja2.Template:
    """Return the template of tables, whose marks and filter are for LaTeX."""
    marks = {"block_start_string": "<%", "block_end_string": "%>"}
    marks |= {"variable_start_string": "<<", "variable_end_string": ">>"}
    environment = jinja2.Environment(**marks, trim_blocks=True, keep_trailing_newline=True)  # type: ignore[arg-type]
    environment.filters["tex"] = escape
    text = Path(__file__).with_name("table.tex.j2").read_text(encoding="utf-8")
    return environment.from_string(text)


def to_latex(table: TextTable, label: str) -> str:
    """Return a `table*` float, scaled down only if it is too large; `label` follows `tab:`."""
    groups, first = [], 1
    for name, members in itertools.groupby(table.columns, key=lambda column: column.group):
        size = len(list(members))
        groups.append({"name": name, "size": size, "first": first})
        first += size
    return latex_template().render(table=table, label=label, groups=groups)


TABLES = "tables"
"""The folder of tables in the folder of a run."""
REPORT_FILE = "report.html"
