"""`phyblock vqa audit`: a question set held against shortcuts, and a sheet for a human check."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import click

from phyblock.cli.console import make_console, shown_path
from phyblock.cli.paths import UserPath
from phyblock.domain import SUBTASKS, Question
from phyblock.files import OutFolder, make_folder, write_named
from phyblock.making.attacks.attacks import all_attacks, attack
from phyblock.making.attacks.observed import Observed, observe_all
from phyblock.making.cli.question_sets import (
    data_option,
    questions_argument,
    read_question_set,
    read_unseen,
    size_option,
    unseen_data_option,
    unseen_option,
)
from phyblock.making.cli.vqa_attacks_view import (
    attack_findings,
    audit_json,
    cut_findings,
    print_attacks,
)
from phyblock.making.cli.vqa_audit_view import print_contents, print_findings, print_guessing
from phyblock.making.cli.working import jobs_option, tracked
from phyblock.making.questions.blind_picture import blind_png
from phyblock.making.questions.sheet import Draw, sheet_html
from phyblock.making.questions.shortcuts import SubtaskAudit, audit_questions
from phyblock.sim import PictureStyle
from phyblock.sim.question_pictures import question_png
from phyblock.text import counted
from phyblock.tracks.vqa.opening import select_questions

__all__ = ["command"]

_PER_SUBTASK = 5
_ANSWERS = "answers.csv"


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
    "--blind",
    type=UserPath(file_okay=False),
    metavar="DIR",
    help="Write each question of the sheet as a PNG without its answer; answers.csv has those.",
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
    "--no-text-probe", is_flag=True, help="Leave out the classifiers, which need scikit-learn."
)
@click.option("--no-pictures", is_flag=True, help="Leave out the attacks that look at pictures.")
@unseen_option
@unseen_data_option
@click.option(
    "--json", "table", type=UserPath(dir_okay=False), metavar="FILE", help="All figures as JSON."
)
@jobs_option
def command(
    questions: str,
    data: str,
    sheet: Path | None,
    blind: Path | None,
    per_subtask: int,
    size: int,
    no_text_probe: bool,
    no_pictures: bool,
    unseen: str | None,
    unseen_data: str | None,
    table: Path | None,
    jobs: int,
) -> None:
    """Audit the questions of PATH: what could be answered without looking, and what cannot be seen.

    PATH is a folder with questions.jsonl or a bundled set, by default the built-in phyblock-vqa.
    Shows by subtask: how often each letter is right; what the most frequent answer and a classifier
    of the texts alone reach on questions they were not trained on; options that read alike and
    repeated questions; the least visible block that is named; how questions cluster by scene. Then
    shows what attacks reach that look at pictures and know nothing of blocks, or only that what
    rests on a block goes with it, beside the aims of the built-in sets; and which pictures are cut
    open. Exits with 0, whatever it finds.
    """
    for out in (sheet, table):
        if out is not None:
            make_folder(out.parent)
    read = read_question_set(questions, data)
    other = read_unseen(unseen, unseen_data or data, read.root)
    some = select_questions(read.tasks, SUBTASKS, range(1, 5), per_subtask, None)
    chosen = [task.question for task in some]
    if blind is not None:
        OutFolder(blind).check([*map(_picture_name, chosen), _ANSWERS])
    console, asked = make_console(), [task.question for task in read.tasks]
    audits = _audits(asked, not no_text_probe)
    print_guessing(console, audits)
    print_contents(console, audits)
    looked = [Observed(one) for one in asked] if no_pictures else _looked_at(asked, jobs)
    attacks = all_attacks(other, with_texts=not no_text_probe)
    attacked = [row for one in attacks for row in attack(one, looked)]
    if attacked:
        print_attacks(console, attacked)
    print_findings(console, audits, asked, [*attack_findings(attacked), *cut_findings(looked)])
    if table is not None:
        write_named(table, audit_json(audits, looked, attacked))
        console.print(f"all figures in {shown_path(table)}", markup=False)
    draw = partial(question_png, style=PictureStyle(size))
    if sheet is not None:
        write_named(sheet, "".join(sheet_html(f"Questions of {questions}", chosen, draw)))
    if blind is not None:
        _write_blind(OutFolder(blind), chosen, draw)
    for place in (sheet, blind):
        if place is not None:
            told = f"{counted(len(chosen), 'question')} in {shown_path(place)}"
            console.print(told, markup=False)


def _audits(asked: Sequence[Question], with_texts: bool) -> list[SubtaskAudit]:
    subtasks = len({question.subtask for question in asked})
    audits = audit_questions(asked, with_text_probe=with_texts)
    return list(tracked(audits, subtasks, "Auditing", "subtasks"))


def _looked_at(asked: Sequence[Question], jobs: int) -> list[Observed]:
    observed = observe_all(asked, min(jobs, len(asked)))
    return list(tracked(observed, len(asked), "Looking", "questions"))


def _picture_name(question: Question) -> str:
    return f"{question.id}.png"


def _write_blind(folder: OutFolder, chosen: Sequence[Question], draw: Draw) -> None:
    for question in chosen:
        folder.write({_picture_name(question): blind_png(question, draw)})
    rows = [f"{question.id},{question.answer_letters}" for question in chosen]
    folder.write({_ANSWERS: "\n".join(("id,answer", *rows)) + "\n"})
