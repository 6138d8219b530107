"""Which lists of a reply are one plan, and which plan of several is meant."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from phyblock.parsing.listing import Listing
from phyblock.parsing.plan_patterns import (
    CHOICE,
    CORRECTS,
    EXPLANATION,
    FINAL_LABEL,
    HEADING_CHARS,
    OPTION,
    OR_ELSE,
    ORDINALS,
    PART,
    REVISION,
)
from phyblock.parsing.speech import CONDITIONAL, TAKES_BACK, words
from phyblock.parsing.text_forms import SENTENCES

__all__ = ["PlanLists", "chosen", "plans_of"]


@dataclass
class PlanLists:
    """Lists that are one plan, the lines before it and those below its end."""

    lists: list[Listing]
    title: str
    option: str = ""
    explained: bool = False
    is_unclear: bool = False
    below: list[str] = field(default_factory=list)

    @property
    def numbers(self) -> list[int]:
        """The blocks of all lists, in order."""
        return [number for listing in self.lists for number in listing.numbers]


def plans_of(
    named: list[Listing], ranks: list[int], best: int, found: list[Listing]
) -> list[PlanLists]:
    """The lists of the best rank as plans: parts joined, explanations left out."""
    plans: list[PlanLists] = []
    passed: list[str] = []
    kept = {id(listing) for listing, rank in zip(named, ranks, strict=True) if rank == best}
    for listing in found:
        passed += listing.above
        if id(listing) not in kept:
            passed.append("")
            continue
        relation = _relation(passed, plans, listing)
        title = " ".join(passed[-2:])
        option = OPTION.search(f"{title} {listing.label}")
        if relation == "part":
            plans[-1].lists.append(listing)
        elif relation == "explanation":
            plans[-1].explained = True
        elif relation != "skip":
            name = option["name"].lower() if option else ("or" if relation == "option" else "")
            plans.append(PlanLists([listing], title, name, is_unclear=relation == "unclear"))
        passed = []
    return plans


def _relation(passed: list[str], plans: list[PlanLists], listing: Listing) -> str:
    """What a list is to the plan before it, by the lines between them."""
    lines = [line for line in passed if line] or (
        [listing.label] if listing.form == "labeled" else []
    )
    title = lines[0].strip() if len(lines) == 1 else ""
    if not plans:
        return "other"
    if any(OPTION.search(line) or OR_ELSE.match(line) for line in lines[-2:]):
        return "option"
    before = plans[-1].lists[-1]
    if listing.form == "labeled" and not any(passed):
        return "other"
    if len(lines) > 1 or len(title) > HEADING_CHARS or REVISION.search(title) or "" in passed:
        is_explained = any(EXPLANATION.search(line) for line in lines[:1])
        is_last_word = _is_announced(lines, listing) or _replaces(lines, listing, before)
        return "explanation" if is_explained and not is_last_word else "other"
    if EXPLANATION.search(title) and listing.form != "json":
        return "explanation"
    part = PART.search(title) if title else before.numbers != listing.numbers
    if not (part and before.ends_named):
        is_other = before.form == listing.form != "steps" and before.numbers != listing.numbers
        return "unclear" if title and is_other else "other"
    return "skip" if plans[-1].explained else "part"


def _replaces(lines: list[str], listing: Listing, before: Listing) -> bool:
    """Whether whole steps come anew behind an explanation that corrects those before it.

    Steps that are fewer go over a part of the plan, unless words take back what stands there.
    """
    is_whole = listing.form == "steps" and listing.own[:1] == [1] and len(listing.own) > 1
    if not is_whole or listing.numbers == before.numbers:
        return False
    is_as_long = len(listing.numbers) >= len(before.numbers)
    return any(
        _TAKES_BACK.search(line) or (is_as_long and CORRECTS.search(line) and _NUMBER.search(line))
        for line in lines
    )


_TAKES_BACK = words(TAKES_BACK)
_NUMBER = re.compile(r"\d")


def _is_announced(lines: list[str], listing: Listing) -> bool:
    """Whether a list behind an explanation is said to be the plan after all."""
    if listing.form == "json" or (listing.form == "labeled" and FINAL_LABEL.search(listing.label)):
        return True
    last = _ARGUES.sub("", lines[-1]) if lines else ""
    return len(lines) > 1 and len(lines[-1]) < HEADING_CHARS and bool(REVISION.search(last))


_ARGUES = words(r"\b(?:so|thus|therefore)\b(?!.*[:\uff1a]\W*\Z)")
"""Words that conclude of the plan; of a list they do so with a colon."""


_DENIES = words(r"(?:\b(?:not|never|cannot|nicht|kein\w*)\b|n['\u2019]t\b)[^.,;]{0,40}\Z")


def chosen(plans: list[PlanLists], answer: str) -> PlanLists | None:
    """The last plan, or of several options the one that is said to be meant."""
    last = plans[-1]
    options = [plan for plan in plans if plan.option]
    if options and last.option:
        if len({tuple(plan.numbers) for plan in plans}) == 1:
            return last
        said = [
            match[match.lastgroup or 0]
            for sentence in SENTENCES.split(answer)
            if not CONDITIONAL.search(sentence)
            for match in CHOICE.finditer(sentence)
            if not _DENIES.search(sentence, 0, match.start())
        ]
        ordinal = ORDINALS.get(said[-1].lower()) if said and len(plans) == 2 else None
        if ordinal is not None:
            return plans[ordinal]
        named = [plan for plan in plans if said and plan.option == said[-1].lower()]
        return named[-1] if named else (last if len(plans) == 1 else None)
    return last
