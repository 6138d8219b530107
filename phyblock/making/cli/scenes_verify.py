"""`phyblock scenes verify`: everything in a data set derived again."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import click

from phyblock.cli.console import make_console, print_rows
from phyblock.cli.options import NAME_OR_PATH
from phyblock.data import SCENES_FILE, AssemblyTask, find_data_set, read_builtin
from phyblock.errors import DataError, Problem
from phyblock.making.checks import (
    LAWS,
    check_looks,
    find_duplicates,
    find_orphans,
    verify_scenes,
)
from phyblock.making.cli.working import jobs_option, ray_option, tracked
from phyblock.making.scenes.files import check_sums
from phyblock.making.workers import open_workers
from phyblock.text import counted

__all__ = ["command"]

_Row = tuple[str, int, int]


@click.command("verify")
@click.argument("data", metavar="[PATH]", default="phyblock-400", type=NAME_OR_PATH)
@jobs_option
@ray_option
@click.option(
    "--limit",
    type=click.IntRange(1),
    metavar="M",
    help="Simulate the first M scenes alone; the rest is checked for duplicates and the like.",
)
def command(data: str, jobs: int, ray_address: str | None, limit: int | None) -> None:
    """Check every scene of PATH against geometry and physics, down to the last number.

    PATH is a folder with scenes.jsonl or a bundled set, by default the built-in phyblock-400.
    To check data sets made elsewhere, use: phyblock scenes audit.

    Checks contacts, layers, overlaps, gaps, stability of the whole at two time steps and of every
    step, candidates, duplicates, parents and checksums. Exits with 1 when anything fails.
    """
    where = find_data_set(data)
    if not (where / SCENES_FILE).is_file():
        hint = f"phyblock scenes audit {data}"
        raise DataError(Problem(data, f"has no {SCENES_FILE} to verify", hint=hint))
    tasks = read_builtin(where).tasks
    rows, problems = _check_scenes(tasks[:limit], jobs, ray_address)
    rows_of_set, problems_of_set = _check_set(where, tasks)
    console = make_console()
    shown = [(name, str(good), str(total)) for name, good, total in (*rows, *rows_of_set)]
    print_rows(console, ("check", "passed", "of"), shown, numbers=2)
    failures = [*problems, *problems_of_set]
    for problem in failures:
        click.echo(f"failed: {problem}", err=True)
    verdict = counted(len(failures), "failure") if failures else "all checks passed"
    console.print(f"{data}: {verdict}", markup=False, soft_wrap=True)
    if failures:
        raise click.exceptions.Exit(1)


def _check_scenes(
    tasks: tuple[AssemblyTask, ...], jobs: int, ray_address: str | None
) -> tuple[list[_Row], list[Problem]]:
    passed = dict.fromkeys(LAWS, 0)
    problems: list[Problem] = []
    with open_workers(jobs, ray_address) as workers:
        verified = verify_scenes(((task.scene, task.candidates) for task in tasks), workers)
        for broken in tracked(verified, len(tasks), "Verifying"):
            for law, findings in broken.items():
                passed[law] += not findings
                problems += [finding.problem for finding in findings]
    return [(law, good, len(tasks)) for law, good in passed.items()], problems


def _check_set(where: Path, tasks: tuple[AssemblyTask, ...]) -> tuple[list[_Row], list[Problem]]:
    scenes = [task.scene for task in tasks]
    twins, orphans = find_duplicates(scenes), tuple(find_orphans(scenes))
    looks, same = check_looks(task.candidates for task in tasks)
    files, changed = check_sums(where)
    rows = [
        ("no duplicate", len(scenes) - len(twins), len(scenes)),
        ("parents are base scenes", len(scenes) - len(orphans), len(scenes)),
        ("looks that pictures tell apart", looks - len(_named(same)), looks),
        ("checksums", files - len(changed), files),
    ]
    findings = [finding.problem for finding in (*twins, *orphans)]
    return rows, [*findings, *same, *changed]


def _named(problems: Iterable[Problem]) -> set[str]:
    return {problem.where for problem in problems}
