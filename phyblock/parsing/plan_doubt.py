"""What a reply says of its plan that a reading does not account for: then the reading is a guess.

Patterns say what a list is, and no set of patterns is complete. So what they leave over decides
whether a reading stands: a block that an item names and that is neither moved nor a support, a
correction beside the list, a list without its beginning, another list after it that says otherwise.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from phyblock.parsing.listing import Listing
from phyblock.parsing.plan_patterns import EXPLANATION
from phyblock.parsing.plan_rank import LAST, NO, rank_of
from phyblock.parsing.statement import named_blocks

__all__ = ["is_doubtful"]

_CORRECTS = re.compile(
    r"\b(?:wait|correction|corrected|oops|scratch that|should (?:be|have been|read)|must be|i meant"
    r"|swap(?:ped)?|my mistake|moment|korrektur|sondern|muss|corrección|korrigier\w*)\b"
    r"|\b(?:actually|no|rather)\b[,:]|等等|应该是|更正|改为|訂正|正しくは",
    re.IGNORECASE,
)
_NUMBER = re.compile(r"\d")
_SENTENCE = re.compile(r"[.;!?](?=\s|\Z)|[。；！？]")
_ASIDE = re.compile(
    r"\b(?:not?|never|none|un\w+|distract\w*|decoy\w*|similar|alternativ\w*|could|would|might|may|if|other"
    r"|left|remaining|example|extra|nicht|kein\w*|ähnlich\w*|autres?|otros?|no)\b|n['\u2019]t\b|不|未|没",
    re.IGNORECASE,
)
"""Words of a sentence about blocks that are no part of the plan."""
_FRAGMENT = 3
"""Steps of a list that may go on from what stands there already."""
_MOST_LEFT_OUT = 4
"""A list that begins later than this numbers its steps in a way of its own (10, 20, ...)."""


def is_doubtful(lists: Sequence[Listing], below: Sequence[str], later: Sequence[Listing]) -> bool:
    """Whether the lists of a plan are no sure reading, by what stands in, below and after them."""
    numbers = {number for listing in lists for number in listing.numbers}
    if any(listing.loose for listing in lists):
        return True
    n_steps = sum(len(listing.numbers) for listing in lists)
    is_whole = n_steps > _FRAGMENT or lists[0].form == "sentences"
    if is_whole and any(listing.supports - numbers for listing in lists):
        return True
    own = lists[0].own
    if own and 1 < own[0] <= _MOST_LEFT_OUT:
        return True
    beside = [line for listing in lists for line in listing.between]
    for listing in later:
        beside += listing.above
    return _is_corrected([*beside, *below], numbers) or any(
        _says_otherwise(listing, numbers) for listing in _unexplained(later)
    )


def _is_corrected(lines: Sequence[str], numbers: set[int]) -> bool:
    """Whether lines beside a plan take a step back, or name blocks that it lacks."""
    for line in lines:
        if EXPLANATION.search(line):
            return False
        if _CORRECTS.search(line) and _NUMBER.search(line):
            return True
        for sentence in _SENTENCE.split(line):
            if not _ASIDE.search(sentence) and named_blocks(sentence) - numbers:
                return True
    return False


def _unexplained(later: Sequence[Listing]) -> Iterator[Listing]:
    """The lists up to the one that an explanation begins with."""
    for listing in later:
        if any(EXPLANATION.search(line) for line in listing.above):
            return
        yield listing


def _says_otherwise(listing: Listing, numbers: set[int]) -> bool:
    is_plan = rank_of(listing) > (NO if listing.n_moves else LAST)
    return is_plan and bool({*listing.numbers} - numbers)
