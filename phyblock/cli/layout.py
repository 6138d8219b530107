"""Lays a table out as lines of text; one that is too wide is broken into several, cell by cell
whole.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate, groupby
from textwrap import wrap

from rich.cells import cell_len

from phyblock.report import TextTable

__all__ = ["lay_out", "width_of"]

_HEADING_WIDTH = 12
"""Characters after which a heading above narrower cells goes on in a new line."""
_GAP = 2
"""Spaces between columns."""


@dataclass(frozen=True)
class _Part:
    """Neighboring columns under one heading, with the width of each."""

    group: tuple[str, ...]
    columns: tuple[int, ...]
    widths: tuple[int, ...]

    @property
    def width(self) -> int:
        """Characters of the part, without the gap before it."""
        return sum(self.widths) + _GAP * (len(self.widths) - 1)


def lay_out(view: TextTable, width: int) -> list[list[str]]:
    """The lines of a table, its headings first, in as many pieces as `width` characters need.

    Every piece begins with the names of the rows. No cell is ever cut: a piece is wider than
    `width` where the names and one column are. Headings of a group are not torn from its columns
    unless they alone are too wide.
    """
    names = _n_names(view)
    firsts = _parts(view, range(names))
    taken = 1 + sum(part.width + _GAP for part in firsts)
    rest = _parts(view, range(names, len(view.columns)))
    fitting = [piece for part in rest for piece in _broken(view, part, width - taken)]
    pieces: list[list[_Part]] = []
    used = 0
    for part in fitting:
        if pieces and used + _GAP + part.width <= width:
            pieces[-1].append(part)
            used += _GAP + part.width
        else:
            pieces.append([*firsts, part])
            used = taken + part.width
    return [_lines(view, piece) for piece in pieces or [firsts]]


def width_of(view: TextTable) -> int:
    """Characters that a table takes in one piece."""
    return 1 + sum(part.width + _GAP for part in _parts(view, range(len(view.columns)))) - _GAP


def _n_names(view: TextTable) -> int:
    """How many columns at the left name the rows."""
    texts = 0
    while texts < len(view.columns) and view.columns[texts].is_text:
        texts += 1
    return max(1, texts)


def _parts(view: TextTable, columns: Sequence[int]) -> list[_Part]:
    """The columns by their groups; one without a group stands alone."""
    runs = groupby(columns, key=lambda i: view.columns[i].group or i)
    return [_part(view, tuple(members)) for _, members in runs]


def _part(view: TextTable, columns: tuple[int, ...]) -> _Part:
    widths = [max(_cells_width(view, i), *map(cell_len, _name(view, i))) for i in columns]
    span = sum(widths) + _GAP * (len(widths) - 1)
    group = wrap(view.columns[columns[0]].group, max(span, _HEADING_WIDTH), break_long_words=False)
    # What a heading needs beyond its columns is given to the first of them.
    widths[0] += max(0, max(map(cell_len, group), default=0) - span)
    return _Part(tuple(group), columns, tuple(widths))


def _cells_width(view: TextTable, column: int) -> int:
    return max((cell_len(row[column]) for row in view.rows), default=0)


def _name(view: TextTable, column: int) -> list[str]:
    """The lines of a column's name, which is broken by words where its cells are narrower."""
    width = max(_HEADING_WIDTH, _cells_width(view, column))
    return wrap(view.columns[column].name, width, break_long_words=False) or [""]


def _broken(view: TextTable, part: _Part, width: int) -> Iterator[_Part]:
    """The part, or as few pieces of it as are at most `width` wide, all under its heading."""
    start = 0
    while start < len(part.columns):
        sums = list(accumulate(w + _GAP for w in part.widths[start:]))
        fit = max(1, sum(1 for total in sums if total - _GAP <= width))
        yield _part(view, part.columns[start : start + fit])
        start += fit


def _lines(view: TextTable, parts: Sequence[_Part]) -> list[str]:
    """Headings, a rule, and the rows of a piece."""
    blocks = [_heading(view, part) for part in parts]
    height = max(len(block) for block in blocks)
    padded = [
        [" " * part.width] * (height - len(block)) + block
        for part, block in zip(parts, blocks, strict=True)
    ]
    gap = " " * _GAP
    lines = [" " + gap.join(line) for line in zip(*padded, strict=True)]
    total = sum(part.width + _GAP for part in parts) - _GAP
    lines.append(" " + "─" * total)
    for row in view.rows:
        cells = (
            _aligned(view, i, row[i], width)
            for part in parts
            for i, width in zip(part.columns, part.widths, strict=True)
        )
        lines.append(" " + gap.join(cells))
    return [line.rstrip() for line in lines]


def _heading(view: TextTable, part: _Part) -> list[str]:
    """The lines above a part: its group's name over the span, then the names of its columns."""
    wrapped = [_name(view, i) for i in part.columns]
    height = max(map(len, wrapped))
    rows = [
        (" " * _GAP).join(
            _aligned(view, i, ([""] * (height - len(name)) + name)[at], width)
            for i, width, name in zip(part.columns, part.widths, wrapped, strict=True)
        )
        for at in range(height)
    ]
    alone = len(part.columns) == 1
    above = [
        _aligned(view, part.columns[0], line, part.width) if alone else _centered(line, part.width)
        for line in part.group
    ]
    return [*above, *rows]


def _aligned(view: TextTable, column: int, text: str, width: int) -> str:
    space = " " * (width - cell_len(text))
    return text + space if view.columns[column].is_text else space + text


def _centered(text: str, width: int) -> str:
    space = width - cell_len(text)
    return " " * (space - space // 2) + text + " " * (space // 2)
