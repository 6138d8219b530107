"""`phyblock scenes complete`: a data set from scenes that say no more than where blocks are."""

from __future__ import annotations

import shlex
from pathlib import Path

import click

from phyblock.cli.console import shown_path
from phyblock.cli.options import UserPath
from phyblock.errors import DataError, Problem
from phyblock.making.checks import find_duplicates, find_orphans
from phyblock.making.cli.working import jobs_option, tracked
from phyblock.making.scenes.completing import Completed, ReadScene, complete, palette_of, read_given
from phyblock.making.scenes.files import check_folder, completed_card, open_writer
from phyblock.making.workers import open_workers
from phyblock.text import counted

__all__ = ["command"]


@click.command("complete")
@click.argument("data", metavar="FILE_OR_FOLDER", type=UserPath())
@jobs_option
@click.option(
    *("--out", "-o"),
    type=UserPath(),
    metavar="DIR",
    help="Folder to write.  [default: NAME-set here]",
)
def command(data: Path, jobs: int, out: Path | None) -> None:
    """Make a data set from scenes that give type, color, position and euler of their blocks.

    FILE_OR_FOLDER is YAML, JSON, or JSON with a scene a line, or a folder of such files.
    Derives dependencies from contacts, and layers and levels from those; draws candidates unless
    they are given. Refuses scenes whose blocks overlap, float or fall. Never writes over what was
    given.
    """
    given = read_given(data)
    folder = out or Path(f"{data.resolve().stem}-set")
    check_folder(folder)
    problems: list[Problem] = []
    done: list[Completed] = []
    with open_workers(min(jobs, len(given)), None) as workers:
        for one in tracked(workers.map(_completed, given), len(given), "Completing"):
            if isinstance(one, Completed):
                done.append(one)
            else:
                problems += one
    if problems:
        raise DataError(problems)
    scenes = [one.scene for one in done]
    palette = palette_of(scenes)
    made_by = f"phyblock scenes complete {shlex.quote(data.name)} --out {shlex.quote(folder.name)}"
    with open_writer(folder, palette) as writer:
        for one in done:
            writer.add(one.scene, one.offered)
        writer.finish(completed_card(folder.name, len(done), made_by))
    for one in done:
        for note in one.notes:
            click.echo(f"note: scene {one.scene.id}: {note}")
    for finding in (*find_duplicates(scenes), *find_orphans(scenes)):
        sentence = f"{finding.field} {finding.message}".strip()
        click.echo(f"note: scene {finding.scene}: {sentence}")
    click.echo(f"{counted(len(done), 'scene')} completed: {shown_path(folder)}")
    here = str(folder) if folder.is_absolute() else f"./{folder}"
    click.echo(f"Next: phyblock run quick --set dataset.path={shlex.quote(here)}")


def _completed(read: ReadScene) -> Completed | tuple[Problem, ...]:
    try:
        return complete(read)
    except DataError as error:
        return tuple(error.problems)
