"""`phyblock questions reword`: a set in further wordings, which `phyblock run` can ask."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from pathlib import Path

import click

from phyblock.cli.console import make_console, shown_path
from phyblock.cli.options import UserPath
from phyblock.data import find_questions, read_data_set, read_questions
from phyblock.domain import Question
from phyblock.errors import DataError, Problem
from phyblock.making.cli.question_sets import data_option, questions_option
from phyblock.making.cli.working import jobs_option, seed_option, tracked
from phyblock.making.questions.files import check_place, write_questions
from phyblock.making.questions.production import verify_questions
from phyblock.making.questions.rewording import read_wordings, reword
from phyblock.making.workers import open_workers
from phyblock.text import counted

__all__ = ["command"]


@click.command("reword")
@click.argument("wordings", type=UserPath(), metavar="FILE")
@questions_option
@data_option
@click.option("--add", is_flag=True, help="Keep the questions of the set beside the new ones.")
@seed_option("Another seed draws other wordings.")
@jobs_option
@click.option("--out", type=UserPath(), required=True, metavar="DIR", help="Folder to write.")
@click.option("--replace", is_flag=True, help="Replace questions that are in the folder.")
def command(
    wordings: Path,
    questions: str,
    data: str,
    add: bool,
    seed: int,
    jobs: int,
    out: Path,
    replace: bool,
) -> None:
    """Ask questions of a set in the accepted wordings of FILE, as a set that a suite can name.

    FILE is what phyblock questions write wrote, after a person has read it. Asks each question that
    FILE has a wording for in one of them, under an id of its own. Derives its answer again; where
    that fails, leaves the question out and names it.
    """
    check_place(out, replace)
    further = read_wordings(wordings)
    scenes = read_data_set(data)
    read = read_questions(find_questions(questions), scenes)
    asked = [task.question for task in read.tasks]
    reworded = reword(asked, further, seed)
    if not reworded:
        stems = ", ".join(sorted({wording.stem for wording in further}))
        message = "holds no question of these kinds in a known wording"
        raise DataError(Problem(questions, message, found=stems))
    faults = _faults({question.id for question in asked}, list(reworded.values()), jobs)
    if len(faults) == len(reworded):
        raise DataError([Problem(name, fault) for name, fault in faults.items()])
    sound = {old: new for old, new in reworded.items() if new.id not in faults}
    made_by = f"phyblock questions reword {wordings.name} --questions {questions} --data {data}"
    made_by += f" --seed {seed} --out {out.name}" + (" --add" if add else "")
    originals = {task.scene.id: task.scene for task in scenes.tasks}
    write_questions(out, _merged(asked, sound, add), originals, scenes.name, made_by)
    for name, fault in faults.items():
        click.echo(f"left out: {name}: {fault}", err=True)
    beside = f" beside {counted(len(asked), 'question')} as before" if add else ""
    summary = f"{counted(len(sound), 'question')} in further wordings{beside}: {shown_path(out)}"
    make_console().print(summary, markup=False, soft_wrap=True)


def _faults(taken: Set[str], reworded: Sequence[Question], jobs: int) -> dict[str, str]:
    """Why reworded questions cannot be used, by id."""
    faults = {}
    with open_workers(jobs) as workers:
        verified = verify_questions(reworded, workers)
        for question, fault in tracked(verified, len(reworded), "Verifying", "questions"):
            if question.id in taken:
                fault = "the set holds a question of this name already"
            if fault is not None:
                faults[question.id] = fault
    return faults


def _merged(
    asked: Sequence[Question], reworded: Mapping[str, Question], add: bool
) -> list[Question]:
    """The reworded questions in the order of the set, each after the one it was where that stays.

    A choice of some questions, spread over the set, then holds of both.
    """
    merged: list[Question] = []
    for question in asked:
        merged += [question] if add else []
        merged += [reworded[question.id]] if question.id in reworded else []
    return merged
