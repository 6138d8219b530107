"""`phyblock questions audit`: a question set held against shortcuts."""

from __future__ import annotations

import click

from phyblock.cli.console import make_console, print_rows
from phyblock.domain import LETTERS, SUBTASK_NAMES
from phyblock.making.cli.question_sets import data_option, questions_argument, read_question_set
from phyblock.making.cli.working import tracked
from phyblock.making.questions.audit import Probe, audit_questions
from phyblock.text import counted


@click.command("audit")
@questions_argument
@data_option
@click.option("--no-text-probe", is_flag=True, help="Leave out the text probe (scikit-learn).")
@click.option("--no-pictures", is_flag=True, help="Leave out the probe that looks at pictures.")
def command(questions: str, data: str, no_text_probe: bool, no_pictures: bool) -> None:
    """Audit the questions of PATH: could they be answered without understanding?

    PATH is a folder with questions.jsonl or a bundled set, by default the built-in phyblock-vqa.
    Shows by subtask how often each letter is right and the accuracy of three probes on questions
    about base scenes that they did not learn from: the most frequent answer, the texts alone, and
    simple features of the pictures that are options. Exits with 0, whatever it finds.
    """
    asked = [task.question for task in read_question_set(questions, data).tasks]
    subtasks = len({question.subtask for question in asked})
    audits = list(
        tracked(
            audit_questions(asked, with_texts=not no_text_probe, with_pictures=not no_pictures),
            subtasks,
            "Auditing",
            "subtasks",
        )
    )
    rows = [
        (
            one.subtask,
            SUBTASK_NAMES[one.subtask],
            str(one.n),
            str(one.base_scenes),
            *(f"{100 * one.letters[letter] / one.n:.0f}" for letter in LETTERS),
            f"{100 * one.chance:.0f}",
            *map(_shown, (one.majority, one.text, one.pictures)),
        )
        for one in audits
    ]
    console = make_console()
    headings = ("", "subtask", "n", "base scenes", *LETTERS)
    probes = ("chance", "majority", "texts", "pictures")
    print_rows(console, (*headings, *probes), rows, numbers=10)
    console.print(
        "Percent. A to D: how often the letter is right (ordering: comes first). Probes: accuracy "
        "with a 95 % interval.",
        style="dim",
    )
    findings = [finding for one in audits for finding in one.findings()]
    for finding in findings:
        console.print(finding, markup=False, soft_wrap=True)
    verdict = counted(len(findings), "finding") if findings else "no findings"
    console.print(f"{counted(len(asked), 'question')}, {verdict}", markup=False)


def _shown(probe: Probe | None) -> str:
    if probe is None:
        return "-"
    low, high = probe.interval
    return f"{100 * probe.accuracy:.0f} [{100 * low:.0f}, {100 * high:.0f}]"
