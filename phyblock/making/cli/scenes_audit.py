"""`phyblock scenes audit`: a data set held against geometry and physics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import click
from rich.console import Console

from phyblock.cli.console import make_console, shown_path
from phyblock.cli.paths import NAME_OR_PATH, UserPath
from phyblock.datasets import SCENES_FILE
from phyblock.datasets.named import find_data_set
from phyblock.files import OutFolder, check_free, make_folder, write_named
from phyblock.making.auditing.boosting import can_boost
from phyblock.making.auditing.corrected_copy import CHANGES_FILE, write_fixed
from phyblock.making.auditing.salvage import Salvage, salvage
from phyblock.making.auditing.scene_audit import SceneAudit
from phyblock.making.auditing.set_audit import Audit, audit_scenes, findings_csv
from phyblock.making.auditing.tells import blind_scores, find_tells, learners
from phyblock.making.checks.scene_facts import SceneFacts
from phyblock.making.checks.set_checks import find_duplicates
from phyblock.making.checks.tolerances import FOREIGN, Tolerances
from phyblock.making.cli.scenes_audit_view import print_audit, print_changes, worst_scenes
from phyblock.making.cli.scenes_tells_view import print_blind, print_tells
from phyblock.making.cli.working import jobs_option, tracked
from phyblock.sim import PictureStyle
from phyblock.sim.marked import marked_png
from phyblock.text import counted

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
    default=1000 * FOREIGN.fit_m,
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

    Changes nothing in PATH, and reports what it cannot read as a finding like all others. The
    tables show totals, disagreements and the worst scenes, then what the candidate sets give away:
    by place, by the pose listed first, by how many poses are offered, and to learners that never
    see the goal. --csv writes every finding. Exits with 0, whatever it finds.
    """
    console = make_console()
    _check_places(table, fix, pictures)
    salvaged = salvage(find_data_set(data))
    audits = _run(salvaged, replace(FOREIGN, fit_m=tolerance / 1000), jobs)
    twins = find_duplicates(task.scene for task in salvaged.tasks)
    audit = Audit(tuple(audits), (*salvaged.findings, *twins))
    print_audit(console, audit, worst)
    _print_candidates(console, salvaged)
    if table is not None:
        write_named(table, findings_csv(audit))
        console.print(
            f"{counted(len(audit.findings), 'finding')} in {shown_path(table)}", markup=False
        )
    if pictures is not None:
        count = _draw(pictures, worst_scenes(audit, worst))
        console.print(f"{counted(count, 'picture')} in {shown_path(pictures)}", markup=False)
    if fix is not None:
        sets = {task.scene.id: task.candidates for task in salvaged.tasks}
        print_changes(console, write_fixed(fix, audits, sets), shown_path(fix))


def _print_candidates(console: Console, salvaged: Salvage) -> None:
    """What the candidate sets give away, of scenes that have one and an order to build in."""
    tasks = [
        (task.scene, task.candidates)
        for task in salvaged.tasks
        if task.candidates is not None and SceneFacts(task.scene).graph is not None
    ]
    if tasks:
        print_tells(console, find_tells(tasks))
        print_blind(console, blind_scores(tasks, learners()), can_boost())


def _run(salvaged: Salvage, tolerances: Tolerances, jobs: int) -> list[SceneAudit]:
    tasks = [(task.scene, task.candidates) for task in salvaged.tasks]
    audits = audit_scenes(tasks, tolerances, min(jobs, max(len(tasks), 1)))
    return list(tracked(audits, len(tasks), "Auditing"))


def _check_places(table: Path | None, fix: Path | None, pictures: Path | None) -> None:
    """Refuse before the work what would be refused after it."""
    taken: list[Path] = []
    if table is not None and table.is_dir():
        taken.append(table)
    if fix is not None:
        taken += [fix / name for name in (SCENES_FILE, CHANGES_FILE)]
    check_free(taken, "name another place")
    folders = (None if table is None else table.parent, fix, pictures)
    for folder in folders:
        if folder is not None:
            make_folder(folder)


def _draw(folder: Path, audits: Sequence[SceneAudit]) -> int:
    out = OutFolder(folder)
    out.check(f"{audit.scene.id}.png" for audit in audits)
    for audit in audits:
        guilty = {order for finding in audit.findings for order in finding.blocks}
        picture = marked_png(audit.scene, guilty, PictureStyle())
        out.write({f"{audit.scene.id}.png": picture})
    return len(audits)
