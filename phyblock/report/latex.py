r"""Text tables as LaTeX with booktabs rules.

Pandas' own writer knows neither rules under column groups nor notes under a table.
"""

from __future__ import annotations

import itertools
import re

from phyblock.report.text_table import NO_VALUE, Column, TextTable

__all__ = ["escape", "to_latex"]

_ESCAPES = str.maketrans(
    {c: f"\\{c}" for c in "&%$#_{}"}
    | {
        "\\": r"\textbackslash{}",
        "~": r"\textasciitilde{}",
        "^": r"\textasciicircum{}",
        "<": r"\textless{}",
        ">": r"\textgreater{}",
        "|": r"\textbar{}",
        '"': r"\textquotedbl{}",
        "±": r"$\pm$",
        "×": r"$\times$",  # noqa: RUF001
        NO_VALUE: "--",
        "\n": " ",
    }
)
_SPREAD = re.compile(r"(\S+) ± (\S+)")
_HEAD = "% Needs \\usepackage{booktabs} and \\usepackage{graphicx}.\n"


def to_latex(table: TextTable, label: str) -> str:
    r"""A `table*` float that compiles by `\input`, made narrower only where it is too wide.

    `label` follows `tab:`. Needs booktabs and graphicx, and says so in its first line.
    """
    alignment = "".join("l" if column.is_text else "r" for column in table.columns)
    body = "\n".join(
        [
            rf"\begin{{tabular}}{{@{{}}{alignment}@{{}}}}",
            r"\toprule",
            *_headings(table.columns),
            r"\midrule",
            *(_row(row) for row in _aligned(table)),
            r"\bottomrule",
            r"\end{tabular}",
        ]
    )
    notes = "".join(rf"\par {escape(note)}" + "\n" for note in table.notes)
    return (
        _HEAD
        + "\\begin{table*}[t]\n\\centering\\small\n\\setlength{\\tabcolsep}{4pt}\n"
        + f"\\caption{{{escape(table.caption)}}}\n\\label{{tab:{label}}}\n"
        + "\\resizebox{\\ifdim\\width>\\linewidth\\linewidth\\else\\width\\fi}{!}{%\n"
        + f"{body}}}\n"
        + (f"\\par\\smallskip\\raggedright\\footnotesize\n{notes}" if notes else "")
        + "\\end{table*}\n"
    )


def escape(text: str) -> str:
    """Text as LaTeX prints it literally."""
    return text.translate(_ESCAPES)


def _row(cells: tuple[str, ...]) -> str:
    return " & ".join(cells) + r" \\"


def _headings(columns: tuple[Column, ...]) -> list[str]:
    names = _row(tuple(_heading(column) for column in columns))
    if not any(column.group for column in columns):
        return [names]
    groups, rules, start = [], [], 1
    for group, members in itertools.groupby(columns, key=lambda column: column.group):
        width = len(list(members))
        if group:
            groups.append(rf"\multicolumn{{{width}}}{{c}}{{{escape(group)}}}")
            rules.append(rf"\cmidrule(lr){{{start}-{start + width - 1}}}")
        else:
            groups += [""] * width
        start += width
    return [_row(tuple(groups)), "".join(rules), names]


def _heading(column: Column) -> str:
    name = escape(column.name)
    return name if column.is_text else rf"\multicolumn{{1}}{{c}}{{{name}}}"


def _aligned(table: TextTable) -> list[tuple[str, ...]]:
    """Escaped cells; standard deviations of one column are padded to the same width."""
    columns = [_spreads(cells) for cells in zip(*table.rows, strict=True)]
    return list(zip(*columns, strict=True))


def _spreads(cells: tuple[str, ...]) -> list[str]:
    matches = [_SPREAD.fullmatch(cell) for cell in cells]
    widest = max((len(match[2]) for match in matches if match), default=0)
    return [
        rf"${match[1]}_{{\pm {_pad(match[2], widest)}}}$" if match else escape(cell)
        for cell, match in zip(cells, matches, strict=True)
    ]


def _pad(text: str, width: int) -> str:
    missing = width - len(text)
    return rf"\phantom{{{'0' * missing}}}{text}" if missing else text
