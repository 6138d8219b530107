"""Reply text -> Plan, with the rule that matched, or a named failure.

`official` is the released code's rule: every `block with index N` of the whole reply, in order.
`steps`, the default, finds the lists of a reply (`listing`), joins those that are parts of one
plan, and takes the last plan that is complete. It reads nothing where a careful reader would not:
a catalogue of the candidates, a refusal, thoughts without an answer, two plans and no choice.

Both drop numbers that no candidate has and report them. Neither raises on any text.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, get_args

from phyblock.domain import Plan
from phyblock.parsing.listing import Listing, listings
from phyblock.parsing.text_forms import BACKWARD, answer_of
from phyblock.words import PlanParser

__all__ = ["PLAN_PROBLEMS", "ParsedPlan", "PlanProblem", "parse_plan"]

PlanProblem = Literal["empty", "thoughts_only", "refusal", "catalogue", "two_plans", "no_plan"]
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
    rule, numbers = read
    kept = tuple(n for n in numbers if 1 <= n <= n_candidates)
    return ParsedPlan(Plan(kept), rule, tuple(n for n in numbers if not 1 <= n <= n_candidates))


_Read = tuple[str, Sequence[int]] | PlanProblem

# Longer runs of digits are no block numbers, and int() refuses thousands of digits.
_OFFICIAL = re.compile(r"block with index (\d{1,6})(?!\d)")


def _official(text: str) -> _Read:
    numbers = [int(match.group(1)) for match in _OFFICIAL.finditer(text)]
    return ("block_with_index", numbers) if numbers else "no_plan" if text.strip() else "empty"


_FRAME = re.compile(
    r"<(?:final_)?answer>(?P<tag>.{1,20000}?)(?:</(?:final_)?answer>|\Z)"
    r"|\\boxed\s{0,2}\{(?P<boxed>(?:[^{}]|\{[^{}]{0,200}\}){1,4000})\}",
    re.IGNORECASE | re.DOTALL,
)


def _steps(text: str) -> _Read:
    answer = answer_of(text)
    if answer is None:
        return "thoughts_only"
    for frame in reversed(list(_FRAME.finditer(answer))[-_MOST_FRAMES:]):
        name = frame.lastgroup or "tag"
        read = _choose(
            f"Answer: {frame[name].strip()}" if "\n" not in frame[name].strip() else frame[name]
        )
        if not isinstance(read, str):
            return name, read[1]
    return _choose(answer) if answer else "empty"


_MOST_FRAMES = 8


@dataclass
class _Plan:
    """Lists that are one plan."""

    lists: list[Listing]
    title: str
    option: str = ""
    explained: bool = False
    below: list[str] = field(default_factory=list)

    @property
    def numbers(self) -> list[int]:
        return [number for listing in self.lists for number in listing.numbers]


_PLAN_WORD = re.compile(
    r"order|sequence|plan\b|assembl|build|\bsteps?\b|instruction|answer|solution|\bmoves?\b"
    r"|placement|construct|result"
    r"|reihenfolge|anleitung|antwort|schritt|aufbau|ordre|étapes|réponse|orden|pasos|respuesta"
    r"|secuencia|ordine"
    r"|bottom[- ](?:to|up)|from the (?:bottom|ground)|von unten|从下到上|порядок|план|ответ|顺序|步骤|答案"
    r"|计划|方案|顺|序列|手順|順序|순서",
    re.IGNORECASE,
)
_CATALOGUE_WORD = re.compile(
    r"dictionary|catalog|required|needed|\bselect|candidate|available|inventory|\bused\b|indices"
    r"|identif|distractor"
    r"|unused|legend|analysis|possible|not needed|leftover|remaining|options|extra|benötigt"
    r"|verfügbar|übrig|nécessaires"
    r"|necesarios|需要|可用|候选|清单|未使用|多余|剩余",
    re.IGNORECASE,
)
_FINAL_LABEL = re.compile(
    r"(?:final|answer|plan|order|sequence|antwort|reihenfolge|respuesta|réponse|ответ|答案|顺序"
    r"|步骤)\W*\Z",
    re.IGNORECASE,
)
_EXAMPLE = re.compile(
    r"(?:\bexample\b|\be\.g\.|for instance|\bsample (?:output|answer|plan)|beispiel|\bejemplo"
    r"|\bexemple|例如|示例|例)[^.!?。]{0,40}\Z",
    re.IGNORECASE,
)
_NOT_MEANT = re.compile(
    r"(?:\b(?:wrong|incorrect|invalid|bad|mistaken|rejected|falsch\w{0,2})\b[^.!?]{0,40}|^\W*(?:if"
    r"|unless|falls|wenn)\b[^.!?]{0,80})[:：]\W*\Z",
    re.IGNORECASE,
)
_EXPLANATION = re.compile(
    r"expla(?:in|nation)|rationale|reasoning|justif|verif|\bcheck|validat|\bwhy\b|\bnotes?\b"
    r"|remark|stability|überprüf|验证|检查|erklärung|begründung|解释|说明",
    re.IGNORECASE,
)
_OPTION = re.compile(
    r"\b(?P<kind>plan|option|alternative|variant|variante|solution|approach|version|possibility"
    r"|candidate plan|lösung|方案)"
    r"\s{0,2}#?(?P<name>[A-D]|[1-4]|one|two|three|I{1,3})\b",
    re.IGNORECASE,
)
_OR_ELSE = re.compile(
    r"^\W*(?:or|oder|ou|或者?|alternativ\w*|another (?:valid |possible )?\w+|or (?:else"
    r"|alternatively).{0,40})\b\W*",
    re.IGNORECASE,
)
_CHOICE = re.compile(
    r"\b(?:choose|chose|pick|select|prefer|recommend|go(?:ing)? with|went with|use|best|better"
    r"|final|submit|take|answer is"
    r"|wähle|nehme|entscheide|选择?|采用)[^.\n]{0,40}?(?:plan|option|alternative|variant|solution"
    r"|approach|version|lösung|方案)\s{0,2}#?(?P<a>[A-D]|[1-4]|one|two|three|I{1,3})\b"
    r"|\b(?:plan|option|alternative|variant|solution|approach|version|lösung)\s{0,2}#?(?P<b>[A-D]"
    r"|[1-4]|one|two|three|I{1,3})\b"
    r"\s(?:is|seems|looks|ist|wins)\s?(?:the |my |more |clearly |a )?(?:better|best|final|correct"
    r"|right|stable|preferred|chosen|answer|one|besser|richtig)",
    re.IGNORECASE,
)
_REVISION = re.compile(
    r"final|correct|revis|updat|actual|summar|complete|overall|optimi|improv|korrigier"
    r"|\b(?:instead|answer|again|better|so|thus|therefore|wait|output)\b",
    re.IGNORECASE,
)
_PART = re.compile(
    r"structure|layer|level|\b(?:left|right|cent(?:er|re)|middle|upper|lower|bottom|top|base|part"
    r"|section|component|side"
    r"|tower|building|house|second|third|next|then|phase|stage|step)\b|\bstep\s?\d|schicht|ebene"
    r"|teil|turm|层|部分",
    re.IGNORECASE,
)
_HEADING_CHARS = 80
_REFUSAL = re.compile(
    r"\bI(?:['\u2019]m| am) (?:sorry|unable|not able|afraid)|\bI (?:cannot|can['\u2019]?t|could not"
    r"|won['\u2019]t|am not able)"
    r"|\b(?:cannot|can['\u2019]t|not possible to|impossible to|unable to) (?:determine|give|provide"
    r"|build|produce|see|view|make|create|identify|plan|be built)"
    r"|as an ai|please (?:provide|send|upload|share)|(?:is|are) not visible|need to see"
    r"|no (?:valid )?plan\b|ich kann (?:das |die |den |leider )?(?:\w+ )?(?:nicht|kein)|leider|无法"
    r"|抱歉|不能确定|lo siento|désolé|не могу",
    re.IGNORECASE,
)
_AGAIN = re.compile(
    r"\brepeat (?:the |this |these )?(?:above |same |whole )?(?:assembly |building )?(?:order|steps"
    r"|sequence|plan|instructions)\b"
    r"[^.\n]{0,30}\b(?:for|to build) (?:the )?(?:second|other)\b",
    re.IGNORECASE,
)
_NOT_REVERSED = re.compile(
    r"\b(?:not|never|don't|do not|isn't|no need|take (?:it|them) apart|dis\w+|undo"
    r"|remov\w+)\b[^.\n]{0,40}revers",
    re.IGNORECASE,
)
_DOWNWARD = re.compile(
    r"top[- ](?:to|down)[- ]?(?:bottom)?\b|von oben nach unten|从上到下|de haut en bas|de arriba (?:a"
    r"|hacia) abajo",
    re.IGNORECASE,
)


def _choose(answer: str) -> _Read:
    """The plan among the lists of an answer."""
    found, below = listings(answer)
    named = [listing for listing in found if listing.numbers]
    ranks = [_rank(listing) for listing in named]
    best = max(ranks, default=0)
    if not best:
        if _REFUSAL.search(answer):
            return "refusal"
        return (
            "catalogue" if named or any(f.form in ("json", "table") for f in found) else "no_plan"
        )
    if _REFUSAL.search(answer) and (best == _LAST or _is_declined(answer, named)):
        return "refusal"
    plans = _plans(named, ranks, best, found)
    plans[-1].below = below
    plan = _chosen(plans, answer)
    if plan is None:
        return "two_plans"
    if plan is plans[-1] and _is_cut_off(answer, found, below):
        firm = plans if len(plans) > 1 else [*_plans(named, ranks, _MOVES, found), plan]
        plan = firm[-2] if len(firm) > 1 else plan
    form = plan.lists[-1].form
    numbers = plan.numbers * (2 if any(map(_AGAIN.search, below)) else 1)
    return form, numbers[::-1] if _is_reversed(plan, form) else numbers


def _rank(listing: Listing) -> int:
    """How surely a list is a plan, by its form, its label and the heading above it; 0 is not at all."""
    heading = "" if listing.heading.endswith((".", "。")) else listing.heading
    if listing.above and (
        _EXAMPLE.search(listing.above[-1]) or _NOT_MEANT.search(listing.above[-1])
    ):
        return _NO
    if listing.form == "numbers":
        is_list = len(listing.numbers) > 1 and (not heading or _PLAN_WORD.search(heading))
        return _LAST if is_list else _NO
    is_catalogue = _names_catalogue(heading)
    if listing.form == "labeled":
        return _rank_of_label(listing, heading, is_catalogue=is_catalogue)
    if listing.form in ("json", "table") or (listing.form == "steps" and listing.n_moves):
        return _ASKED
    if listing.form == "steps":
        return _MOVES
    if is_catalogue or listing.form == "sentences":
        return _LAST if listing.n_moves and not listing.leaves else _NO
    if listing.is_firm:
        is_final = bool(_REVISION.search(heading))
        return _ASKED if is_final else _MOVES if listing.form == "numbered" else _MARKED
    if listing.own == listing.numbers and len(listing.own) > 2:
        return _NO
    return (
        _LAST
        if _PLAN_WORD.search(heading) or listing.form in ("numbered", "chain") or not heading
        else _NO
    )


_NO, _LAST, _MARKED, _MOVES, _ASKED = range(5)


def _rank_of_label(listing: Listing, heading: str, *, is_catalogue: bool) -> int:
    """The rank of numbers that stand behind a label."""
    label, many = listing.label, len(listing.numbers) > 1
    if (
        _NOT_MEANT.search(f"{label}:")
        or _names_catalogue(label)
        or re.match(
            r"\W*(?:the )?(?:top|upper|roof)\b.*(?:bottom|base|ground|lower)\b(?! to)", label, re.I
        )
    ):
        return _DOWNWARD.search(label) is not None and _MARKED or _NO
    if _FINAL_LABEL.search(label):
        return _ASKED if many or re.search("answer|final|plan", label, re.IGNORECASE) else _NO
    if (
        _PLAN_WORD.search(label)
        or _DOWNWARD.search(label)
        or (_PLAN_WORD.search(heading) and not is_catalogue)
    ):
        return _MARKED if many else _NO
    is_short = len(label) < _LABEL_CHARS and not _BLOCK_WORD.search(label)
    return _LAST if many and not is_catalogue and (is_short or _LAYERS.match(label)) else _NO


_LABEL_CHARS = 20
_BLOCK_WORD = re.compile("block|index|indices", re.IGNORECASE)
_LAYERS = re.compile(
    r"\W*(?:(?:the )?(?:bottom|ground|base|first)\b|(?:layer|level|ebene|schicht|层) ?1)",
    re.IGNORECASE,
)


def _names_catalogue(title: str) -> bool:
    return bool(_CATALOGUE_WORD.search(title)) and not _PLAN_WORD.search(title)


def _plans(named: list[Listing], ranks: list[int], best: int, found: list[Listing]) -> list[_Plan]:
    """The lists of the best rank as plans: parts joined, explanations left out."""
    plans: list[_Plan] = []
    passed: list[str] = []
    kept = {id(listing) for listing, rank in zip(named, ranks, strict=True) if rank == best}
    for listing in found:
        passed += listing.above
        if id(listing) not in kept:
            passed.append("")
            continue
        relation = _relation(passed, plans, listing)
        title = " ".join(passed[-2:])
        option = _OPTION.search(f"{title} {listing.label}")
        if relation == "part":
            plans[-1].lists.append(listing)
        elif relation == "explanation":
            plans[-1].explained = True
        elif relation != "skip":
            name = option["name"].lower() if option else ("or" if relation == "option" else "")
            plans.append(_Plan([listing], title, name))
        passed = []
    return plans


def _relation(passed: list[str], plans: list[_Plan], listing: Listing) -> str:
    """What a list is to the plan before it, by the lines between them."""
    lines = [line for line in passed if line] or (
        [listing.label] if listing.form == "labeled" else []
    )
    title = lines[0].strip() if len(lines) == 1 else ""
    if not plans:
        return "other"
    if any(_OPTION.search(line) or _OR_ELSE.match(line) for line in lines[-2:]):
        return "option"
    before = plans[-1].lists[-1]
    if listing.form == "labeled" and not any(passed):
        return "other"
    if len(lines) > 1 or len(title) > _HEADING_CHARS or _REVISION.search(title) or "" in passed:
        return "explanation" if any(_EXPLANATION.search(line) for line in lines[:1]) else "other"
    if _EXPLANATION.search(title):
        return "explanation"
    part = _PART.search(title) if title else before.numbers != listing.numbers
    if not (part and before.ends_named):
        return "other"
    return "skip" if plans[-1].explained else "part"


def _chosen(plans: list[_Plan], answer: str) -> _Plan | None:
    """The last plan, or of several options the one that is said to be meant."""
    last = plans[-1]
    options = [plan for plan in plans if plan.option]
    if options and last.option:
        if len({tuple(plan.numbers) for plan in plans}) == 1:
            return last
        chosen = [match["a"] or match["b"] for match in _CHOICE.finditer(answer)]
        named = [plan for plan in plans if chosen and plan.option == chosen[-1].lower()]
        return named[-1] if named else (last if len(plans) == 1 else None)
    return last


def _is_cut_off(answer: str, found: list[Listing], below: list[str]) -> bool:
    """Whether the text ends within its last list."""
    if below and found[-1].form != "steps":
        return False
    unclosed = answer.count("{") > answer.count("}") or answer.count("```") % 2 == 1
    return unclosed or (not found[-1].ends_named)


def _is_declined(answer: str, named: list[Listing]) -> bool:
    """Whether a refusal says of its list that it is only how one might look."""
    return any(
        re.search(
            r"would|could|generic|hypothetical|in general|typical|illustrat|placeholder|candidates",
            line,
            re.IGNORECASE,
        )
        for listing in named
        for line in listing.above[-2:]
    )


def _is_reversed(plan: _Plan, form: str) -> bool:
    """Whether the reply says that its list is to be built from its end."""
    said = [plan.title, *plan.lists[-1].above[-3:], plan.lists[-1].label, *plan.below[:4]]
    if any(BACKWARD.search(line) and not _NOT_REVERSED.search(line) for line in said):
        return True
    return form in ("labeled", "chain", "marked") and bool(
        _DOWNWARD.search(" ".join(said[:-4] or said))
    )
