"""Reads the lines of a reply one by one into lists: steps, numbered or marked items, sentences.

A list knows what stands above it, so that it can be told what it is to the one before it.
"""

from __future__ import annotations

import re

from phyblock.parsing.chain import chain
from phyblock.parsing.labeled_numbers import labeled_numbers
from phyblock.parsing.line_patterns import (
    FENCE,
    LAYER,
    MARKED,
    NAMES_FIRST,
    NUMBERED,
    STARTS_MOVING,
    STEP,
)
from phyblock.parsing.listing import Listing
from phyblock.parsing.mention import MOST_AT_ONCE
from phyblock.parsing.plan_patterns import (
    FINAL_LABEL,
    LABEL_CHARS,
    NOT_MEANT,
    OPTION,
    PART,
    PLAN_WORD,
    REVISION,
)
from phyblock.parsing.speech import SUPPOSES
from phyblock.parsing.statement import read_statement
from phyblock.parsing.structured import Found
from phyblock.parsing.text_forms import plain_line

__all__ = ["LineReader"]

_ABOVE = 12
_LEAVES_OUT = re.compile(r"\s{0,9}(?:\.{3,9}|…|⋮|\[\.{3}\])\s{0,9}")


class LineReader:
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
        listing.n_moves = listing.n_named * found.says_moves
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
        if name == "_steps" and _says_plan(body):
            return self._take_labeled(at, body)
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
        if form == "sentences" and SUPPOSES.search(line):
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
        labeled = labeled_numbers(line)
        if labeled is None:
            return False
        last = self.done[-1] if self.done else None
        self._open = None
        if (
            last is not None
            and last.form == "labeled"
            and not self.above
            and _goes_on(last, labeled.label)
        ):
            last.numbers += labeled.numbers
            last.last_line = at
            last.label = f"{last.label}, {labeled.label}"
        else:
            last = self._new("labeled", at)
            last.numbers, last.label, last.n_named = list(labeled.numbers), labeled.label, 2
        last.lines.append(labeled.value)
        if labeled.rest:
            self.read(at, labeled.rest)
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


def _says_plan(body: str) -> bool:
    """Whether the text of a step says the whole plan: "Step 3 - Order: 4, 4, 11, 2"."""
    labeled = labeled_numbers(body) if ":" in body else None
    return (
        labeled is not None and len(labeled.numbers) > 1 and bool(FINAL_LABEL.search(labeled.label))
    )


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
