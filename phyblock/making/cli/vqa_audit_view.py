"""The audit of a question set in the terminal: guessing, contents, findings."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console

from phyblock.cli.console import plain_table
from phyblock.domain import LETTERS, SUBTASK_NAMES, Question
from phyblock.making.questions.letters import BALANCE
from phyblock.making.questions.shortcuts import GUESSABLE, SubtaskAudit, duplicates_of
from phyblock.text import counted

__all__ = ["print_contents", "print_findings", "print_guessing"]


def print_guessing(console: Console, audits: Sequence[SubtaskAudit]) -> None:
    """How often each letter is right, and what guessing by frequencies and texts reaches."""
    rows = [
        (
            one.subtask,
            SUBTASK_NAMES[one.subtask],
            str(one.n),
            *(_letters(one)),
            *(_percent(value) for value in (one.chance, one.majority, one.text_only)),
        )
        for one in audits
    ]
    headings = ("", "subtask", "n", *LETTERS, "chance", "majority", "text only")
    console.print(plain_table(headings, rows, numbers=8))
    console.print(
        "Letters: share of questions where it is right [%]; of ordering, where its picture comes "
        "first. Guesses: accuracy [%] on questions about other base scenes than those learned "
        "from.",
        style="dim",
    )
    console.print()


def _letters(one: SubtaskAudit) -> list[str]:
    counts = {
        letter: sum(n for answer, n in one.letters.items() if answer[0] == letter)
        for letter in LETTERS
    }
    return [_percent(counts[letter] / one.n) for letter in LETTERS]


def print_contents(console: Console, audits: Sequence[SubtaskAudit]) -> None:
    """What the questions of each subtask are made of."""
    rows = [
        (
            one.subtask,
            str(one.values),
            str(len(one.ambiguous)),
            str(len(one.duplicates)),
            str(one.named),
            "" if one.least_seen is None else _percent(one.least_seen[0]),
            str(one.scenes),
            str(one.bases),
            str(one.most_of_a_scene),
        )
        for one in audits
    ]
    headings = (
        "",
        "answers",
        "alike",
        "repeats",
        "named",
        "least seen",
        "scenes",
        "base scenes",
        "most of one",
    )
    console.print(plain_table(headings, rows, numbers=8))
    console.print(
        "answers: different right answers; alike: options that read alike; named: blocks that "
        "words name, and the least that one of them shows of itself [%]; most of one: questions "
        "about the scene with most.",
        style="dim",
    )
    console.print()


def print_findings(
    console: Console,
    audits: Sequence[SubtaskAudit],
    asked: Sequence[Question],
    further: Sequence[str],
) -> None:
    """What is wrong with the set, `further` findings last."""
    low, high = (round(100 * bound) for bound in BALANCE)
    findings = []
    for one in audits:
        if not one.is_balanced:
            findings.append(f"{one.subtask}: a letter is right outside of {low} to {high} %")
        for name, reached in (("majority", one.majority), ("text only", one.text_only)):
            if reached is not None and reached > GUESSABLE:
                findings.append(f"{one.subtask}: {name} reaches {_percent(reached)} %")
        if one.hidden and one.least_seen is not None:
            findings.append(
                f"{one.subtask}: {counted(one.hidden, 'named block')} hardly to be seen, the least "
                f"in {one.least_seen[1]}"
            )
        findings += [f"{name}: options read alike" for name in one.ambiguous]
    findings += [f"{name}: repeats {first}" for name, first in duplicates_of(asked).items()]
    findings += further
    for finding in findings:
        console.print(finding, style="red", markup=False, soft_wrap=True)
    verdict = counted(len(findings), "finding") if findings else "nothing to find fault with"
    console.print(f"{counted(len(asked), 'question')}, {verdict}", markup=False)


def _percent(share: float | None) -> str:
    return "" if share is None else f"{100 * share:.1f}"
