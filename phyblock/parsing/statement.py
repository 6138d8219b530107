"""What one statement of a reply moves: the numbers of the blocks that it names, and how firmly.

"On top of block 3, move blocks 5 and 6 (x2)" moves 5, 6, 6: block 3 is a support. Ranges and
multiplicities are counted out; of alternatives the first one counts; what is said not to be moved
is not.
"""

# ruff: noqa: RUF001 -- replies come in other scripts
from __future__ import annotations

import functools
import re
from dataclasses import dataclass, field

from phyblock.parsing.mention import GROUP, MENTION, SAYS_NUMBER, STATEMENT_CHARS, TIMES, counted
from phyblock.parsing.mention_context import (
    ALSO_CALLED,
    ALSO_SUPPORT,
    AND_THEN,
    HERE,
    INSTEAD,
    JOINS,
    NEGATED,
    PIECE_VERB,
    PIECES,
    STANDS,
    SUPPORT,
    WHEN_PLACED,
)

__all__ = ["Statement", "read_statement"]

_IS_WHOLE = re.compile(
    rf"(?:[^\d:：,.;]{{1,40}}[:：→]\s)?[\s#(\[]{{0,4}}{GROUP}[\s)\]]{{0,3}}(?=\Z|[(:,;.\-\u2013\u2014|x×])",
    re.IGNORECASE,
)
_AND_TO_FINISH = re.compile(
    r"(?<=\band )to finish(?=, |\s(?:with\s)?(?:the|a)\s(?:(?!of\b|on\b)[^\W\d]{1,16}\s){1,4}"
    r"\(#?\d{1,3}\)\s?(?:[.;]|\Z))",
    re.IGNORECASE,
)
"""Words before the last block; "to finish the row of block 3" says what another one is for."""


@dataclass(frozen=True)
class Statement:
    """The blocks that a statement moves, in order; whether it says so by a verb.

    `leaves` tells that it names others, too, of which it does not say so; `loose` are blocks that
    it names and of which the grammar does not tell whether they are moved, `supports` those on or
    beside which others are put, `denied` those that are not.
    """

    numbers: tuple[int, ...]
    has_verb: bool = False
    leaves: bool = False
    loose: frozenset[int] = frozenset()
    supports: frozenset[int] = frozenset()
    denied: frozenset[int] = frozenset()


@dataclass
class _Rest:
    """Blocks that a statement names beside those that it moves."""

    loose: set[int] = field(default_factory=set)
    supports: set[int] = field(default_factory=set)
    denied: set[int] = field(default_factory=set)


def read_statement(text: str, *, is_item: bool) -> Statement:
    """What a line without markup moves; in an item of a list (`is_item`) a number alone may do."""
    return _read(text[:STATEMENT_CHARS], is_item)


# A line is read as an item, as what belongs to one and for its verb, and models repeat themselves.
@functools.lru_cache(maxsize=1024)
def _read(text: str, is_item: bool) -> Statement:
    if not SAYS_NUMBER.search(text):
        return Statement(())
    text = _AND_TO_FINISH.sub("finally", HERE.sub(" ", text))
    bare: tuple[int, ...] = ()
    moved: list[int] = []
    rest = _Rest()
    for piece in _pieces(text):
        found = _moved(piece, rest)
        if found and PIECE_VERB.search(piece):
            moved += found
        elif bare:
            rest.loose.update({*found} - {*bare})
        else:
            bare = tuple(found)
    beside = (frozenset(rest.loose), frozenset(rest.supports), frozenset(rest.denied))
    if moved:
        return Statement(tuple(moved), True, not {*bare} <= {*moved}, *beside)
    whole = _IS_WHOLE.match(text) if is_item else None
    named = tuple(counted(whole, text)) if whole else bare
    return Statement(named, False, False, *beside)


def _pieces(text: str) -> list[str]:
    pieces, start = [], 0
    for end in PIECES.finditer(text):
        pieces.append(text[start : end.start()])
        start = end.end()
    return [*pieces, text[start:]]


def _moved(piece: str, rest: _Rest) -> list[int]:
    """The first free mention of a piece, and those that are joined to it; the others are left."""
    found: list[int] = []
    last: re.Match[str] | None = None
    support_end = 0
    for mention in MENTION.finditer(piece):
        start = mention.start() + len(mention["verb"] or mention["call"] or mention["then"] or "")
        is_call = bool(mention["verb"] or mention["call"] or mention["then"])
        if mention["then"] and last is None:
            continue
        if not is_call and STANDS.match(piece, mention.end()):
            continue
        before = piece[max(0, start - 120) : start]
        if WHEN_PLACED.search(before):
            rest.supports.update(counted(mention, piece))
            continue
        if NEGATED.search(before):
            rest.denied.update(counted(mention, piece))
            continue
        support = None if is_call else SUPPORT.search(before)
        if support_end and ALSO_SUPPORT.fullmatch(piece, support_end, start):
            support_end = mention.end()
            rest.supports.update(counted(mention, piece))
            continue
        if support:
            support_end = mention.end()
            kind = rest.denied if INSTEAD.match(support[0]) else rest.supports
            if mention["noun"] or mention["cjk"]:
                kind.update(counted(mention, piece))
            continue
        goes_on = mention["then"] or mention["verb"] or (last and mention["call"] and last["call"])
        if last is not None and not goes_on:
            between = piece[last.end() : start]
            times = TIMES.match(piece, last.end())
            between = piece[times.end() : start] if times and times.end() <= start else between
            if not (JOINS.match(between) and AND_THEN.search(between)) and not (
                PIECE_VERB.search(between) and not is_call
            ):
                if (mention["noun"] or mention["cjk"]) and not ALSO_CALLED.fullmatch(between):
                    rest.loose.update(counted(mention, piece))
                continue
        found += counted(mention, piece)
        last = mention
    return found
