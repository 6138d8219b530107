"""Tables of a reply, read by their columns."""

from __future__ import annotations

import re

from phyblock.parsing.mention import MOST_AT_ONCE
from phyblock.parsing.structured import TIMES_KEY, Found, line_numbers, whole_number
from phyblock.parsing.text_forms import plain_line

__all__ = ["find_tables"]

_TABLE = re.compile(
    r"^[ \t]*\|?[^|\n]*\|[^\n]*\n[ \t]*\|?[ \t:|-]*-[ \t:|-]*\n(?:[^\n]*\|[^\n]*(?:\n|\Z))+",
    re.MULTILINE,
)
_STEP_COLUMN = re.compile(
    r"step|order|seq|^#$|^no\.?$|^nr\.?$|schritt|reihenfolge|paso|étape|步骤|顺序|序号|手順",
    re.IGNORECASE,
)
_LAYER_COLUMN = re.compile(r"layer|level|ebene|schicht|couche|nivel|层", re.IGNORECASE)
_BLOCK_COLUMN = re.compile(
    r"block|ind(?:ex|ice)|idx|candidate|piece|move|action|^id$|baustein|bloc|bloque|aktion|积木|编号|块"
    r"|ブロック",
    re.IGNORECASE,
)
_TABLE_CHARS = 20_000


def find_tables(text: str) -> list[Found]:
    """The tables of a text; one without a column of steps is a catalogue."""
    found = []
    for table in _TABLE.finditer(text) if "|" in text else ():
        rows = [_cells(line) for line in table[0][:_TABLE_CHARS].strip().splitlines()]
        found.append(Found(table.start(), table.end(), "table", tuple(_of_rows(rows[0], rows[2:]))))
    return found


def _cells(line: str) -> list[str]:
    return [plain_line(cell).strip() for cell in line.strip().strip("|").split("|")]


def _of_rows(head: list[str], rows: list[list[str]]) -> list[int]:
    steps = next((i for i, name in enumerate(head) if _STEP_COLUMN.search(name)), None)
    times = next((i for i, name in enumerate(head) if TIMES_KEY.fullmatch(name)), None)
    is_layers = steps is None
    if steps is None:
        steps = next((i for i, name in enumerate(head) if _LAYER_COLUMN.search(name)), None)
    if steps is None:
        return []
    columns = [i for i, name in enumerate(head) if i != steps and _BLOCK_COLUMN.search(name)]
    columns.sort(key=lambda i: not re.search("ind|no|id|编号", head[i], re.IGNORECASE))
    rows = [row for row in rows if len(row) == len(head)]
    order = [whole_number(re.sub(r"\D", "", row[steps])) for row in rows]
    if None not in order and len(set(order)) == len(order):
        rows = [
            row for _, row in sorted(zip(order, rows, strict=True), key=lambda pair: pair[0] or 0)
        ]
    for column in columns:
        named = [list(line_numbers(row[column])) for row in rows]
        if is_layers and max(map(len, named), default=0) < 2:  # It may say how many.
            continue
        if rows and all(named):
            many = [(whole_number(row[times]) if times is not None else None) or 1 for row in rows]
            return [
                n
                for numbers, k in zip(named, many, strict=True)
                for n in numbers * min(k, MOST_AT_ONCE)
            ]
    return []
