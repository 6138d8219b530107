"""`phyblock vqa audit`: a question set held against shortcuts, and a sheet for a human check."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import click
from rich.console import Console

from phyblock.cli.console import counted, make_console, plain_table, shown_path
from phyblock.cli.paths import UserPath
from phyblock.domain import LETTERS, SUBTASK_NAMES, SUBTASKS, Question
from phyblock.files import make_folder, write_named
from phyblock.sim import PictureStyle
from phyblock.sim.question_pictures import question_png
from phyblock.tracks.vqa.opening import select_questions
from phyblock_making.cli.question_sets import (
    data_option,
    questions_argument,
    read_question_set,
    size_option,
)
from phyblock_making.cli.working import tracked
from phyblock_making.questions.letters import BALANCE
from phyblock_making.questions.sheet import sheet_html
from phyblock_making.questions.shortcuts import (
    GUESSABLE,
    SubtaskAudit,
    audit_questions,
    duplicates_of,
)

__all__ = ["command"]

_PER_SUBTASK = 5


@click.command("audit")
@questions_argument
@data_option
@click.option(
    "--sheet",
    type=UserPath(dir_okay=False),
    metavar="FILE",
    help="Write an HTML page for a human check: pictures, questions, answers behind a fold.",
)
@click.option(
    "--per-subtask",
    type=click.IntRange(1),
    default=_PER_SUBTASK,
    show_default=True,
    metavar="N",
    help="Questions of each subtask on the sheet, spread over the set.",
)
@size_option
@click.option(
    "--no-text-probe", is_flag=True, help="Leave out the classifier, which needs scikit-learn."
)
def command(
    questions: str,
    data: str,
    sheet: Path | None,
    per_subtask: int,
    size: int,
    no_text_probe: bool,
) -> None:
    """Audit the questions of PATH: what could be answered without looking, and what cannot be seen.

    PATH is a folder with questions.jsonl or a bundled set, by default the built-in phyblock-vqa.
    By subtask: how often each letter is right; what the most frequent answer and a classifier of
    the texts alone reach on questions they were not trained on; options that read alike and
    repeated questions; the least visible block that is named; how questions cluster by scene.
    The exit code is 0 whatever is found.
    """
    if sheet is not None:
        make_folder(sheet.parent)
    tasks = read_question_set(questions, data).tasks
    asked = [task.question for task in tasks]
    console = make_console()
    audits = list(
        tracked(
            audit_questions(asked, with_text_probe=not no_text_probe),
            len({question.subtask for question in asked}),
            "Auditing",
            "subtasks",
        )
    )
    _print_guessing(console, audits)
    _print_contents(console, audits)
    _print_findings(console, audits, asked)
    if sheet is not None:
        some = select_questions(tasks, SUBTASKS, range(1, 5), per_subtask, None)
        chosen = [task.question for task in some]
        draw = partial(question_png, style=PictureStyle(size))
        pieces = sheet_html(f"Questions of {questions}", chosen, draw)
        write_named(sheet, "".join(pieces))
        console.print(f"{counted(len(chosen), 'question')} in {shown_path(sheet)}", markup=False)


def _print_guessing(console: Console, audits: Sequence[SubtaskAudit]) -> None:
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


def _print_contents(console: Console, audits: Sequence[SubtaskAudit]) -> None:
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


def _print_findings(
    console: Console, audits: Sequence[SubtaskAudit], asked: Sequence[Question]
) -> None:
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
    for finding in findings:
        console.print(finding, style="red", markup=False, soft_wrap=True)
    verdict = counted(len(findings), "finding") if findings else "nothing to find fault with"
    console.print(f"{counted(len(asked), 'question')}, {verdict}", markup=False)


def _percent(share: float | None) -> str:
    return "" if share is None else f"{100 * share:.1f}"
