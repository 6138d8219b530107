"""`phyblock scenes audit`: a data set held against geometry and physics."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click

from phyblock.cli.audit_view import print_audit, print_changes, worst_scenes
from phyblock.cli.console import make_console, shown_path
from phyblock.cli.paths import NAME_OR_PATH, UserPath
from phyblock.cli.scenes_data import find_data_set
from phyblock.cli.scenes_work import jobs_option, tracked
from phyblock.datasets import Fault, Salvage, salvage
from phyblock.files import check_free, make_folder, write_named
from phyblock.folders import OutFolder
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


@click.command("audit")
@click.argument("data", metavar="PATH", type=NAME_OR_PATH)
@click.option("--csv", "table", type=UserPath(), metavar="FILE", help="All findings as CSV.")
@click.option("--fix", type=UserPath(), metavar="OUT", help="Write a corrected copy here.")
@click.option("--pictures", type=UserPath(), metavar="DIR", help="Draw the worst scenes here.")
@click.option(
    "--worst",
    type=click.IntRange(0),
    default=15,
    show_default=True,
    metavar="N",
    help="How many of the worst scenes are shown and drawn.",
)
@jobs_option
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
    to the CSV file, each of them; the tables show totals, disagreements and the worst scenes. The
    exit code is 0 whatever is found.
    """
    console = make_console()
    _check_places(table, fix, pictures)
    found = salvage(find_data_set(data))
    settings = AuditSettings(tolerance_m=tolerance / 1000)
    audits = _run(found, settings, jobs)
    others = [*map(_unreadable, found.faults), *find_duplicates(task.scene for task in found.tasks)]
    audit = Audit(tuple(audits), tuple(others))
    print_audit(console, audit, worst)
    if table is not None:
        write_named(table, findings_csv(audit))
        console.print(f"{len(audit.findings)} findings in {shown_path(table)}", markup=False)
    if pictures is not None:
        count = _draw(pictures, worst_scenes(audit, worst))
        console.print(f"{count} pictures in {shown_path(pictures)}", markup=False)
    if fix is not None:
        sets = {task.scene.id: task.candidates for task in found.tasks}
        print_changes(console, write_fixed(fix, audits, sets), shown_path(fix))


def _run(found: Salvage, settings: AuditSettings, jobs: int) -> list[SceneAudit]:
    tasks = [(task.scene, task.candidates) for task in found.tasks]
    audits = audit_scenes(tasks, settings, min(jobs, max(len(tasks), 1)))
    return list(tracked(audits, len(tasks), "Auditing"))


def _unreadable(fault: Fault) -> Finding:
    problem = fault.problem
    told = f"{problem.field} {problem.message}".strip()
    details = (problem.found, problem.allowed)
    return Finding(
        fault.scene, "unreadable", f"{problem.where}: {told}", declared=details[0], found=details[1]
    )


def _check_places(table: Path | None, fix: Path | None, pictures: Path | None) -> None:
    """Refuse before the work what would be refused after it."""
    taken: list[Path] = []
    if table is not None and table.is_dir():
        taken.append(table)
    if fix is not None:
        taken += [fix / name for name in ("scenes.jsonl", "changes.csv")]
    check_free(taken, "name another place")
    folders = (None if table is None else table.parent, fix, pictures)
    for folder in folders:
        if folder is not None:
            make_folder(folder)


def _draw(folder: Path, audits: Sequence[SceneAudit]) -> int:
    out = OutFolder(folder)
    out.check(f"{one.scene.id}.png" for one in audits)
    for one in audits:
        guilty = {order for finding in one.findings for order in finding.blocks}
        out.write({f"{one.scene.id}.png": marked_png(one.scene, guilty, PictureStyle())})
    return len(audits)
