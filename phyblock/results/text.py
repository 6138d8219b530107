"""Tables as text: cells as they are shown, and the same as CSV, Markdown and LaTeX."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Collection, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from phyblock.text import csv_cell, one_line

if TYPE_CHECKING:
    import pandas as pd

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


def captioned(caption: str, words: Sequence[str]) -> str:
    """Return the caption with the words at its end, in brackets."""
    return f"{caption} [{', '.join(words)}]" if words else caption


def level_name(level: str) -> str:
    """`Level 3` or `Overall`."""
    return f"Level {level}" if level.isdigit() else level.capitalize()


def track_column(tracks: Sequence[str]) -> tuple[Column, ...]:
    """The column that says of which track a row is; none where there is one track alone."""
    return (Column("Track", is_text=True),) if len(tracks) > 1 else ()


def track_text(track: str, tracks: Sequence[str]) -> tuple[str, ...]:
    """Return the cells of a row in the `track_column`."""
    return (track.replace("_", " "),) if len(tracks) > 1 else ()


def to_csv(frame: pd.DataFrame, float_format: str | None = None) -> str:
    """A frame as CSV, without its index; no text in it is taken for a formula (see `csv_cell`)."""
    import pandas as pd

    safe = frame.rename(columns=csv_cell)
    for name, kind in safe.dtypes.items():
        if not pd.api.types.is_numeric_dtype(kind):
            cells = [csv_cell(value) for value in safe[name]]
            safe[name] = pd.Series(cells, index=safe.index, dtype=object)
    text: str = safe.to_csv(index=False, float_format=float_format, lineterminator="\n")
    return text


_ESCAPES = str.maketrans({c: f"\\{c}" for c in "\\`*_[]<>|#~$"} | {"&": "&amp;", "\n": " "})


def to_markdown(table: TextTable) -> str:
    """The caption in bold, the table with its columns padded to align, the notes as a list.

    Group headings join the column names, because Markdown has one heading row.
    """
    head = tuple(_heading(column) for column in table.columns)
    grid = [tuple(_escape(cell) for cell in row) for row in (head, *table.rows)]
    widths = [max(3, *(len(row[place]) for row in grid)) for place in range(len(head))]
    rule = "|".join(
        f" {'-' * width} " if column.is_text else f" {'-' * (width - 1)}: "
        for column, width in zip(table.columns, widths, strict=True)
    )
    lines = [_line(row, table.columns, widths) for row in grid]
    lines.insert(1, f"|{rule}|")
    notes = [f"- {_escape(note)}" for note in table.notes]
    parts = [f"**{_escape(table.caption)}**", "\n".join(lines), "\n".join(notes)]
    return "\n\n".join(part for part in parts if part) + "\n"


def _heading(column: Column) -> str:
    return f"{column.group} {column.name}".strip()


def _line(row: tuple[str, ...], columns: tuple[Column, ...], widths: list[int]) -> str:
    cells = (
        cell.ljust(width) if column.is_text else cell.rjust(width)
        for cell, column, width in zip(row, columns, widths, strict=True)
    )
    return f"| {' | '.join(cells)} |"


def _escape(text: str) -> str:
    return text.translate(_ESCAPES)


_ESCAPES_LATEX = str.maketrans(
    {c: f"\\{c}" for c in "&%$#_{}"}
    | {c: f"{{{c}}}" for c in "[]*"}
    | {
        "\\": r"\textbackslash{}",
        "~": r"\textasciitilde{}",
        "^": r"\textasciicircum{}",
        "<": r"\textless{}",
        ">": r"\textgreater{}",
        "|": r"\textbar{}",
        '"': r"\char34{}",
        "`": r"\textasciigrave{}",
        "“": "``",
        "”": "''",
        "±": r"$\pm$",
        "×": r"$\times$",  # noqa: RUF001
        NO_VALUE: r"\textendash{}",
        "\n": " ",
    }
)
_LIGATURE = re.compile("-(?=-)")
_PAGE_LINES = 40
_HEAD = "% Needs \\usepackage{booktabs} and \\usepackage{graphicx}.\n"


def to_latex(table: TextTable, label: str) -> str:
    r"""`table*` floats that compile by `\input`, made narrower only where they are too wide.

    A table too long for a page goes on in further floats of the same number. `label` follows
    `tab:`. Needs booktabs and graphicx, and says so in its first line.
    """
    rows = [_row(row, table.columns) for row in table.rows]
    notes = "".join(rf"\par {escape(note)}" + "\n" for note in table.notes)
    pages = _pages(table.rows, rows) or [range(0)]
    floats = []
    for place, page in enumerate(pages):
        caption = escape(table.caption) + (" (continued)" if place else "")
        last = place == len(pages) - 1
        floats.append(
            "\\begin{table*}[t]\n\\centering\\small\n\\setlength{\\tabcolsep}{4pt}\n"
            + ("\\addtocounter{table}{-1}\n" if place else "")
            + f"\\caption{{{caption}}}\n"
            + ("" if place else f"\\label{{tab:{label}}}\n")
            + "\\resizebox{\\ifdim\\width>\\linewidth\\linewidth\\else\\width\\fi}{!}{%\n"
            + _tabular(
                table.columns, _spaced([rows[n] for n in page], [table.rows[n] for n in page])
            )
            + "}\n"
            + (f"\\par\\smallskip\\raggedright\\footnotesize\n{notes}" if last and notes else "")
            + "\\end{table*}\n"
        )
    return _HEAD + "\n".join(floats)


def _tabular(columns: tuple[Column, ...], rows: list[str]) -> str:
    alignment = "".join("l" if column.is_text else "r" for column in columns)
    return "\n".join(
        [
            rf"\begin{{tabular}}{{@{{}}{alignment}@{{}}}}",
            r"\toprule",
            *_headings(columns),
            r"\midrule",
            *rows,
            r"\bottomrule",
            r"\end{tabular}",
        ]
    )


def _pages(cells: tuple[tuple[str, ...], ...], rows: list[str]) -> list[range]:
    """Stretches of rows that fit a page and begin where the first column says something."""
    starts = [n for n, row in enumerate(cells) if row[0]] or [0] * bool(rows)
    pages: list[range] = []
    for start, end in itertools.pairwise([*starts, len(rows)]):
        first = pages[-1].start if pages else 0
        if pages and "\n".join(rows[first:end]).count("\n") < _PAGE_LINES:
            pages[-1] = range(first, end)
        else:
            pages.append(range(start, end))
    return pages


def _spaced(lines: list[str], rows: list[tuple[str, ...]]) -> list[str]:
    """Lines with space between blocks, where a block takes more than one line."""
    blocks = any("\n" in line or not row[0] for line, row in zip(lines, rows, strict=True))
    return [
        ("\\addlinespace\n" if blocks and place and rows[place][0] else "") + line
        for place, line in enumerate(lines)
    ]


def escape(text: str) -> str:
    """Text as LaTeX prints it literally."""
    return _LIGATURE.sub("-{}", text.translate(_ESCAPES_LATEX))


def _headings(columns: tuple[Column, ...]) -> list[str]:
    names = _line_latex(_heading_latex(column) for column in columns)
    if not any(column.group for column in columns):
        return [names]
    groups, rules, start = [], [], 1
    for group, members in itertools.groupby(columns, key=lambda column: column.group):
        width = len(list(members))
        if group:
            groups.append(rf"\multicolumn{{{width}}}{{c}}{{{_stacked(group)}}}")
            rules.append(rf"\cmidrule(lr){{{start}-{start + width - 1}}}")
        else:
            groups += [""] * width
        start += width
    return [_line_latex(groups), "".join(rules), names]


def _stacked(group: str) -> str:
    """A heading of several words on two lines, so that it does not spread its columns."""
    words = group.split(" ")
    halves = [(" ".join(words[:n]), " ".join(words[n:])) for n in range(1, len(words))]
    if not halves:
        return escape(group)
    upper, lower = min(halves, key=lambda half: max(map(len, half)))
    return rf"\shortstack{{{escape(upper)}\\{escape(lower)}}}"


def _heading_latex(column: Column) -> str:
    name = escape(column.name)
    return name if column.is_text else rf"\multicolumn{{1}}{{c}}{{{name}}}"


def _row(cells: tuple[str, ...], columns: tuple[Column, ...]) -> str:
    """A row; standard deviations stand under their means, which keeps wide tables legible."""
    pairs = [
        (cell, "") if column.is_text else cell.partition(SPREAD)[::2]
        for cell, column in zip(cells, columns, strict=True)
    ]
    upper = _line_latex(escape(mean) for mean, _ in pairs)
    if not any(sd for _, sd in pairs):
        return upper
    lower = _line_latex(rf"{{\scriptsize$\pm${escape(sd)}}}" if sd else "" for _, sd in pairs)
    return f"{upper}[-2pt]\n{lower}"


def _line_latex(cells: Iterable[str]) -> str:
    return " & ".join(cells) + r" \\"
