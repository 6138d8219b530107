"""What a reply says of its plan that a reading does not account for: then the reading is a guess.

Patterns say what a list is, and no set of patterns is complete. So what they leave over decides
whether a reading stands: a block that an item names and that is neither moved nor a support, a
correction beside the list, a list without its beginning, another list after it that says otherwise.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from phyblock.parsing.listing import Listing
from phyblock.parsing.plan_patterns import EXPLANATION
from phyblock.parsing.plan_rank import LAST, NO, rank_of

__all__ = ["is_doubtful"]

_CORRECTS = re.compile(
    r"\b(?:wait|correction|corrected|oops|scratch that|should (?:be|have been|read)|must be|i meant"
    r"|swap(?:ped)?|my mistake|moment|korrektur|sondern|muss|corrección|korrigier\w*)\b"
    r"|\b(?:actually|no|rather)\b[,:]|等等|应该是|更正|改为|訂正|正しくは",
    re.IGNORECASE,
)
_NUMBER = re.compile(r"\d")
_MOST_LEFT_OUT = 4
"""A list that begins later than this numbers its steps in a way of its own (10, 20, ...)."""


def is_doubtful(lists: Sequence[Listing], below: Sequence[str], later: Sequence[Listing]) -> bool:
    """Whether the lists of a plan are no sure reading, by what stands in, below and after them."""
    numbers = {number for listing in lists for number in listing.numbers}
    beside = [line for listing in lists for line in listing.between]
    if any(listing.loose - numbers for listing in lists):
        return True
    if any(_CORRECTS.search(line) and _NUMBER.search(line) for line in (*beside, *below)):
        return True
    own = lists[0].own
    if own and 1 < own[0] <= _MOST_LEFT_OUT:
        return True
    for listing in later:
        if any(EXPLANATION.search(line) for line in listing.above):
            return False
        if rank_of(listing) > (NO if listing.n_moves else LAST) and {*listing.numbers} - numbers:
            return True
    return False
