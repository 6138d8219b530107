"""Reply text -> Plan, with the rule that matched, or a named failure.

`official` is the released code's rule: every `block with index N` of the whole reply, in order.
`steps`, the default, finds the lists of a reply (`reply_lists`), joins those that are parts of one
plan, and takes the last plan that is complete. It reads nothing where a careful reader would not:
a catalogue of the candidates, a refusal, thoughts without an answer, two plans and no choice.

Both drop numbers that no candidate has and report them. Neither raises on any text.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

from phyblock.domain import Plan
from phyblock.parsing.alike_lines import as_steps, as_unknown_steps
from phyblock.parsing.answer_form import FormProblem
from phyblock.parsing.answer_patterns import DANGLES
from phyblock.parsing.edits import edited
from phyblock.parsing.legend import with_numbers
from phyblock.parsing.listing import Listing
from phyblock.parsing.plan_choice import PlanLists, chosen, plans_of
from phyblock.parsing.plan_doubt import is_doubtful
from phyblock.parsing.plan_patterns import (
    AGAIN,
    DOWNWARD,
    NOT_REVERSED,
    OFFER,
    SUPPOSED,
)
from phyblock.parsing.plan_rank import LAST, MOVES, rank_of
from phyblock.parsing.reply_lists import reply_lists
from phyblock.parsing.speech import BACKWARD, REFUSAL
from phyblock.parsing.text_forms import BOX, TAG, answer_of, plain_line
from phyblock.types import PlanParser

__all__ = ["PLAN_PROBLEMS", "ParsedPlan", "PlanProblem", "kept_plan", "parse_plan"]

PlanProblem = Literal[
    "empty",
    "thoughts_only",
    "refusal",
    "catalogue",
    "two_plans",
    "ambiguous",
    "no_plan",
    FormProblem,
]
PLAN_PROBLEMS: tuple[PlanProblem, ...] = get_args(PlanProblem)


@dataclass(frozen=True)
class ParsedPlan:
    """What was read out of a reply.

    `rule` names the form of the list that was read, None when nothing could be read (a parse
    failure): then `problem` says why. `dropped` are the numbers that were read but name no
    candidate, in order.
    """

    plan: Plan
    rule: str | None
    dropped: tuple[int, ...] = ()
    problem: PlanProblem | None = None


def parse_plan(text: str, n_candidates: int, parser: PlanParser = "steps") -> ParsedPlan:
    """Read the plan out of a reply to a question with candidates 1..n_candidates."""
    read = _official(text) if parser == "official" else _steps(text)
    if isinstance(read, str):
        return ParsedPlan(Plan(), None, problem=read)
    return kept_plan(*read, n_candidates)


def kept_plan(rule: str, numbers: Sequence[int], n_candidates: int) -> ParsedPlan:
    """The plan that numbers read by a rule are; those that no candidate has are dropped."""
    kept = tuple(n for n in numbers if 1 <= n <= n_candidates)
    return ParsedPlan(Plan(kept), rule, tuple(n for n in numbers if not 1 <= n <= n_candidates))


_Read = tuple[str, Sequence[int]] | PlanProblem

# Longer runs of digits are no block numbers, and int() refuses thousands of digits.
_OFFICIAL = re.compile(r"block with index (\d{1,6})(?!\d)")


def _official(text: str) -> _Read:
    numbers = [int(match.group(1)) for match in _OFFICIAL.finditer(text)]
    return ("block_with_index", numbers) if numbers else "no_plan" if text.strip() else "empty"


def _steps(text: str) -> _Read:
    answer = answer_of(text)
    if answer is None:
        return "thoughts_only"
    frames = [(frame.start(), "tag", frame["value"]) for frame in TAG.finditer(answer)]
    frames += [(frame.start(), "boxed", frame["value"]) for frame in BOX.finditer(answer)]
    for _, name, held in sorted(frames)[: -_MOST_FRAMES - 1 : -1]:
        read = _choose(held if "\n" in held.strip() else f"Answer: {held.strip()}")
        if not isinstance(read, str):
            return name, read[1]
    if not answer:
        return "empty"
    read = _choose(answer)
    for other_way in _OTHER_WAYS.get(read, ()) if isinstance(read, str) else ():
        rewritten = other_way(answer)
        other = _choose(rewritten) if rewritten else "no_plan"
        if not isinstance(other, str):
            return other
    return read


_MOST_FRAMES = 8
_OTHER_WAYS: dict[str, tuple[Callable[[str], str | None], ...]] = {
    "no_plan": (with_numbers, as_steps),
    "catalogue": (with_numbers,),
    "ambiguous": (as_unknown_steps,),
}
"""How a reply is rewritten to be read again where nothing was read."""


def _choose(answer: str) -> _Read:
    """The plan among the lists of an answer."""
    reply = reply_lists(answer)
    found, below = reply.lists, reply.below
    named = [listing for listing in found if listing.numbers]
    ranks = [rank_of(listing) for listing in named]
    best = max(ranks, default=0)
    if not best:
        if REFUSAL.search(answer):
            return "refusal"
        return (
            "catalogue" if named or any(f.form in ("json", "table") for f in found) else "no_plan"
        )
    if REFUSAL.search(answer) and (best == LAST or _is_declined(named)):
        return "refusal"
    is_begun = named[-1].form == "layers" and DANGLES.search(answer.rstrip())
    if best == LAST and (is_begun or OFFER.search(answer)):
        return "no_plan"
    plans = plans_of(named, ranks, best, found)
    plans[-1].below = below
    plan = chosen(plans, answer)
    if plan is None:
        return "two_plans"
    is_cut_off = _is_cut_off(answer, found)
    if plan is plans[-1] and is_cut_off:
        firm = plans if len(plans) > 1 else [*plans_of(named, ranks, MOVES, found), plan]
        plan = firm[-2] if len(firm) > 1 else plan
    after = [] if plan.option else found[found.index(plan.lists[-1]) + 1 :]
    if is_cut_off:
        after = after[:-1]
    before = found[: found.index(plan.lists[0])]
    end = plan.lists[-1].last_line
    numbers, edits = edited(plan.numbers, _behind(reply.lines, end))
    after = [listing for listing in after if listing.first_line - end not in edits]
    edit_lines = {plain_line(reply.lines[end + at]).strip() for at in edits}
    for listing in after:
        listing.above = [line for line in listing.above if line not in edit_lines]
    beside = [line for line in plan.below if line not in edit_lines]
    if numbers is None or plan.is_unclear or is_doubtful(plan.lists, beside, before, after):
        return "ambiguous"
    form = plan.lists[-1].form
    if any(map(AGAIN.search, below)):
        numbers = numbers * 2
    is_reversed = _is_reversed(plan, form) and all(b.numbers[::-1] != numbers for b in before)
    return form, numbers[::-1] if is_reversed else numbers


def _behind(lines: Sequence[str], end: int) -> list[str]:
    """What stands behind the last line of a plan, and in that line behind its first sentence."""
    rest = _SENTENCE_END.split(lines[end], maxsplit=1)[1:] if end < len(lines) else []
    return [rest[0] if rest else "", *lines[end + 1 :]]


_SENTENCE_END = re.compile(r"(?<=[\d)\]])[.;]\s{1,4}(?=[^\W\d])")


def _is_cut_off(answer: str, found: list[Listing]) -> bool:
    """Whether the text ends within its last list."""
    unclosed = answer.count("{") > answer.count("}") or answer.count("```") % 2 == 1
    return unclosed or (not found[-1].ends_named)


def _is_declined(named: list[Listing]) -> bool:
    """Whether a refusal says of its list that it is only how one might look."""
    return any(SUPPOSED.search(line) for listing in named for line in listing.above[-2:])


def _is_reversed(plan: PlanLists, form: str) -> bool:
    """Whether the reply says that its list is to be built from its end."""
    titles = [plan.title, *plan.lists[-1].above[-3:], plan.lists[-1].label]
    said = [*titles, *plan.below[:4]]
    if any(BACKWARD.search(line) and not NOT_REVERSED.search(line) for line in said):
        return True
    return form in ("labeled", "chain", "marked") and bool(DOWNWARD.search(" ".join(titles)))
