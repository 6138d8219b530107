"""`phyblock episode`: one episode of a run, as text or as moving pictures."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import click

from phyblock.cli.console import make_console, print_view, shown_path
from phyblock.cli.paths import UserPath
from phyblock.data import AssemblyTask
from phyblock.errors import DataError, Problem, StoreError
from phyblock.files import write_named
from phyblock.records.files import RECORDS, newest_starts, run_records
from phyblock.records.manifest import MANIFEST, read_manifest
from phyblock.records.record import Record
from phyblock.run.plan import recorded_dataset
from phyblock.sim.film import episode_gif, episode_images, episode_sheet
from phyblock.sim.pictures import PictureStyle
from phyblock.tables.design import read_design
from phyblock.tables.track_report import EpisodeView
from phyblock.text import counted
from phyblock.tracks import kind_of, kinds
from phyblock.tracks.showing import as_recorded

__all__ = ["command"]

_SIZE_PX = 256
_NAMED = 5
"""Episodes that a message names when it is unclear which one is meant."""


@click.command("episode")
@click.argument("run", type=UserPath())
@click.argument("sample")
@click.option("--gif", type=UserPath(dir_okay=False), help="Animated GIF.")
@click.option("--sheet", type=UserPath(dir_okay=False), help="PNG of all steps.")
@click.option(
    "--size",
    type=click.IntRange(128, 1024),
    default=_SIZE_PX,
    show_default=True,
    help="Edge of each of a frame's three pictures [pixels].",
)
@click.option(
    "--data",
    type=UserPath(file_okay=False),
    help="Where the run's data set is now, if it was moved.",
)
def command(
    run: Path, sample: str, gif: Path | None, sheet: Path | None, size: int, data: Path | None
) -> None:
    """Show the episode SAMPLE of the folder RUN: every step, wrong ones too.

    SAMPLE is as in records.jsonl (TRACK/MODEL/SCENE/sSEED); a part of it will do where only one
    episode has it.
    """
    views = _views()
    record = _find(run, sample, views)
    view = views[record.track]
    console = make_console()
    print_view(console, view.table(record))
    if gif is None and sheet is None:
        return
    task = _task(run, record, data)
    steps = list(view.frames(record, task))
    images = episode_images(task.scene, task.candidates, steps, PictureStyle(size))
    for path, make in ((gif, episode_gif), (sheet, episode_sheet)):
        if path is not None:
            write_named(path, make(images))
            console.print(f"{counted(len(images), 'frame')} in {shown_path(path)}", markup=False)


def _views() -> dict[str, EpisodeView]:
    """How episodes are shown, by track."""
    views = {name: kind.report().episodes for name, kind in kinds().items()}
    return {name: view for name, view in views.items() if view is not None}


def _find(run: Path, sample: str, tracks: Collection[str]) -> Record:
    """The one episode that `sample` means; StoreError with the others when there is not one."""
    lines = run_records(run)
    starts = newest_starts(lines, tracks)
    episodes = list(starts)
    if not episodes:
        hint = "phyblock run steps makes runs with episodes"
        titles = ", ".join(kind_of(name).title.lower() for name in tracks)
        message = f"holds no episodes of {titles}"
        raise StoreError(Problem(str(run / RECORDS), message, hint=hint))
    matching = [sample] if sample in episodes else [name for name in episodes if sample in name]
    if len(matching) == 1:
        return next(iter(lines.at([starts[matching[0]]])))
    message = "holds no such episode" if not matching else f"holds {len(matching)} such episodes"
    offered = matching or episodes
    more = [f"and {len(offered) - _NAMED} more"] if len(offered) > _NAMED else []
    allowed = ", ".join([*offered[:_NAMED], *more])
    problem = Problem(str(run / RECORDS), message, "sample", sample, allowed)
    raise StoreError(problem)


def _task(run: Path, record: Record, data: Path | None) -> AssemblyTask:
    manifest = read_manifest(run)
    levels = read_design(manifest.fields(), str(run / MANIFEST)).suite.levels
    dataset = recorded_dataset(run, manifest, levels, data)
    tasks = {task.scene.id: task for task in dataset.tasks}
    if record.scene not in tasks:
        raise DataError(Problem(str(dataset.root), "holds no such scene", "scene", record.scene))
    return as_recorded(tasks[record.scene], record)
