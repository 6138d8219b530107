"""The lists of a reply: steps, numbered or marked items, sentences, labels, JSON, tables.

A list knows what stands above it, so that it can be told what it is to the one before it.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from dataclasses import dataclass, field

from phyblock.parsing.chain import chain
from phyblock.parsing.line_patterns import (
    ARRAY,
    FENCE,
    INLINE_STEP,
    LABELED,
    LAYER,
    MARKED,
    NAMES_FIRST,
    NOUN_LABEL,
    NUMBERED,
    SENTENCE_END,
    STARTS_MOVING,
    STEP,
    TAG,
)
from phyblock.parsing.mention import MOST_AT_ONCE
from phyblock.parsing.plan_patterns import (
    LABEL_CHARS,
    NOT_MEANT,
    OPTION,
    PART,
    PLAN_WORD,
    REVISION,
    SUPPOSED_SENTENCE,
)
from phyblock.parsing.statement import read_statement
from phyblock.parsing.structured import Found, find_json, find_tables
from phyblock.parsing.text_forms import plain_line

__all__ = ["Listing", "listings"]


@dataclass
class Listing:
    """One list: its form, the blocks that it names in order, and where it stands.

    `above` are the lines between it and the list before it that name nothing, `heading` the last of
    them or, where nothing stands between, that of the list before; `own` are the
    numbers that its items bear; `n_moves` of its `n_named` items say by a verb that they move.
    """

    form: str
    above: list[str]
    first_line: int
    last_line: int
    numbers: list[int] = field(default_factory=list)
    own: list[int] = field(default_factory=list)
    n_named: int = 0
    n_moves: int = 0
    label: str = ""
    heading: str = ""
    ends_named: bool = True
    leaves: bool = False
    loose: set[int] = field(default_factory=set)
    supports: set[int] = field(default_factory=set)
    denied: set[int] = field(default_factory=set)
    between: list[str] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)

    @property
    def is_firm(self) -> bool:
        """Whether its form says that it is a plan: steps, moves, JSON, a table with steps."""
        return self.form in ("steps", "json", "table") or 2 * self.n_moves >= self.n_named


_ABOVE = 12
_LEAVES_OUT = re.compile(r"\s{0,9}(?:\.{3,9}|…|⋮|\[\.{3}\])\s{0,9}")


def listings(text: str) -> tuple[list[Listing], list[str]]:
    """The lists of a text in order, and the lines that stand below the last one."""
    text = INLINE_STEP.sub("\n", TAG.sub(_of_tag, _ROWS.sub(_in_line, text)))
    reader = _Reader()
    forms = sorted(_apart(text), key=lambda found: found.start)
    starts = [found.start for found in forms]
    at = 0
    for number, line in enumerate(text.splitlines(keepends=True)):
        here = bisect_left(starts, at + len(line))
        inside = next((f for f in forms[max(0, here - 1) : here] if f.end > at), None)
        if inside is None:
            reader.read(number, line)
        else:
            if at <= inside.start:
                reader.read(number, line[: inside.start - at])
                reader.take(number, inside)
            if inside.end < at + len(line):
                reader.read(number, line[inside.end - at :])
        at += len(line)
    return reader.done, reader.above


_ROWS = re.compile(r"\[\s{0,9}(?:\d{1,6},?[ \t]{0,9}(?:(?:#|//)[^\n]{0,200})?\n\s{0,40}){1,63}\]")
_ROW = re.compile(r"^\W{0,40}(\d{1,6})", re.MULTILINE)


def _in_line(rows: re.Match[str]) -> str:
    """An array of numbers without its line ends and comments."""
    return f"[{', '.join(_ROW.findall(rows[0]))}]"


def _of_tag(tag: re.Match[str]) -> str:
    """The move that an empty element holds in its attributes; of others, that a line ends."""
    return f"\nMove block {tag['block']}\n" if tag["block"] else "\n"


def _apart(text: str) -> list[Found]:
    """JSON and tables of a text; JSON of a few words within a line is left to the line."""
    tables = find_tables(text)
    values = [
        f for f in find_json(text) if not any(t.start < f.end and f.start < t.end for t in tables)
    ]
    return tables + values


class _Reader:
    """Reads lines one by one into lists."""

    def __init__(self) -> None:
        self.done: list[Listing] = []
        self.above: list[str] = []
        self._steps: Listing | None = None
        self._numbered: Listing | None = None
        self._open: Listing | None = None
        self._times = 1

    def take(self, number: int, found: Found) -> None:
        """Add a list of a form of its own."""
        listing = self._new(found.form, number)
        listing.numbers, listing.n_named = list(found.numbers), len(found.numbers)
        listing.n_moves = listing.n_named
        self._steps = self._numbered = self._open = None

    def read(self, number: int, raw: str) -> None:
        """Add a line: an item of a list, what belongs to an item, or what stands between lists."""
        line = plain_line(raw).rstrip()
        if _LEAVES_OUT.fullmatch(line):
            self.above = [*self.above[-_ABOVE:], line.strip()]
        if FENCE.match(raw) or not line.strip(" \t[]{}()|,.:;#-=~"):
            return
        for pattern, name in ((STEP, "_steps"), (NUMBERED, "_numbered")):
            head = pattern.match(line)
            if head is not None and self._item(number, line, head, name):
                return
        if not self._other(number, line):
            self.above = [*self.above[-_ABOVE:], line.strip()]
            if not MARKED.match(line):
                self._open = None

    def _item(self, at: int, line: str, head: re.Match[str], name: str) -> bool:
        """Take a numbered item; False for a line whose number means something else."""
        n = int(head["number"])
        last = int(head.groupdict().get("last") or n)
        body = line[head.end() :].replace("{", " ").replace("}", " ")
        current: Listing | None = getattr(self, name)
        if name == "_steps" and not head["sign"] and body.strip():
            is_next = current is None or n > max(current.own, default=0)
            if not (is_next and _is_move(body)):
                return False
        if current is None or not 0 < n - (current.own[-1] if current.own else 0) <= 3:
            if n > 1 and not (name == "_steps" and _is_move(body)):
                return False
            current = self._new("steps" if name == "_steps" else "numbered", at)
            setattr(self, name, current)
            if name == "_steps":
                self._numbered = None
        current.own += range(n, last + 1) if 0 <= last - n < MOST_AT_ONCE else [n]
        self._open, self._times = current, max(1, last - n + 1)
        named = self._add(current, at, body, is_item=True)
        if not named:
            self.above = [*self.above[-_ABOVE:], line.strip()]
        return True

    def _other(self, at: int, line: str) -> bool:
        """Take a line without a number of its own; False where it names nothing that counts."""
        marked = MARKED.match(line)
        body = line[marked.end() :] if marked else line
        if (self._open is not None and not self._open.ends_named) or self._is_nested(at, marked):
            statement = read_statement(body.replace("{", " ").replace("}", " "), is_item=False)
            assert self._open is not None
            if statement.has_verb or (
                self._open.form == "steps" and NAMES_FIRST.match(body) and statement.numbers
            ):
                return self._add(self._open, at, body, is_item=False, is_nested=True)
        if self._is_detail(at, line, body, is_marked=marked is not None):
            return True
        if self._take_labeled(at, line):
            return True
        statement = read_statement(body, is_item=marked is not None)
        listed, by_arrows = chain(body)
        if listed and (len(listed) > 1 or not marked):
            if (
                self.done
                and self.done[-1].form == "numbers"
                and len(listed) == 1
                and not self.above
            ):
                self.done[-1].numbers += listed
                self.done[-1].last_line = at
                return True
            listing = self._new("chain" if by_arrows or len(listed) > 1 else "numbers", at)
            listing.numbers, listing.n_named, listing.n_moves = (
                list(listed),
                2,
                1 if by_arrows else 0,
            )
            listing.lines.append(body)
            self._open = None
            return True
        if not statement.numbers:
            return False
        if marked is None and not statement.has_verb:
            return False
        form = "marked" if marked or STARTS_MOVING.match(line) else "sentences"
        if form == "sentences" and SUPPOSED_SENTENCE.search(line):
            return False
        return self._extend(form, at, body, is_item=marked is not None)

    def _is_nested(self, at: int, marked: re.Match[str] | None) -> bool:
        """Whether a marked line goes on with those that an item without a block of its own has."""
        return (
            marked is not None
            and self._open is not None
            and self._nested_at == (id(self._open), at - 1)
        )

    def _is_detail(self, at: int, line: str, body: str, *, is_marked: bool) -> bool:
        """Whether a marked line says more of the item above it, which names its block."""
        item = self._open
        if (
            not is_marked
            or item is None
            or not item.ends_named
            or at - 1 not in (item.last_line, self._detail_at)
        ):
            return False
        if not line[:1].isspace() and read_statement(body, is_item=False).has_verb:
            return False
        self._detail_at = at
        return True

    _detail_at = -1
    _nested_at: tuple[int, int] = (0, 0)

    def _extend(self, form: str, at: int, body: str, *, is_item: bool) -> bool:
        """Go on with the list above, where it has this form and nothing stands between."""
        last = self.done[-1] if self.done else None
        if last is None or last.form != form or (self.above and form == "marked"):
            last = self._new(form, at)
        if form == "marked":
            self._open = None
        return self._add(last, at, body, is_item=is_item)

    def _take_labeled(self, at: int, line: str) -> bool:
        """Numbers with a label before them ("Order: 3, 5, 12"), or an array somewhere in a line."""
        labeled = LABELED.match(line)
        if labeled and (
            labeled["label"].count("(") > labeled["label"].count(")")
            or NOUN_LABEL.fullmatch(labeled["label"])
        ):
            labeled = None
        value, _, rest = (
            SENTENCE_END.sub("\n", labeled["value"], count=1).partition("\n")
            if labeled
            else ("", "", "")
        )
        value = value.rstrip(" .}")
        listed, _ = chain(value)
        if not listed and labeled and not read_statement(line, is_item=False).has_verb:
            listed = (
                read_statement(value, is_item=True).numbers if len(labeled["label"]) < 30 else ()
            )
        if not listed:
            arrays = list(ARRAY.finditer(line))
            if not arrays:
                return False
            listed, label = chain(arrays[-1][0])[0], line[: arrays[-1].start()]
            value = line[arrays[-1].start() :]
        else:
            label = labeled["label"] if labeled else ""
        last = self.done[-1] if self.done else None
        self._open = None
        if last is not None and last.form == "labeled" and not self.above and _goes_on(last, label):
            last.numbers += listed
            last.last_line = at
            last.label = f"{last.label}, {label}"
        else:
            last = self._new("labeled", at)
            last.numbers, last.label, last.n_named = list(listed), label, 2
        last.lines.append(value)
        if rest:
            self.read(at, rest)
        return True

    def _add(
        self, to: Listing, at: int, body: str, *, is_item: bool, is_nested: bool = False
    ) -> bool:
        statement = read_statement(body, is_item=is_item)
        listed = statement.numbers or (chain(body)[0] if is_item else ())
        to.last_line = at
        to.lines.append(body)
        to.ends_named = bool(listed)
        to.supports |= statement.supports
        to.loose |= statement.loose
        to.denied |= statement.denied
        if not listed:
            return False
        if to.n_named:
            to.between += self.above
        to.numbers += list(listed) * (self._times if len(listed) == 1 and is_item else 1)
        to.n_named += 1
        to.n_moves += statement.has_verb
        to.leaves = to.leaves or statement.leaves
        if is_nested:
            self._nested_at = (id(to), at)
        self.above = []
        return True

    def _new(self, form: str, at: int) -> Listing:
        listing = Listing(form, self.above, at, at)
        last = self.done[-1] if self.done else None
        if self.above:
            listing.heading = self.above[-1]
        elif last is not None and at - last.last_line <= 1:
            listing.heading = last.heading
        self.above = []
        self.done.append(listing)
        return listing


def _goes_on(last: Listing, label: str) -> bool:
    """Whether a label names a further part of the plan whose part stands above it."""
    if OPTION.match(label):
        return False
    if LAYER.search(label):
        return True
    is_plain = not (PLAN_WORD.search(label) or REVISION.search(label) or NOT_MEANT.search(label))
    return is_plain and bool(PART.search(last.label)) and len(label) < LABEL_CHARS


def _is_move(body: str) -> bool:
    return bool(read_statement(body, is_item=False).numbers)
