"""Tables of a reply, read by their columns."""

# ruff: noqa: RUF001, RUF002 -- replies come in other scripts

from __future__ import annotations

import re
from collections import Counter

from phyblock.parsing.json_keys import TIMES_KEY
from phyblock.parsing.mention import MOST_AT_ONCE
from phyblock.parsing.structured import Found, line_numbers
from phyblock.parsing.text_forms import number_of_word, plain_line
from phyblock.parsing.tiers import lowest_first

__all__ = ["find_tables", "markdown_tables"]

_TABLE = re.compile(
    r"^[ \t]*\|?[^|\n]*\|[^\n]*\n[ \t]*\|?[ \t:|-]*-[ \t:|-]*\n(?:[^\n]*\|[^\n]*(?:\n|\Z))+",
    re.MULTILINE,
)
_STEP_COLUMN = re.compile(
    r"step|order|seq|^#$|^no\.?$|^nr\.?$|schritt|reihenfolge|paso|étape|步骤|顺序|序号|手順",
    re.IGNORECASE,
)
_LAYER_COLUMN = re.compile(r"layer|level|tier|ebene|schicht|couche|nivel|层", re.IGNORECASE)
_BLOCK_COLUMN = re.compile(
    r"block|ind(?:ex|ice)|idx|[ck]andidat|piece|move|action|^id$|baustein|bloc|bloque|aktion|积木"
    r"|编号|块|ブロック",
    re.IGNORECASE,
)
_COUNT_COLUMN = re.compile(
    r"(?:number|no\.?|n|count|how many|anzahl)\b.{0,9}\b\w+s\b", re.IGNORECASE
)
"""A column that says how many blocks there are, not which."""
_TIMES_COLUMN = re.compile(
    rf"(?:{TIMES_KEY.pattern}|how (?:many|often)|(?:number|no\.?) of (?:copies|pieces|times|blocks)"
    r"|amount|pieces|×|wie (?:viele|oft)|stück(?:zahl)?|menge|combien|cu[aá]nt[ao]s|個数|个数)"
    r"(?: (?:needed|required|used|times|of (?:each|them)))?",
    re.IGNORECASE,
)
"""A column that says how many of the block of its row."""
_SAYS_TIMES = re.compile(r"[x×]?\s?(?P<n>\d{1,2})(?:\s?[x×]|\s[^\W\d]{1,12})?(?:\s?\([^()]*\))?")
_ONCE_OR_TWICE = {"once": 1, "twice": 2}
_NTH = re.compile(r"(?:step|schritt|paso|étape|步骤)\s{0,2}(?P<n>\d{1,2})", re.IGNORECASE)
_TABLE_CHARS = 20_000
_HTML = re.compile(r"<table\b(?:(?!<table).){1,20000}?</table>", re.IGNORECASE | re.DOTALL)
_HTML_ROW = re.compile(r"<tr\b[^>\n]{0,200}>(?P<cells>.{0,4000}?)(?:</tr>|(?=<tr)|\Z)", re.I | re.S)
_HTML_CELL = re.compile(r"<t[hd]\b[^>\n]{0,200}>(?P<cell>.{0,400}?)(?=</?t[hdr]\b|\Z)", re.I | re.S)
_FRAME = re.compile(r"^[ \t]*\+[-=+]{2,200}\+[ \t]*\n?", re.MULTILINE)
_DELIMITED = re.compile(
    r"^(?P<head>[^\n|:{}\[\]]{1,200})\n(?P<rows>(?:[^\n|{}\[\]]{1,200}(?:\n|\Z)){1,100})",
    re.MULTILINE,
)
_PIPED = re.compile(r"(?:^[^\n|]{0,200}\|[^\n]{1,200}(?:\n|\Z)){2,100}", re.MULTILINE)


def markdown_tables(text: str) -> str:
    """A text whose tables (HTML, framed by +---+, with commas or tabs) are all Markdown."""
    if "<t" in text.lower():
        text = _HTML.sub(_of_html, text)
    if "+-" in text or "+=" in text:
        text = _FRAME.sub("", text) if len(_FRAME.findall(text)) > 1 else text
    text = _PIPED.sub(_of_piped, text) if "|" in text else text
    return _DELIMITED.sub(_of_delimited, text)


def find_tables(text: str) -> list[Found]:
    """The tables of a text; one without a column of steps is a catalogue."""
    found = []
    for table in _TABLE.finditer(text) if "|" in text else ():
        rows = [_cells(line) for line in table[0][:_TABLE_CHARS].strip().splitlines()]
        numbers = _of_rows(rows[0], rows[2:]) or _of_columns([rows[0], *rows[2:]])
        found.append(Found(table.start(), table.end(), "table", tuple(numbers)))
    return found


def _cells(line: str) -> list[str]:
    return [plain_line(cell).strip() for cell in line.strip().strip("|").split("|")]


def _markdown(rows: list[list[str]]) -> str:
    lines = ["| " + " | ".join(cell.strip() for cell in row) + " |" for row in rows]
    return "\n".join([lines[0], "|" + "---|" * len(rows[0]), *lines[1:]]) + "\n"


def _of_html(table: re.Match[str]) -> str:
    rows = [
        [
            re.sub(r"<[^<>]{0,80}>|\s+", " ", cell["cell"])
            for cell in _HTML_CELL.finditer(row["cells"])
        ]
        for row in _HTML_ROW.finditer(table[0])
    ]
    rows = [row for row in rows if row]
    return f"\n{_markdown(rows)}" if rows else table[0]


def _of_piped(table: re.Match[str]) -> str:
    """Rows with bars and no line below the head, where the head or the first column says steps."""
    lines = table[0].strip("\n").splitlines()
    rows = [_cells(line) for line in lines]
    has_rule = any(not line.strip(" \t|:-") for line in lines)
    named = [name for name in (*rows[0], *(row[0] for row in rows)) if _STEP_COLUMN.search(name)]
    same = len({len(row) for row in rows}) == 1
    return (
        table[0] if has_rule or not (named and same) or _NTH.search(named[0]) else _markdown(rows)
    )


def _of_delimited(table: re.Match[str]) -> str:
    """Lines with commas, semicolons or tabs under a head that names steps and blocks."""
    for sign in (",", ";", "\t"):
        head = table["head"].split(sign)
        is_head = (
            len(head) > 1
            and not re.search(r"\d", table["head"])
            and any(_STEP_COLUMN.search(name.strip()) for name in head)
            and any(_BLOCK_COLUMN.search(name.strip()) for name in head)
        )
        lines = table["rows"].splitlines()
        rows = [line.split(sign) for line in lines if line.strip()]
        n_rows = next((i for i, row in enumerate(rows) if len(row) != len(head)), len(rows))
        if is_head and n_rows and all(row[0].strip(" \"'").isdigit() for row in rows[:n_rows]):
            return _markdown([head, *rows[:n_rows]]) + "\n".join(lines[n_rows:]) + "\n"
    return table[0]


def _of_columns(rows: list[list[str]]) -> list[int]:
    """A table whose rows are steps and blocks, a column a step."""
    if len({len(row) for row in rows}) > 1:
        return []
    turned = [list(row) for row in zip(*rows, strict=True)]
    if all(_NTH.search(row[0]) for row in turned):
        return _of_rows(["step", "block"], turned) if len(rows) == 2 else []
    return _of_rows(turned[0], turned[1:])


def _of_rows(head: list[str], rows: list[list[str]]) -> list[int]:
    steps = next((i for i, name in enumerate(head) if _STEP_COLUMN.search(name)), None)
    times = next((i for i, name in enumerate(head) if _TIMES_COLUMN.fullmatch(name)), None)
    is_layers = steps is None
    if steps is None:
        steps = next((i for i, name in enumerate(head) if _LAYER_COLUMN.search(name)), None)
    if steps is None:
        return []
    columns = [
        i
        for i, name in enumerate(head)
        if i != steps and _BLOCK_COLUMN.search(name) and not _COUNT_COLUMN.match(name)
    ]
    columns.sort(key=lambda i: not re.search("ind|no|id|编号", head[i], re.IGNORECASE))
    rows = [row for row in rows if len(row) == len(head)]
    places = [_places(row[steps]) for row in rows]
    is_counted_out = any(len(of_row) > 1 for of_row in places)
    if is_counted_out:
        rows = [row for row, of_row in zip(rows, places, strict=True) for _ in of_row]
        places = [[place] for of_row in places for place in of_row]
    order = [of_row[0] for of_row in places if of_row]
    if len({*order}) == len(rows):
        rows = [row for _, row in sorted(zip(order, rows, strict=True), key=lambda pair: pair[0])]
    elif is_layers and (rising := lowest_first([row[steps] for row in rows])):
        rows = [rows[i] for i in rising]
    for column in columns:
        named = [list(line_numbers(row[column])) for row in rows]
        if is_layers and max(map(len, named), default=0) < 2:  # It may say how many.
            continue
        if rows and all(named):
            counts = times is not None and not is_counted_out
            many = [_times(row[times or 0]) if counts else 1 for row in rows]
            if _are_totals(named, many):
                return []
            return [
                n
                for numbers, k in zip(named, many, strict=True)
                for n in numbers * (1 if k == len(numbers) else min(k, MOST_AT_ONCE))
            ]
    return []


def _times(cell: str) -> int:
    """How many a cell says, as "2", "×2", "two" or "twice"; one where it says nothing of it."""
    digits = _SAYS_TIMES.fullmatch(cell)
    said = _ONCE_OR_TWICE.get(cell.lower()) or number_of_word(cell)
    return int(digits["n"]) if digits else said or 1


def _are_totals(named: list[list[int]], many: list[int]) -> bool:
    """Whether counts beside blocks may be those of the whole plan, or of the plan so far."""
    rows_of = Counter(numbers[0] for numbers in named if len(numbers) == 1)
    is_so_far = len(many) > 2 and many == [*range(1, len(many) + 1)]
    return is_so_far or any(
        1 < k == rows_of[numbers[0]] for numbers, k in zip(named, many, strict=True)
    )


def _places(cell: str) -> list[int]:
    """The steps that a cell says, as "3", "1st" or "1, 2"; none where it says none."""
    return [int(digits) for digits in re.findall(r"\d{1,3}", cell)[:MOST_AT_ONCE]]
