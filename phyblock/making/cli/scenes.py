"""`phyblock scenes`: make data sets, check them, look at them."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import cast

import click

from phyblock.cli.console import make_console, print_rows, shown_path
from phyblock.cli.options import NAME_OR_PATH, UserPath
from phyblock.data import (
    SCENES_FILE,
    AssemblyTask,
    find_data_set,
    read_builtin,
    read_data_set,
)
from phyblock.errors import DataError, Problem
from phyblock.files import OutFolder, check_free, make_folder, write_named
from phyblock.making.checks import (
    AUDITED,
    FOREIGN,
    LAWS,
    CheckName,
    Finding,
    SceneAudit,
    audit_scenes,
    check_looks,
    find_duplicates,
    find_orphans,
    findings_csv,
    verify_scenes,
)
from phyblock.making.cli.options import (
    find_scenes,
    jobs_option,
    ray_option,
    seed_option,
    tell_simulators,
    tracked,
)
from phyblock.making.scenes.completing import Completed, ReadScene, complete, palette_of, read_given
from phyblock.making.scenes.files import card, check_folder, check_sums, completed_card, open_writer
from phyblock.making.scenes.production import Order, produce, shares
from phyblock.making.scenes.sketch import PALETTES, Palette
from phyblock.making.workers import open_workers
from phyblock.sim.camera import VIEWS
from phyblock.sim.film import assembly_gif
from phyblock.sim.pictures import (
    PictureStyle,
    candidates_png,
    composite_png,
    goal_png,
    visible_shares,
)
from phyblock.text import counted
from phyblock.types import BACKGROUNDS


@click.group("scenes")
def scenes() -> None:
    """Make data sets of scenes, check them against physics, and look at them."""


_PALETTE_TEXT: dict[Palette, str] = {
    "kit": f"the official kit's {len(PALETTES['kit'])} pairs of type and color",
    "full": f"all {len(PALETTES['full'])} pairs of type and color",
}


def _levels(ctx: click.Context, param: click.Parameter, value: str) -> tuple[int, ...]:
    words = value.split(",")
    if not all(word in ("1", "2", "3", "4") for word in words) or len(set(words)) < len(words):
        raise click.BadParameter(f"{value!r}: give levels like 1,2,3,4", ctx, param)
    return tuple(sorted(int(word) for word in words))


@scenes.command("generate")
@click.option(
    "--count",
    type=click.IntRange(1),
    default=400,
    show_default=True,
    metavar="N",
    help="How many scenes.",
)
@seed_option("Another seed gives other scenes.")
@click.option(
    "--levels",
    default="1,2,3,4",
    show_default=True,
    callback=_levels,
    metavar="LEVELS",
    help="Levels to make, in the proportions of the built-in set.",
)
@click.option(
    "--palette",
    type=click.Choice(["kit", "full"]),
    default="kit",
    show_default=True,
    help=f"The kit's {len(PALETTES['kit'])} pairs of type and color, or all that there are.",
)
@jobs_option
@ray_option
@click.option(
    *("--out", "-o"),
    type=UserPath(),
    required=True,
    metavar="DIR",
    help="Folder to write.",
)
@click.option("--replace", is_flag=True, help="Replace a data set that is in the folder.")
def generate(
    count: int,
    seed: int,
    levels: tuple[int, ...],
    palette: str,
    jobs: int,
    ray_address: str | None,
    out: Path,
    replace: bool,
) -> None:
    """Make N scenes with candidate sets, each checked by physics, and their data card.

    The same N, seed, levels and palette give the same files with the same
    physics engine, on any Python, any number of processes or a cluster.
    """
    kind = cast(Palette, palette)
    order = Order(seed, kind, shares(count, levels))
    with (
        open_workers(jobs, ray_address) as workers,
        open_writer(out, kind, replace, "give another --out, or --replace") as writer,
    ):
        for scene in tracked(produce(order, workers), count, "Making"):
            writer.add(scene)
        chosen = ",".join(map(str, levels))
        made_by = f"phyblock scenes generate --count {count} --seed {seed} --levels {chosen}"
        made_by += f" --palette {palette} --out {out.name}"
        writer.finish(card(out.name, writer, made_by, _PALETTE_TEXT[kind]))
    click.echo(f"{counted(count, 'scene')}, all checks passed: {shown_path(out)}")
    tell_simulators()


@scenes.command("complete")
@click.argument("data", metavar="FILE_OR_FOLDER", type=UserPath())
@jobs_option
@click.option(
    *("--out", "-o"),
    type=UserPath(),
    metavar="DIR",
    help="Folder to write.  [default: NAME-set here]",
)
def complete_set(data: Path, jobs: int, out: Path | None) -> None:
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


@scenes.command("verify")
@click.argument("data", metavar="[PATH]", default="phyblock-400", type=NAME_OR_PATH)
@jobs_option
@ray_option
@click.option(
    "--limit",
    type=click.IntRange(1),
    metavar="M",
    help="Simulate the first M scenes alone; the rest is checked for duplicates and the like.",
)
def verify(data: str, jobs: int, ray_address: str | None, limit: int | None) -> None:
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
    simulated = [(task.scene, task.candidates) for task in tasks[:limit]]
    passed = dict.fromkeys(LAWS, 0)
    problems: list[Problem] = []
    with open_workers(jobs, ray_address) as workers:
        for broken in tracked(verify_scenes(simulated, workers), len(simulated), "Verifying"):
            for law, findings in broken.items():
                passed[law] += not findings
                problems += [finding.problem for finding in findings]
    scenes = [task.scene for task in tasks]
    twins, orphans = find_duplicates(scenes), tuple(find_orphans(scenes))
    looks, same = check_looks(task.candidates for task in tasks)
    files, changed = check_sums(where)
    rows = [(law, str(good), str(len(simulated))) for law, good in passed.items()]
    alike = len({problem.where for problem in same})
    for name, total, bad in (
        ("no duplicate", len(scenes), len(twins)),
        ("parents are base scenes", len(scenes), len(orphans)),
        ("looks that pictures tell apart", looks, alike),
        ("checksums", files, len(changed)),
    ):
        rows.append((name, str(total - bad), str(total)))
    console = make_console()
    print_rows(console, ("check", "passed", "of"), rows, numbers=2)
    failures = [*problems, *(finding.problem for finding in (*twins, *orphans)), *same, *changed]
    for problem in failures:
        click.echo(f"failed: {problem}", err=True)
    verdict = counted(len(failures), "failure") if failures else "all checks passed"
    console.print(f"{data}: {verdict}", markup=False, soft_wrap=True)
    if failures:
        raise click.exceptions.Exit(1)


_WORST = 15
"""The worst scenes of an audit that are shown."""
_DEPENDING: tuple[CheckName, ...] = ("undeclared dependency", "dependency without contact")


@scenes.command("audit")
@click.argument("data", metavar="PATH", type=NAME_OR_PATH)
@click.option("--csv", "table", type=UserPath(), metavar="FILE", help="All findings as CSV.")
@jobs_option
@click.option(
    "--tolerance",
    type=click.FloatRange(0.01, 10),
    default=1000 * FOREIGN.fit_m,
    show_default=True,
    help="Overlaps and gaps up to this pass [mm].",
)
def audit(data: str, table: Path | None, jobs: int, tolerance: float) -> None:
    """Audit the data set PATH: a folder with scenes.jsonl, an official checkout, or a bundled set.

    Changes nothing in PATH. Shows the worst scenes and totals: overlaps, gaps, declared
    dependencies against contacts, layers, orders, stability of every step and of the whole,
    candidates, duplicates. --csv writes every finding. Exits with 0, whatever it finds.
    """
    if table is not None and table.is_dir():
        check_free([table], "name another place")
    if table is not None:
        make_folder(table.parent)
    tasks = [(task.scene, task.candidates) for task in read_data_set(data).tasks]
    running = audit_scenes(tasks, replace(FOREIGN, fit_m=tolerance / 1000), min(jobs, len(tasks)))
    audits = list(tracked(running, len(tasks), "Auditing"))
    twins = find_duplicates(scene for scene, _ in tasks)
    guilty = sorted((one for one in audits if one.findings), key=lambda one: one.badness)
    _print_worst(guilty[::-1][:_WORST])
    _print_totals(audits, twins)
    console = make_console()
    if table is not None:
        write_named(table, findings_csv(audits, twins))
        console.print(f"all findings in {shown_path(table)}", markup=False)


def _print_worst(worst: Sequence[SceneAudit]) -> None:
    rows = []
    for audit in worst:
        # The cause before its effect: what overlaps or floats before what falls.
        first = min(audit.findings, key=lambda finding: AUDITED.index(finding.check))
        named = [
            f"{b.order} {b.color} {b.type}" for b in audit.scene.blocks if b.order in first.blocks
        ]
        blocks = ", ".join(named[:3]) + (", ..." if len(named) > 3 else "")
        facts = (first.check, first.message, blocks)
        rows.append((audit.scene.id, str(audit.scene.level), *facts, str(len(audit.findings))))
    if rows:
        headings = ("scene", "level", "check", "first finding", "blocks", "findings")
        print_rows(make_console(), headings, rows, numbers=1)


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


@scenes.command("show")
@click.argument("data", metavar="PATH", type=NAME_OR_PATH)
@click.argument("scene")
def show(data: str, scene: str) -> None:
    """Show the facts of SCENE in the data set PATH: blocks, layers, dependencies, candidates.

    "on" names the blocks below, "pick" the candidate that stands for the block, "seen" the share
    of it that no other hides in the default goal picture.
    """
    (task,) = find_scenes(read_data_set(data), (scene,))
    console = make_console()
    levels = " and ".join(map(str, task.scene.levels))
    parents = ", ".join(task.scene.parents)
    layers = counted(max(task.scene.graph.layers), "layer")
    blocks = counted(len(task.scene), "block")
    heading = f"scene {task.scene.id} · level {levels} · {blocks} · {layers}"
    console.print(f"{heading} · made from {parents}", markup=False, soft_wrap=True)
    headings = ("block", "type", "color", "on", "position mm", "euler deg")
    numbers = ("layer", "pick", "seen")
    print_rows(console, (*headings, *numbers), _blocks(task), numbers=3)
    offered = ("candidate", "type", "color", "euler deg", "needed")
    print_rows(console, offered, _candidates(task), numbers=1)


def _blocks(task: AssemblyTask) -> list[tuple[str, ...]]:
    seen = visible_shares(task.scene, PictureStyle())
    rows: list[tuple[str, ...]] = []
    for block in task.scene.blocks:
        place = " ".join(f"{1000 * c + 0.0:.1f}".removesuffix(".0") for c in block.position_m)
        number = task.candidates.index_of(block.look)
        below = " ".join(map(str, sorted(block.depend))) or "ground"
        what = (str(block.order), block.type, block.color, below)
        numbers = (str(block.layer), str(number), f"{100 * seen[block.order]:.0f} %")
        rows.append((*what, place, _angles(block.euler_deg), *numbers))
    return rows


def _candidates(task: AssemblyTask) -> list[tuple[str, ...]]:
    looks = [block.look for block in task.scene.blocks]
    rows: list[tuple[str, ...]] = []
    for number, candidate in enumerate(task.candidates.candidates, 1):
        needed = looks.count(candidate.look)
        what = (str(number), candidate.type, candidate.color, _angles(candidate.euler_deg))
        rows.append((*what, f"{needed} x" if needed else ""))
    return rows


def _angles(euler_deg: tuple[float, float, float]) -> str:
    return " ".join(f"{angle:g}" for angle in euler_deg)


@scenes.command("render")
@click.argument("data", metavar="PATH", type=NAME_OR_PATH)
@click.argument("scenes", metavar="[SCENE]...", nargs=-1)
@click.option(
    *("--out", "-o"),
    type=UserPath(file_okay=False),
    required=True,
    metavar="DIR",
    help="Folder for the pictures.",
)
@click.option(
    "--view",
    type=click.Choice([*VIEWS, "all"]),
    default="oblique",
    show_default=True,
    help="Where the scene is seen from.",
)
@click.option(
    "--background",
    type=click.Choice([*BACKGROUNDS, "all"]),
    default="checkerboard",
    show_default=True,
    help="What stands behind the blocks.",
)
@click.option(
    "--size",
    type=click.IntRange(128, 2048),
    default=512,
    show_default=True,
    help="Edge of a picture [pixels].",
)
@click.option("--composite", is_flag=True, help="Goal and candidates side by side, too.")
@click.option("--gif", is_flag=True, help="The assembly as an animated GIF, too.")
def render(
    data: str,
    scenes: tuple[str, ...],
    out: Path,
    view: str,
    background: str,
    size: int,
    composite: bool,
    gif: bool,
) -> None:
    """Draw the scenes SCENE... of the data set PATH, or all of them.

    Files are named SCENE-VIEW-BACKGROUND-WHAT; it writes over those that it wrote before.
    """
    read = read_data_set(data)
    drawings: dict[str, Callable[[], bytes]] = {}
    for task in find_scenes(read, scenes) if scenes else read.tasks:
        scene = task.scene
        for seen, (azimuth, elevation) in VIEWS.items():
            for floor in BACKGROUNDS:
                if view not in (seen, "all") or background not in (floor, "all"):
                    continue
                style = PictureStyle(size, floor, azimuth, elevation)
                stem, goal = f"{scene.id}-{seen}-{floor}", partial(goal_png, scene, style)
                drawings[f"{stem}.png"] = goal
                if composite:
                    drawings[f"{stem}-composite.png"] = partial(_composite, task, style)
                if gif:
                    drawings[f"{stem}.gif"] = partial(assembly_gif, scene, style)
    folder = OutFolder(out)
    folder.check(drawings)
    for name, make in drawings.items():
        folder.write({name: make()})
    make_console().print(f"{counted(len(drawings), 'file')} in {shown_path(out)}")


def _composite(task: AssemblyTask, style: PictureStyle) -> bytes:
    return composite_png(goal_png(task.scene, style), candidates_png(task.candidates, style))
