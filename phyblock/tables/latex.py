r"""Text tables as LaTeX with booktabs rules.

Pandas' own writer knows neither rules under column groups nor notes under a table.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable

from phyblock.tables.text_table import NO_VALUE, SPREAD, Column, TextTable

__all__ = ["escape", "to_latex"]

_ESCAPES = str.maketrans(
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
    return _LIGATURE.sub("-{}", text.translate(_ESCAPES))


def _headings(columns: tuple[Column, ...]) -> list[str]:
    names = _line(_heading(column) for column in columns)
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
    return [_line(groups), "".join(rules), names]


def _stacked(group: str) -> str:
    """A heading of several words on two lines, so that it does not spread its columns."""
    words = group.split(" ")
    halves = [(" ".join(words[:n]), " ".join(words[n:])) for n in range(1, len(words))]
    if not halves:
        return escape(group)
    upper, lower = min(halves, key=lambda half: max(map(len, half)))
    return rf"\shortstack{{{escape(upper)}\\{escape(lower)}}}"


def _heading(column: Column) -> str:
    name = escape(column.name)
    return name if column.is_text else rf"\multicolumn{{1}}{{c}}{{{name}}}"


def _row(cells: tuple[str, ...], columns: tuple[Column, ...]) -> str:
    """A row; standard deviations stand under their means, which keeps wide tables legible."""
    pairs = [
        (cell, "") if column.is_text else cell.partition(SPREAD)[::2]
        for cell, column in zip(cells, columns, strict=True)
    ]
    upper = _line(escape(mean) for mean, _ in pairs)
    if not any(sd for _, sd in pairs):
        return upper
    lower = _line(rf"{{\scriptsize$\pm${escape(sd)}}}" if sd else "" for _, sd in pairs)
    return f"{upper}[-2pt]\n{lower}"


def _line(cells: Iterable[str]) -> str:
    return " & ".join(cells) + r" \\"
