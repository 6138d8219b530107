"""Text tables as Markdown (GitHub's pipe tables)."""

from __future__ import annotations

from phyblock.tables.text_table import Column, TextTable

__all__ = ["to_markdown"]

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
