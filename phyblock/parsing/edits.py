"""What sentences behind a plan change in it: "Step 2 should be 5, not 7", "swap steps 1 and 2"."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Sequence

from phyblock.parsing.line_patterns import STEP_WORD
from phyblock.parsing.speech import SUPPOSES, words
from phyblock.parsing.text_forms import SENTENCES

__all__ = ["edited"]

_Numbers = list[int]
_Edit = Callable[[_Numbers, re.Match[str]], _Numbers | None]

_IF = words(
    r"\b(?:would|may|alternativ\w*|should you|in case|optional\w*|also|either|same|earlier"
    r"|previous(?:ly)?|first attempt)\b|\?|(?<!\w)['\u2018\u2019\"](?=\w)[^'\n]{0,20}\d"
)
"""What makes an edit one that is only thought of, or somebody else's."""
_STEP_LINE = words(r"\W{0,8}step\s?\d{1,2}\W{0,3}[:.=)\u2192-]")
_DIGITS = re.compile(r"\d{1,3}")
_EVERY = words(r"\b(?:all|both|every|each|wherever|always|everywhere)\b|\ds\b")

_THE = (
    r"(?:(?:the|block|blocks|index|candidate|number|with|all|both|every|each|cube|no\.|#|baustein"
    r"|stein|bloc|bloque|blocco|bloco|le|el|il|o|der|блок|积木)\s?){0,4}"
)
_NEW = rf"{_THE}(?P<new>\d{{1,3}})s?(?![\w])"
_OLD = rf"{_THE}(?P<old>\d{{1,3}})s?(?![\w])"
_STEP = (
    r"(?:(?P<last>the (?:last (?:one|step|block)|final (?:step|block)))"
    rf"|(?:in |to |of )?{STEP_WORD}\s?(?P<step>\d{{1,2}}))"
)
_AT_STEP = rf"{STEP_WORD}\s?(?P<step>\d{{1,2}})"
_IS = (
    r"(?:should be|must be|has to be|needs to be|should read|should use|is|:|=|->|\u2192|muss"
    r"|sollte|ist|d(?:oi|evrai)t être|deb(?:e|ería) ser|dev(?:e|rebbe|eria) (?:ser|essere)"
    r"|должен быть|应该?是)"
)
_NOT = rf"(?:,?\s(?:and )?(?:not|instead of|rather than)\s{_OLD})?"
_END = r"(?=\s?(?:[.,;!)。]|\Z|since|because|as\b|which|instead|sein\b|\u2013|\u2014|-))"
_NEEDLESS = (
    r"(?:not (?:needed|necessary|required|there)|unnecessary|superfluous|too many|redundant)"
)


def _set_step(numbers: _Numbers, edit: re.Match[str]) -> _Numbers | None:
    k = len(numbers) if edit["last"] else int(edit["step"])
    said = {int(edit[name]) for name in ("old", "new") if edit[name]}
    if not 1 <= k <= len(numbers) or (edit["old"] and numbers[k - 1] not in said):
        return None
    return [*numbers[: k - 1], int(edit["new"]), *numbers[k:]]


def _replace(numbers: _Numbers, edit: re.Match[str]) -> _Numbers | None:
    old, new = int(edit["old"]), int(edit["new"])
    k = int(edit.groupdict().get("step") or 0)
    if k:
        is_there = k <= len(numbers) and numbers[k - 1] == old
        return [*numbers[: k - 1], new, *numbers[k:]] if is_there else None
    if old not in numbers or (numbers.count(old) > 1 and not _EVERY.search(edit[0])):
        return None
    return [new if number == old else number for number in numbers]


def _swap(numbers: _Numbers, edit: re.Match[str]) -> _Numbers | None:
    a, b = sorted((int(edit["a"]), int(edit["b"])))
    if not 1 <= a < b <= len(numbers):
        return None
    between = numbers[a : b - 1]
    return [*numbers[: a - 1], numbers[b - 1], *between, numbers[a - 1], *numbers[b:]]


def _remove(numbers: _Numbers, edit: re.Match[str]) -> _Numbers | None:
    k = len(numbers) if edit["last"] else int(edit["step"])
    return [*numbers[: k - 1], *numbers[k:]] if 1 <= k <= len(numbers) else None


def _insert(numbers: _Numbers, edit: re.Match[str]) -> _Numbers | None:
    k = int(edit["step"]) - (edit["where"].lower() == "before")
    return [*numbers[:k], int(edit["new"]), *numbers[k:]] if 0 <= k <= len(numbers) else None


def _append(numbers: _Numbers, edit: re.Match[str]) -> _Numbers | None:
    return [*numbers, int(edit["new"])] if int(edit["step"]) == len(numbers) + 1 else None


_WAYS: tuple[tuple[str, _Edit], ...] = (
    (
        rf"\b(?:forgot|missed|overlooked|missing|left out)\b[^\d\n]{{0,60}}\b{_AT_STEP}"
        rf"\s?[:=]\s[^\d\n]{{0,30}}{_NEW}{_END}",
        _append,
    ),
    (rf"\b{_STEP}\s(?:is|was)\s{_NEEDLESS}", _remove),
    (
        rf"\b{_STEP}[^\d\n.;]{{0,30}}?\s?{_IS}\s(?:[^\d\n.;]{{0,12}}\s)?{_NEW}{_NOT}{_END}",
        _set_step,
    ),
    (rf"\b(?:meant|mean)\s{_NEW}{_NOT}\s(?:in|for|at)\s{_STEP}", _set_step),
    (
        rf"\b(?:replace|change|substitute|exchange)\s{_OLD}(?:\s(?:in|at|of)\s{_AT_STEP})?"
        rf"\s(?:by|with|to|for|into)\s{_NEW}{_END}",
        _replace,
    ),
    (
        rf"\b(?:wherever|everywhere|where)\b[^\d\n]{{1,40}}?{_OLD}[^\d\n]{{1,40}}?{_NEW}{_END}",
        _replace,
    ),
    (
        r"\b(?:swap|switch|exchange)\s(?:the\s)?steps?\s?(?P<a>\d{1,2})\s(?:and|with|&)"
        r"\s(?:step\s)?(?P<b>\d{1,2})",
        _swap,
    ),
    (
        r"\bsteps?\s(?P<a>\d{1,2})\s(?:and|&)\s(?:step\s)?(?P<b>\d{1,2})\s(?:must|should"
        r"|ha(?:ve|s) to|needs? to|are to)\s(?:be\s)?(?:swap|switch|exchang)\w*",
        _swap,
    ),
    (rf"\b(?:remove|delete|skip|drop|ignore|omit|leave out|cut)\s(?:the )?{_STEP}", _remove),
    (
        rf"\b(?:insert|add|put)\s(?:(?:another|a|one|more|second|further)\s){{0,3}}{_NEW}"
        rf"[^\d\n.;]{{0,30}}?\b(?P<where>before|after|behind)\s{_AT_STEP}",
        _insert,
    ),
    (rf"(?<!step )\b{_OLD}\s(?:should be|must be|has to be|needs to be)\s{_NEW}{_END}", _replace),
    (rf"\b(?:use|take|place)\s{_NEW}\s(?:instead of|rather than|not)\s{_OLD}{_END}", _replace),
    (rf"\b{_OLD}\s(?:is |being )?replaced (?:by|with)\s{_NEW}{_END}", _replace),
    (
        rf"\b(?:is|it['\u2019]s|be|i\.e\.|was)\s{_NEW}(?:,? not|,? rather than|,? instead of)"
        rf"\s{_OLD}{_END}",
        _replace,
    ),
)
_EDITS = tuple((re.compile(pattern, re.IGNORECASE), edit) for pattern, edit in _WAYS)


def edited(numbers: Sequence[int], lines: Sequence[str]) -> tuple[list[int] | None, set[int]]:
    """A plan after the edits in lines behind it, and which lines those are; None: one does not fit.

    A sentence is an edit only if it names no other block than those that it puts in or takes out.
    """
    plan: _Numbers | None = list(numbers)
    read: set[int] = set()
    for at, line in enumerate(lines):
        for sentence in () if _STEP_LINE.match(line) else SENTENCES.split(line):
            if not re.search(r"\d", sentence) or _IF.search(sentence) or SUPPOSES.search(sentence):
                continue
            found = next(((m, edit) for p, edit in _EDITS if (m := p.search(sentence))), None)
            if found is None:
                continue
            match, edit = found
            after = edit(plan, match) if plan is not None else None
            beside = sentence[: match.start()] + sentence[match.end() :]
            if _named(beside) <= _named(match[0]) | _changed(plan or [], after or []):
                read.add(at)
                plan = after
    return plan, read


def _named(text: str) -> set[int]:
    return set(map(int, _DIGITS.findall(text)))


def _changed(before: _Numbers, after: _Numbers) -> set[int]:
    """The blocks that an edit takes out, puts in or exchanges."""
    if len(before) == len(after):
        return {n for old, new in zip(before, after, strict=True) if old != new for n in (old, new)}
    old, new = Counter(before), Counter(after)
    return {*(old - new), *(new - old)}
