"""`phyblock questions generate`: questions from a seed."""

from __future__ import annotations

from pathlib import Path

import click
from rich.progress import Progress, TaskID

from phyblock.cli.console import make_console, shown_path
from phyblock.cli.options import UserPath
from phyblock.data import read_data_set
from phyblock.domain import SUBTASKS, Subtask
from phyblock.making.cli.question_sets import data_option
from phyblock.making.cli.subtasks_option import subtasks_option
from phyblock.making.cli.working import jobs_option, ray_option, seed_option, tell_simulators
from phyblock.making.questions.files import check_place, write_questions
from phyblock.making.questions.production import PER_SUBTASK, make_questions
from phyblock.making.workers import open_workers
from phyblock.text import counted

__all__ = ["command"]


@click.command("generate")
@data_option
@subtasks_option
@click.option(
    "--per-subtask",
    type=click.IntRange(1),
    metavar="N",
    help="Questions of each subtask; by default 150, of ordering and affordance 50.",
)
@seed_option("Another seed gives other questions.")
@jobs_option
@ray_option
@click.option("--out", type=UserPath(), required=True, metavar="DIR", help="Folder to write.")
@click.option("--replace", is_flag=True, help="Replace questions that are in the folder.")
def command(
    data: str,
    subtasks: tuple[Subtask, ...],
    per_subtask: int | None,
    seed: int,
    jobs: int,
    ray_address: str | None,
    out: Path,
    replace: bool,
) -> None:
    """Make questions, each with an answer that is derived, and their data card.

    The same scenes, subtasks, numbers and seed give the same files with the same physics engine,
    on any Python, any number of processes or a cluster.
    """
    check_place(out, replace)
    wanted = {subtask: per_subtask or PER_SUBTASK[subtask] for subtask in subtasks}
    read = read_data_set(data)
    scenes = [task.scene for task in read.tasks]
    console = make_console(stderr=True)
    with (
        open_workers(jobs, ray_address) as workers,
        Progress(console=console, transient=True, disable=not console.is_terminal) as progress,
    ):
        bars: dict[Subtask, TaskID] = {}

        def report(subtask: Subtask, total: int) -> None:
            if subtask not in bars:
                if not console.is_terminal:
                    click.echo(f"drafting {subtask} from {counted(total, 'scene')}", err=True)
                bars[subtask] = progress.add_task(f"drafting {subtask}", total=total)
            progress.advance(bars[subtask])

        questions = list(make_questions(scenes, wanted, seed, workers, report))
    made_by = f"phyblock questions generate --data {data} --seed {seed} --out {out.name}"
    if len(subtasks) < len(SUBTASKS):
        made_by += f" --subtasks {','.join(subtasks)}"
    if per_subtask is not None:
        made_by += f" --per-subtask {per_subtask}"
    originals = {scene.id: scene for scene in scenes}
    write_questions(out, questions, originals, read.name, made_by)
    outcome = f"{counted(len(questions), 'question')} in {counted(len(subtasks), 'subtask')}"
    click.echo(f"{outcome}: {shown_path(out)}")
    tell_simulators()
