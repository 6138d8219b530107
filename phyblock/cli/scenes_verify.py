"""`phyblock scenes verify`: everything in a data set derived again."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path

import click

from phyblock.cli.console import make_console, plain_table, shown_path
from phyblock.datasets import AssemblyTask, read_builtin
from phyblock.errors import Problem
from phyblock.generate.verify import (
    SCENE_CHECKS,
    check_duplicates,
    check_looks,
    check_parents,
    check_sums,
    verify_scenes,
)
from phyblock.generate.workers import open_workers
from phyblock.resources import bundled

__all__ = ["command"]

_Row = tuple[str, int, int]
_DEFAULT = "phyblock-400"


@click.command("verify")
@click.argument("folder", type=click.Path(path_type=Path), required=False)
@click.option("--jobs", type=click.IntRange(1), default=1, show_default=True, help="Processes.")
@click.option("--ray", "ray_address", metavar="ADDRESS", help="A Ray cluster, or: local.")
@click.option("--limit", type=click.IntRange(1), metavar="N", help="The first N scenes alone.")
def command(folder: Path | None, jobs: int, ray_address: str | None, limit: int | None) -> None:
    """Check every scene of FOLDER (by default the built-in set) against geometry and physics.

    Contacts, layers, overlaps, gaps, stability of the whole at two time steps and of every step,
    candidates, duplicates, parents and checksums. Exit code 1 when anything fails.
    """
    where = folder or bundled("benchmarks", "data", _DEFAULT)
    tasks = read_builtin(where).tasks
    rows, problems = _check_scenes(tasks[:limit], jobs, ray_address)
    rows_of_set, problems_of_set = _check_set(where, tasks)
    console = make_console()
    shown = [(name, str(good), str(total)) for name, good, total in (*rows, *rows_of_set)]
    console.print(plain_table(("check", "passed", "of"), shown, numbers=2))
    failures = [*problems, *problems_of_set]
    for problem in failures:
        click.echo(f"failed: {problem}", err=True)
    verdict = f"{len(failures)} failures" if failures else "all checks passed"
    console.print(f"{shown_path(where)}: {verdict}", markup=False, soft_wrap=True)
    if failures:
        raise click.exceptions.Exit(1)


def _check_scenes(
    tasks: tuple[AssemblyTask, ...], jobs: int, ray_address: str | None
) -> tuple[list[_Row], list[Problem]]:
    passed = dict.fromkeys(SCENE_CHECKS, 0)
    problems: list[Problem] = []
    with (
        open_workers(jobs, ray_address) as workers,
        click.progressbar(length=len(tasks), label="scenes", file=sys.stderr) as bar,
    ):
        for found in verify_scenes(((task.scene, task.candidates) for task in tasks), workers):
            bar.update(1)
            for name, wrong in found.items():
                passed[name] += not wrong
                problems += wrong
    return [(name, good, len(tasks)) for name, good in passed.items()], problems


def _check_set(where: Path, tasks: tuple[AssemblyTask, ...]) -> tuple[list[_Row], list[Problem]]:
    scenes = [task.scene for task in tasks]
    alike, orphans = check_duplicates(scenes), check_parents(scenes)
    looks, same = check_looks(task.candidates for task in tasks)
    files, changed = check_sums(where)
    rows = [
        ("no duplicate", len(scenes) - len(alike), len(scenes)),
        ("parents are base scenes", len(scenes) - len(orphans), len(scenes)),
        ("looks that pictures tell apart", looks - len(_named(same)), looks),
        ("checksums", files - len(changed), files),
    ]
    return rows, [*alike.values(), *orphans.values(), *same, *changed]


def _named(problems: Iterable[Problem]) -> set[str]:
    return {problem.where for problem in problems}
