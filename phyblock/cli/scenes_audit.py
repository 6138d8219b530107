"""`phyblock scenes audit`: a data set held against geometry and physics."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import click
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from phyblock.cli.audit_view import print_audit, print_changes, worst_scenes
from phyblock.cli.console import make_console, shown_path
from phyblock.cli.scenes_data import find_data_set
from phyblock.datasets import Fault, Salvage, salvage
from phyblock.domain import CandidateSet, Scene
from phyblock.errors import Problem, StoreError
from phyblock.generate.audit import AuditSettings, Finding, SceneAudit
from phyblock.generate.audit_set import (
    Audit,
    audit_scenes,
    find_duplicates,
    findings_csv,
    write_fixed,
)
from phyblock.sim import PictureStyle
from phyblock.sim.marked import marked_png

__all__ = ["command"]

_LINE_EVERY = 25


@click.command("audit")
@click.argument("data", metavar="PATH")
@click.option("--csv", "table", type=click.Path(path_type=Path), help="All findings as CSV.")
@click.option(
    "--fix", type=click.Path(path_type=Path), metavar="OUT", help="Write a corrected copy here."
)
@click.option(
    "--pictures", type=click.Path(path_type=Path), metavar="DIR", help="Draw the worst scenes here."
)
@click.option("--worst", default=15, show_default=True, help="How many scenes are the worst.")
@click.option(
    *("--jobs", "-j"),
    type=click.IntRange(1, 256),
    default=os.cpu_count() or 1,
    show_default="all processors",
    help="Processes.",
)
@click.option(
    "--tolerance",
    type=click.FloatRange(0.01, 10),
    default=2.0,
    show_default=True,
    help="Overlaps and gaps up to this pass [mm].",
)
def command(
    data: str,
    table: Path | None,
    fix: Path | None,
    pictures: Path | None,
    worst: int,
    jobs: int,
    tolerance: float,
) -> None:
    """Audit the data set PATH: a folder with scenes.jsonl, an official checkout, or a bundled set.

    Nothing in PATH is changed. What cannot be read is a finding like all others. The findings go
    to the CSV file, each of them; the tables show totals, disagreements and the worst scenes.
    """
    console = make_console()
    _check_free(table, fix)
    found = salvage(find_data_set(data))
    settings = AuditSettings(tolerance_m=tolerance / 1000)
    audits = _run(found, settings, jobs, make_console(stderr=True))
    others = [*map(_unreadable, found.faults), *find_duplicates(task.scene for task in found.tasks)]
    audit = Audit(tuple(audits), tuple(others))
    print_audit(console, audit, worst)
    if table is not None:
        _write(table, findings_csv(audit))
        console.print(f"{len(audit.findings)} findings in {shown_path(table)}", markup=False)
    if pictures is not None:
        count = _draw(pictures, worst_scenes(audit, worst))
        console.print(f"{count} pictures in {shown_path(pictures)}", markup=False)
    if fix is not None:
        sets = {task.scene.id: task.candidates for task in found.tasks}
        print_changes(console, write_fixed(fix, audits, sets), shown_path(fix))


def _run(found: Salvage, settings: AuditSettings, jobs: int, console: Console) -> list[SceneAudit]:
    """Audit the scenes, a progress bar on a terminal and a line now and then elsewhere."""
    tasks: list[tuple[Scene, CandidateSet | None]] = [
        (task.scene, task.candidates) for task in found.tasks
    ]
    audits: list[SceneAudit] = []
    columns = (TextColumn("Auditing"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        bar = progress.add_task("", total=len(tasks))
        for one in audit_scenes(tasks, settings, min(jobs, max(len(tasks), 1))):
            audits.append(one)
            progress.advance(bar)
            if not console.is_terminal and len(audits) % _LINE_EVERY == 0:
                console.print(f"{len(audits)} of {len(tasks)} scenes")
    return audits


def _unreadable(fault: Fault) -> Finding:
    problem = fault.problem
    told = f"{problem.field} {problem.message}".strip()
    details = (problem.found, problem.allowed)
    return Finding(
        fault.scene, "unreadable", f"{problem.where}: {told}", declared=details[0], found=details[1]
    )


def _check_free(table: Path | None, fix: Path | None) -> None:
    """Refuse before the work what would be refused after it."""
    taken: list[Path] = []
    if table is not None and table.is_dir():
        taken.append(table)
    if fix is not None:
        taken += [fix / name for name in ("scenes.jsonl", "changes.csv") if (fix / name).exists()]
    if taken:
        hint = "name another place"
        raise StoreError([Problem(str(path), "is already there", hint=hint) for path in taken])


def _draw(folder: Path, audits: Sequence[SceneAudit]) -> int:
    for one in audits:
        guilty = {order for finding in one.findings for order in finding.blocks}
        _write(folder / f"{one.scene.id}.png", marked_png(one.scene, guilty, PictureStyle()))
    return len(audits)


def _write(path: Path, content: str | bytes) -> None:
    data = content.encode() if isinstance(content, str) else content
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    except OSError as error:
        raise StoreError(Problem(str(path), f"cannot be written: {error.strerror}")) from error
