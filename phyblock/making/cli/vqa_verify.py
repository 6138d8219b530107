"""`phyblock questions verify`: every answer derived again."""

from __future__ import annotations

from collections import Counter

import click

from phyblock.cli.console import make_console, print_rows
from phyblock.domain import SUBTASK_NAMES, SUBTASKS
from phyblock.making.cli.question_sets import data_option, questions_argument, read_question_set
from phyblock.making.cli.working import jobs_option, ray_option, tracked
from phyblock.making.questions.production import verify_questions
from phyblock.making.scenes.files import check_sums
from phyblock.making.workers import open_workers
from phyblock.text import counted

__all__ = ["command"]


@click.command("verify")
@questions_argument
@data_option
@jobs_option
@ray_option
def command(questions: str, data: str, jobs: int, ray_address: str | None) -> None:
    """Derive every answer of PATH again, from scene, pictures and simulator.

    PATH is a folder with questions.jsonl or a bundled set, by default the built-in phyblock-vqa.
    Exits with 1 when an answer differs, or a question is not fair.
    """
    read = read_question_set(questions, data)
    asked = [task.question for task in read.tasks]
    good: Counter[str] = Counter()
    failures: list[str] = []
    with open_workers(jobs, ray_address) as workers:
        verified = verify_questions(asked, workers)
        for question, problem in tracked(verified, len(asked), "Verifying", "questions"):
            good[question.subtask] += problem is None
            if problem is not None:
                failures.append(f"{question.id}: {problem}")
    files, changed = check_sums(read.root)
    failures += map(str, changed)
    rows: list[tuple[str, ...]] = [
        (s, SUBTASK_NAMES[s], str(good[s]), str(sum(q.subtask == s for q in asked)))
        for s in SUBTASKS
        if any(q.subtask == s for q in asked)
    ]
    rows.append(("", "checksums", str(files - len(changed)), str(files)))
    console = make_console()
    print_rows(console, ("subtask", "", "derived again", "of"), rows, numbers=2)
    for failure in sorted(failures):
        click.echo(f"failed: {failure}", err=True)
    verdict = counted(len(failures), "failure") if failures else "all answers derived again"
    summary = f"{questions}: {sum(good.values())} of {counted(len(asked), 'question')}, {verdict}"
    console.print(summary, markup=False, soft_wrap=True)
    if failures:
        raise click.exceptions.Exit(1)
