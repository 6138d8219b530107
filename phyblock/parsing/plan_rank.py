"""How surely a list of a reply is its plan."""

from __future__ import annotations

import re

from phyblock.parsing.line_patterns import LAYER
from phyblock.parsing.listing import Listing
from phyblock.parsing.plan_patterns import (
    BLOCK_WORD,
    CATALOGUE_WORD,
    DOWNWARD,
    EXAMPLE,
    FINAL_LABEL,
    HEADING_CHARS,
    LABEL_CHARS,
    LAYERS,
    NOT_MEANT,
    OPTION,
    PLAN_WORD,
    REVISION,
)
from phyblock.parsing.speech import words

__all__ = ["ASKED", "LAST", "MARKED", "MOVES", "NO", "is_announced", "rank_of"]

NO, LAST, MARKED, MOVES, ASKED = range(5)
"""No plan; one where nothing else is; a marked list of moves; a numbered one; the asked form."""


def rank_of(listing: Listing) -> int:
    """How surely a list is a plan, by its form, its label and the heading above it."""
    heading = "" if listing.heading.endswith((".", "。")) else listing.heading
    title = listing.above[-1] if listing.above else ""
    if EXAMPLE.search(title) or (NOT_MEANT.search(title) and not OPTION.match(listing.label)):
        return NO
    if listing.form == "numbers":
        is_list = len(listing.numbers) > 1 and (not heading or PLAN_WORD.search(heading))
        return LAST if is_list else NO
    is_catalogue = _names_catalogue(heading)
    if listing.form == "layers":
        is_seen = not listing.n_moves and any(map(CATALOGUE_WORD.search, listing.above))
        return NO if is_catalogue or is_seen else MARKED if listing.n_moves else LAST
    if listing.form == "labeled":
        return _rank_of_label(listing, heading, is_catalogue=is_catalogue)
    if listing.form == "steps" and 2 * listing.n_named <= len(listing.own) > 1:
        return LAST
    if listing.form in ("json", "table") or (listing.form == "steps" and listing.n_moves):
        return ASKED
    if listing.form == "steps":
        return MOVES
    if is_catalogue or listing.form == "sentences":
        return LAST if listing.n_moves and not listing.leaves else NO
    if listing.is_firm:
        is_final = bool(REVISION.search(heading))
        return ASKED if is_final else MOVES if listing.form == "numbered" else MARKED
    if is_announced(listing) and listing.numbers != listing.own:
        return ASKED
    if listing.own == listing.numbers and len(listing.own) > 2:
        return NO
    return (
        LAST
        if PLAN_WORD.search(heading) or listing.form in ("numbered", "chain") or not heading
        else NO
    )


def is_announced(listing: Listing) -> bool:
    """Whether the heading of a list calls it the plan in its last form."""
    title = listing.above[-1] if listing.above else ""
    return bool(len(title) < HEADING_CHARS and REVISION.search(title) and PLAN_WORD.search(title))


def _rank_of_label(listing: Listing, heading: str, *, is_catalogue: bool) -> int:
    """The rank of numbers that stand behind a label."""
    label, many = listing.label, len(listing.numbers) > 1
    if (
        NOT_MEANT.search(f"{label}:")
        or _names_catalogue(label)
        or (_MEASURES.search(label) and not PLAN_WORD.search(label))
        or re.match(
            r"\W*(?:the )?(?:top|upper|roof)\b.*(?:bottom|base|ground|lower)\b(?! to)", label, re.I
        )
    ):
        return (DOWNWARD.search(label) is not None and MARKED) or NO
    if FINAL_LABEL.search(label):
        return ASKED if many or re.search("answer|final|plan", label, re.IGNORECASE) else NO
    if (
        PLAN_WORD.search(label)
        or OPTION.match(label)
        or DOWNWARD.search(label)
        or (PLAN_WORD.search(heading) and not is_catalogue)
    ):
        return MARKED if many else NO
    parts = label.split(", ")
    is_short = len(label) < LABEL_CHARS and not BLOCK_WORD.search(label)
    is_layer = [bool(LAYER.search(part) or LAYERS.match(part)) for part in parts]
    if len(parts) > 1 and not all(is_layer) and "[" not in label:
        return NO
    return LAST if many and not is_catalogue and (is_short or LAYERS.match(label)) else NO


_MEASURES = words(
    r"\b(?:heights|widths|lengths|depths|sizes|distances|counts|supports)\W*\Z"
    r"|\bthe (?:\w+ )?(?:layers|levels|rows|tiers|storeys|floors)\W*\Z"
)
"""Labels of numbers that count or measure."""


def _names_catalogue(title: str) -> bool:
    return bool(CATALOGUE_WORD.search(title)) and not PLAN_WORD.search(title)
