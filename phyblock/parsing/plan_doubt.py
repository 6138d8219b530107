"""What a reply says of its plan that a reading does not account for: then the reading is a guess.

Patterns say what a list is, and no set of patterns is complete. So what they leave over decides
whether a reading stands: a block that an item names and that is neither moved nor a support, a
correction beside the list, a list without its beginning, another list after it that says otherwise.
"""

# ruff: noqa: RUF001 -- replies come in other scripts

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import pairwise

from phyblock.parsing.listing import Listing
from phyblock.parsing.mention import VERB, named_blocks
from phyblock.parsing.plan_claims import PLACE_OR_TIMES, counts_hold, places_hold
from phyblock.parsing.plan_patterns import (
    CATALOGUE_WORD,
    CORRECTS,
    EXPLANATION,
    NOT_MEANT,
    REVISION,
)
from phyblock.parsing.plan_rank import LAST, NO, is_announced, rank_of
from phyblock.parsing.speech import words
from phyblock.parsing.text_forms import SENTENCES
from phyblock.parsing.tiers import tier_of

__all__ = ["is_doubtful"]

_DROPS = words(
    r"\b(?:forget|scrap|disregard|vergiss|(?:don['\u2019]t|do not) (?:use|trust|take))\s(?:the"
    r"|that|this|it|what|any|d\w\w)\b|\b(?:not sure|unsure|uncertain|don['\u2019]t know) which\b"
    r"|\b(?:swap|switch|exchange|remove|delete|drop|skip)\s(?:the\s)?(?:first|last|second|third"
    r"|final)\b|\bnot (?:at all )?sure (?:about|of) (?:any|all|this|these|the plan)"
)
_NUMBER = re.compile(r"\d")
_ASIDE = words(
    r"\b(?:not?|never|none|un\w+|distract\w*|decoy\w*|similar|alternativ\w*|could|would|might|may"
    r"|if|other|looks? like|mirror\w*|resembl\w*|left|remaining|example|extra|same (?:shape|size"
    r"|kind|colou?r)|looks? \w+ like|\w+er than|nicht|kein\w*|ähnlich\w*|autres?|pas|jamais|otros?"
    r"|no|tampoco|non|não|nem|не|нет|похож\w*)\b|n['\u2019]t\b|不|未|没|ません|ない|않|안 "
)
"""Words of a sentence about blocks that are no part of the plan."""
_LOOSE_FORMS = ("labeled", "chain", "numbers", "sentences", "marked")
_WHOLE = re.compile(r"(?<![\d.])\d{1,6}(?![\d]|\.\d)")
_ROLE = re.compile(
    r"\b(?:steps?|layers?|levels?|rows?|col(?:umn)?s?|schritte?|ebene|schicht|plan|option|attempt"
    r"|structure|part|phase|stage)[ #_]?\d+"
    r"|\d+(?:\.\d+)?\s?(?:%|°|cm|mm|m\b|percent|degrees?|(?<=\d)[x×](?![a-z])|(?<=\s)[x×]\s(?!\d)|times|mal\b)|[x×]\s?\d+"
    r"|\(\s?-?\d+(?:\.\d+)?(?:\s?,\s?-?\d+(?:\.\d+)?){1,2}\s?\)|\d+(?:st|nd|rd|th)\b"
    r"|第\d+[层步]|\d+\s?[个块层步]|^\W*[a-z]{0,4}\d{1,3}(?:/\d{1,3})?\s?[.):-]\s|#\s\d{1,3}$"
    r"|(?<!block )(?<!index )\b\d+\s(?:\w+\s)?(?:blocks?|layers?|levels?|steps?|moves?|pieces?"
    r"|pillars?|copies|rows?|sides?)\b"
    r"|\d+\s(?:more|further|other)\b",
    re.IGNORECASE | re.MULTILINE,
)
"""Numbers that are no block's: places, sizes, counts, coordinates."""
_BRACKETS = re.compile(r"\([^()\n]{0,200}\)|\[[^\[\]\n]{0,200}\]")
_EXPLAINS = words(
    r"\b(?:explanation|rationale|reasoning|justification)|erklärung|begründung"
    r"|解释|说明|理由"
)
"""A label behind which blocks are named that need not be of the plan."""
_PUTS = words(
    rf"{VERB}|\b(?:goes|comes|belongs|missing|needed|chang\w+|replac\w+|swap\w*|kommt|gehört"
    r"|fehlt)\b"
)
_STEP_AGAIN = words(
    r"(?:\b(?:swap\w*|skip|remov\w+|drop|wrong|replac\w+|should|must|has to|needs? to|exchange"
    r"|delete|ignore|unnecessary|(?:not|n't) (?:needed|required|necessary))\b.{0,60})?"
    r"\bsteps?\s?\d(?P<then>.{0,60}\b(?:swap\w*|skip\w*|remov\w+|drop\w*|wrong|replac\w+|should"
    r"|must"
    r"|has to|needs? to|exchange\w*|unnecessary|(?:not|n't) (?:needed|required|necessary)))?"
)
"""A step named again, to take it back."""
_MAY_BE_SWAPPED = words(
    r"\b(?:may|can|could|might) (?:also |as well )?be (?:swap|switch|exchang|interchang)\w+"
)
_ONCE_MORE = words(
    r"\bstep\W{0,3}\d{1,2}\W.{0,20}\b(?:repeat|again|same|another|likewise|also|mirror"
    r"|duplicate|copy)\b"
)
"""A step that names no block but moves one."""
_TWICE = words(r"\b(?:twice|thrice|zweimal|dreimal|dos veces|deux fois)\b")
_LEAVES_OUT = re.compile(r"\W*(?:\.{3}|…)\W*")
_FRAGMENT = 3
"""Steps of a list that may go on from what stands there already."""
_MOST_LEFT_OUT = 4
"""A list that begins later than this numbers its steps in a way of its own (10, 20, ...)."""


def is_doubtful(
    lists: Sequence[Listing],
    below: Sequence[str],
    before: Sequence[Listing],
    later: Sequence[Listing],
) -> bool:
    """Whether the lists of a plan are no sure reading.

    What says so stands in them, in the lines `below`, or in the lists `before` and `later`.
    """
    return (
        _names_more(lists)
        or _is_torn(lists)
        or (rank_of(lists[0]) == LAST and any(_is_beside(b, lists[0]) for b in before[-1:]))
        or _is_contradicted(lists, below, later)
    )


def _numbers(lists: Sequence[Listing]) -> list[int]:
    return [number for listing in lists for number in listing.numbers]


def _names_more(lists: Sequence[Listing]) -> bool:
    """Whether items name blocks that are neither moved nor carry others."""
    numbers = _numbers(lists)
    is_whole = len(numbers) > _FRAGMENT or lists[0].form == "sentences"
    return any(
        listing.loose
        or (listing.form == "sentences" and _loses_times(listing))
        or (is_whole and listing.supports - {*numbers})
        or (listing.form in _LOOSE_FORMS and _leaves_numbers(listing))
        for listing in lists
    )


def _loses_times(listing: Listing) -> bool:
    """Whether sentences say "twice" of a block that is in none of them more than once."""
    is_repeated = len({*listing.numbers}) < len(listing.numbers)
    return not is_repeated and any(map(_TWICE.search, listing.lines))


def _is_torn(lists: Sequence[Listing]) -> bool:
    """Whether steps are lacking before or within a list, or stand there twice."""
    own = lists[0].own
    return (
        bool(own and 1 < own[0] <= _MOST_LEFT_OUT)
        or any(1 < b.own[0] <= a.own[-1] for a, b in pairwise(lists) if a.own and b.own)
        or bool(lists[-1].lines and _LEAVES_OUT.fullmatch(lists[-1].lines[-1]))
        or any(
            not re.search(r"\w", line) or _ONCE_MORE.search(line)
            for listing in lists
            for line in listing.between
        )
    )


def _is_contradicted(
    lists: Sequence[Listing], below: Sequence[str], later: Sequence[Listing]
) -> bool:
    """Whether lines and lists beside or behind the plan say otherwise."""
    order = _numbers(lists)
    known = {*order}
    if not counts_hold("\n".join(below), order):
        return True
    beside = [line for listing in lists for line in listing.between]
    beside += [line for listing in later for line in listing.above]
    after = list(_unexplained(later))
    explained: list[str] = []
    for listing in after:
        if listing.form != "labeled" or _ASIDE.search(listing.label):
            continue
        if _EXPLAINS.search(listing.label):
            explained += listing.lines
            sentences = SENTENCES.split("\n".join(listing.lines))
            beside += filter(_PUTS.search, sentences)
        else:
            beside += listing.lines
    said = "\n".join([*beside, *below, *(line for listing in after for line in listing.lines)])
    if not places_hold(said, order):
        return True
    is_explained = bool(explained) or any(map(EXPLANATION.search, beside))
    return (
        _is_corrected(beside, order, is_explained=False)
        or _is_corrected([*explained, *below], order, is_explained=is_explained)
        or any(_says_otherwise(listing, order, known) for listing in after)
    )


def _is_beside(before: Listing, listing: Listing) -> bool:
    """Whether labels of one kind stand line by line, of which one alone was taken."""
    is_next = listing.first_line - before.last_line <= 1
    return (
        before.form == listing.form in ("labeled", "chain")
        and is_next
        and not REVISION.search(listing.label)
    )


def _leaves_numbers(listing: Listing) -> bool:
    """Whether the lines of a list hold numbers that are none of its blocks and nothing else."""
    text = _BRACKETS.sub(_unless_aside, "\n".join(listing.lines))
    found = list(map(int, _WHOLE.findall(_ROLE.sub(" ", text))))
    if found in (listing.numbers * 2, [*listing.numbers, *listing.numbers[::-1]]):
        return False
    left = Counter(found) - Counter(listing.numbers)
    return bool({*left} - listing.supports - listing.denied)


def _unless_aside(brackets: re.Match[str]) -> str:
    return " " if _ASIDE.search(brackets[0]) else brackets[0]


def _is_corrected(lines: Sequence[str], order: Sequence[int], *, is_explained: bool) -> bool:
    """Whether lines beside a plan take a step back, or name blocks that it lacks.

    What explains the plan may name others.
    """
    numbers = {*order}
    for line in lines:
        line = PLACE_OR_TIMES.sub(" ", _MAY_BE_SWAPPED.sub(" ", line))
        is_explained = is_explained or bool(EXPLANATION.search(line))
        if (CORRECTS.search(line) and _NUMBER.search(line)) or _DROPS.search(line):
            return True
        again = _STEP_AGAIN.search(line)
        if again and (again["then"] or not again[0].lower().startswith("step")):
            return True
        for sentence in () if is_explained else SENTENCES.split(line):
            if not _ASIDE.search(sentence) and named_blocks(sentence) - numbers:
                return True
    return False


def _unexplained(later: Sequence[Listing]) -> Iterator[Listing]:
    """The lists that no explanation holds; one that is called the last form of the plan ends it."""
    is_explained = False
    for listing in later:
        is_explained = is_explained or any(EXPLANATION.search(line) for line in listing.above)
        if is_announced(listing):
            is_explained = False
        if not is_explained:
            yield listing


def _says_otherwise(listing: Listing, order: list[int], known: set[int]) -> bool:
    """Whether a later list names further blocks, or the same in another order."""
    is_as_long = len(listing.numbers) == len(order)
    if is_as_long and sorted(listing.numbers) == sorted(order) and not _is_no_plan(listing.label):
        return listing.numbers not in (order, sorted(order))
    is_layer = tier_of(listing.label) is not None and not _ASIDE.search(listing.label)
    is_plan = is_layer or rank_of(listing) > (NO if listing.n_moves else LAST)
    return is_plan and bool({*listing.numbers} - known)


def _is_no_plan(label: str) -> bool:
    return bool(CATALOGUE_WORD.search(label) or NOT_MEANT.search(f"{label}:"))
