"""`phyblock scenes audit`: a data set held against geometry and physics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import click

from phyblock.cli.console import make_console, print_rows, shown_path
from phyblock.cli.options import NAME_OR_PATH, UserPath
from phyblock.data import read_data_set
from phyblock.domain import Scene
from phyblock.files import OutFolder, check_free, make_folder, write_named
from phyblock.making.checks import (
    AUDITED,
    FOREIGN,
    CheckName,
    Finding,
    SceneAudit,
    audit_scenes,
    find_duplicates,
    findings_csv,
)
from phyblock.making.cli.working import jobs_option, tracked
from phyblock.sim.film import marked_png
from phyblock.sim.pictures import PictureStyle
from phyblock.text import counted

_DEPENDING: tuple[CheckName, ...] = ("undeclared dependency", "dependency without contact")


@click.command("audit")
@click.argument("data", metavar="PATH", type=NAME_OR_PATH)
@click.option("--csv", "table", type=UserPath(), metavar="FILE", help="All findings as CSV.")
@click.option("--pictures", type=UserPath(), metavar="DIR", help="Draw the worst scenes here.")
@click.option(
    "--worst",
    type=click.IntRange(0),
    default=15,
    show_default=True,
    metavar="N",
    help="Number of the worst scenes that are shown and drawn.",
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
    data: str, table: Path | None, pictures: Path | None, worst: int, jobs: int, tolerance: float
) -> None:
    """Audit the data set PATH: a folder with scenes.jsonl, an official checkout, or a bundled set.

    Changes nothing in PATH. Shows the worst scenes and totals: overlaps, gaps, declared
    dependencies against contacts, layers, orders, stability of every step and of the whole,
    candidates, duplicates. --csv writes every finding. Exits with 0, whatever it finds.
    """
    if table is not None and table.is_dir():
        check_free([table], "name another place")
    for folder in (None if table is None else table.parent, pictures):
        if folder is not None:
            make_folder(folder)
    tasks = [(task.scene, task.candidates) for task in read_data_set(data).tasks]
    running = audit_scenes(tasks, replace(FOREIGN, fit_m=tolerance / 1000), min(jobs, len(tasks)))
    audits = list(tracked(running, len(tasks), "Auditing"))
    twins = find_duplicates(scene for scene, _ in tasks)
    guilty = sorted((one for one in audits if one.findings), key=lambda one: one.badness)
    worst_scenes = guilty[::-1][:worst]
    _print_worst(worst_scenes)
    _print_totals(audits, twins)
    console = make_console()
    if table is not None:
        write_named(table, findings_csv(audits, twins))
        console.print(f"all findings in {shown_path(table)}", markup=False)
    if pictures is not None:
        out = OutFolder(pictures)
        out.check(f"{audit.scene.id}.png" for audit in worst_scenes)
        for audit in worst_scenes:
            blamed = {order for finding in audit.findings for order in finding.blocks}
            out.write({f"{audit.scene.id}.png": marked_png(audit.scene, blamed, PictureStyle())})
        told = f"{counted(len(worst_scenes), 'picture')} in {shown_path(pictures)}"
        console.print(told, markup=False)


def _print_worst(worst: Sequence[SceneAudit]) -> None:
    rows = []
    for audit in worst:
        # The cause before its effect: what overlaps or floats before what falls.
        first = min(audit.findings, key=lambda finding: AUDITED.index(finding.check))
        blocks = _blocks(audit.scene, first.blocks)
        facts = (first.check, first.message, blocks)
        rows.append((audit.scene.id, str(audit.scene.level), *facts, str(len(audit.findings))))
    if rows:
        headings = ("scene", "level", "check", "first finding", "blocks", "findings")
        print_rows(make_console(), headings, rows, numbers=1)


def _blocks(scene: Scene, orders: Sequence[int]) -> str:
    named = [f"{b.order} {b.color} {b.type}" for b in scene.blocks if b.order in orders]
    return ", ".join(named[:3]) + (", ..." if len(named) > 3 else "")


def _print_totals(audits: Sequence[SceneAudit], twins: Sequence[Finding]) -> None:
    findings = [*twins, *(finding for audit in audits for finding in audit.findings)]
    rows = []
    for check in AUDITED:
        mine = [finding for finding in findings if finding.check == check]
        rows.append((check, str(len({finding.scene for finding in mine})), str(len(mine))))
    console = make_console()
    print_rows(console, ("check", "scenes", "findings"), rows, numbers=2)
    declared, contacts, shared = (
        sum(getattr(audit, name) for audit in audits) for name in ("declared", "contacts", "shared")
    )

    def without(*checks: CheckName) -> int:
        return sum(not audit.has(*checks) for audit in audits)

    for line in (
        f"{counted(len(audits), 'scene')} read; {without(*AUDITED)} with no finding",
        f"{without('unstable')} stand when finished, "
        f"{without('unstable', 'unstable step')} at every step as well",
        f"{_share(shared, declared)} declared dependencies are contacts (precision)",
        f"{_share(shared, contacts)} contacts are declared (recall)",
        f"{without(*_DEPENDING)} declare their contacts and nothing else",
    ):
        console.print(line, markup=False, soft_wrap=True)


def _share(part: int, whole: int) -> str:
    return f"{part} of {whole} ({part / whole:.3f})" if whole else "no"
