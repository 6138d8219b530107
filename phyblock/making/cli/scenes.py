"""`phyblock scenes`: make, check and show data sets."""

from __future__ import annotations

import secrets
import shlex
from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from itertools import chain
from operator import call
from pathlib import Path
from typing import cast

import click
from click.core import ParameterSource
from pydantic import TypeAdapter

from phyblock.cli.console import (
    NAME_OR_PATH,
    UserPath,
    jobs_option,
    left_to_first,
    make_console,
    open_shards,
    print_rows,
    shown_path,
    tracked,
    worker_options,
)
from phyblock.data.base import read_data
from phyblock.data.lookup import find_data_set, read_data_set
from phyblock.data.scenes import SCENES_FILE
from phyblock.domain.scene import AssemblyTask
from phyblock.domain.symmetry import fingerprint
from phyblock.errors import DataError, Problem
from phyblock.files import (
    OutFolder,
    atomic_write,
    bundled_sets,
    check_free,
    make_folder,
    writing,
)
from phyblock.making.checks import (
    FOREIGN_CHECKS,
    VERIFIED,
    check_set,
    verify_foreign,
    verify_scene,
)
from phyblock.making.cli.options import (
    Several,
    begin_set,
    conclude,
    making_options,
    mapped,
    print_engine,
)
from phyblock.making.files import (
    SCENE_FILES,
    check_out,
    check_sums,
    completed_card,
    scene_card,
    write_scenes,
)
from phyblock.making.scenes.candidates import make_candidates
from phyblock.making.scenes.completing import Completed, ReadScene, complete, palette_of, read_given
from phyblock.making.scenes.production import Production, builtin_forms, shares
from phyblock.making.scenes.sketch import PALETTES, Palette, colorless
from phyblock.making.season import Commitment, code_digest, season_seed
from phyblock.records.record import decode
from phyblock.sim.camera import VIEWS
from phyblock.sim.engine import described_engine
from phyblock.sim.film import assembly_gif
from phyblock.sim.pictures import (
    RENDER_VERSION,
    PictureStyle,
    candidates_png,
    composite_png,
    goal_png,
    visible_shares,
)
from phyblock.text import counted, hex_digest
from phyblock.tracks.difficulty import MEASURES
from phyblock.types import BACKGROUNDS
from phyblock.workers import open_workers


@click.group("scenes")
def scenes() -> None:
    """Make data sets of scenes, check them by physics, and show them."""


_LEVELS = ("1", "2", "3", "4", "5+")


@scenes.command("generate")
@click.option("--count", type=click.IntRange(1), default=400, show_default=True, metavar="N")
@click.option("--levels", type=Several(_LEVELS), default="1,2,3,4", show_default=True)
@click.option(
    "--palette",
    type=click.Choice(["kit", "full"]),
    default="kit",
    show_default=True,
    help=f"The kit's {len(PALETTES['kit'])} pairs of type and color, or all pairs.",
)
@click.option(
    "--exclude",
    multiple=True,
    type=NAME_OR_PATH,
    metavar="SET",
    help="Also exclude the scenes of this set, in any colors.",
)
@making_options
def generate(
    count: int,
    levels: tuple[str, ...],
    palette: str,
    exclude: tuple[str, ...],
    seed: int,
    jobs: int,
    ray_address: str | None,
    shard: tuple[int, int] | None,
    out: Path,
) -> None:
    """Make N scenes with candidate sets, each checked by physics, and their data card.

    None equals a scene of the built-in set, or of an excluded SET, even when recolored, turned,
    mirrored or shifted. The same N, seed, levels and palette give the same files with the same
    physics engine, on any Python, any number of processes or a cluster.
    """
    settled = _settled(count, levels, palette, exclude)
    command = f"phyblock scenes generate {settled} --seed {seed} --out {out.name}"
    kind = cast(Palette, palette)
    others = (task.scene for name in exclude for task in read_data_set(name).tasks)
    excluded = builtin_forms().union(colorless(scene.blocks) for scene in others)
    work = f"{command}\n{hex_digest(b''.join(sorted(excluded)))}"
    shards = begin_set(shard, out, SCENE_FILES, work)
    with open_workers(jobs, ray_address, shards) as workers:
        production = Production(seed, kind, workers, excluded)
        produced = production.scenes(shares(count, [int(level[0]) for level in levels]))
        tasks = [
            (scene, make_candidates(scene, palette=PALETTES[kind]))
            for scene in tracked(produced, count, "Making")
        ]
    if left_to_first(shards, out):
        return
    write_scenes(out, tasks, scene_card(out.name, tasks, command, kind, production.rejected))
    click.echo(f"{counted(count, 'scene')}, all checks passed: {shown_path(out)}")
    known = "the built-in set or an excluded one" if exclude else "the built-in set"
    click.echo(f"{counted(production.rejected, 'draft')} rejected: a scene of {known}")
    print_engine()


def _settled(count: int, levels: Sequence[str], palette: str, exclude: Sequence[str]) -> str:
    """Return arguments of generate in canonical form."""
    text = f"--count {count} --levels {','.join(sorted(levels))} --palette {palette}"
    return text + "".join(f" --exclude {shlex.quote(name)}" for name in exclude)


@scenes.command("commit")
@click.argument("arguments", nargs=-1, metavar="-- [ARGUMENT]...")
@click.option(
    "--public", required=True, metavar="TEXT", help="The later public value to use, in words."
)
@click.option("--out", "-o", type=UserPath(), required=True, metavar="DIR", help="Folder to write.")
def commit(arguments: tuple[str, ...], public: str, out: Path) -> None:
    """Commit to a set, by ARGUMENTS of generate, whose seed nobody can choose or know yet.

    Writes DIR/secret.txt, to be kept, and DIR/commitment.json, to be published: digests of the
    secret, of phyblock's code and of the built-in scenes, and the later public value to use.
    """
    settled = season_arguments(arguments)
    files = (out / "secret.txt", out / "commitment.json")
    check_free(files, "give another --out")
    secret = secrets.token_hex(32)
    commitment = Commitment(
        secret_sha256=hex_digest(secret),
        code_sha256=code_digest(),
        engine=described_engine(),
        arguments=settled,
        public=public,
    )
    make_folder(out)
    with writing(out):
        atomic_write(files[0], f"{secret}\n")
        files[0].chmod(0o600)
        atomic_write(files[1], f"{commitment.as_json()}\n")
    click.echo(f"publish {shown_path(files[1])}; keep {shown_path(files[0])}")


@scenes.command("reveal")
@click.argument("commitment", type=UserPath())
@click.argument("secret", type=UserPath())
@click.option("--public", required=True, metavar="VALUE", help="The public value that came later.")
def reveal(commitment: Path, secret: Path, public: str) -> None:
    """Print the command that makes the set of a COMMITMENT, once its SECRET is revealed.

    Refuses another secret, code or physics engine than was committed to.
    """
    meant = decode(TypeAdapter(Commitment), read_data(commitment), str(commitment), Commitment)
    revealed = read_data(secret).decode("ascii", "replace").strip()
    seed = season_seed(meant, revealed, public, str(commitment))
    settled = season_arguments(shlex.split(meant.arguments))
    click.echo(f"phyblock scenes generate {settled} --seed {seed} --out DIR")


def season_arguments(words: Sequence[str]) -> str:
    """Return arguments of generate in canonical form. Raises UsageError if they name a seed, a
    folder, or a set that its maker could still change.
    """
    context = generate.make_context("generate", ["--out", ".", *words])
    given = context.params
    if context.get_parameter_source("seed") is not ParameterSource.DEFAULT:
        raise click.UsageError("A season has no --seed: its secret and the public value give one.")
    if given["out"] != Path("."):
        raise click.UsageError("A season has no --out of generate: reveal prints the command.")
    bundled = bundled_sets(SCENES_FILE)
    if others := [name for name in given["exclude"] if name not in bundled]:
        message = f"{others[0]} can change before the season: exclude a bundled set"
        raise click.UsageError(f"{message} ({', '.join(bundled)}).")
    return _settled(given["count"], given["levels"], given["palette"], given["exclude"])


@scenes.command("compare")
@click.argument("first", metavar="A", type=NAME_OR_PATH)
@click.argument("second", metavar="B", type=NAME_OR_PATH)
def compare(first: str, second: str) -> None:
    """List the scenes of the data set A that B also holds, in any colors.

    Scenes are equal if turning, mirroring and shifting makes one the other, and nearly equal if
    then only colors differ.
    """
    equal: dict[bytes, str] = {}
    nearly: dict[bytes, str] = {}
    for task in read_data_set(second).tasks:
        equal.setdefault(fingerprint(task.scene.blocks), task.key)
        nearly.setdefault(colorless(task.scene.blocks), task.key)
    tasks = read_data_set(first).tasks
    rows = []
    for task in tasks:
        if twin := equal.get(fingerprint(task.scene.blocks)):
            rows.append((task.key, twin, "equal"))
        elif twin := nearly.get(colorless(task.scene.blocks)):
            rows.append((task.key, twin, "equal but for colors"))
    if rows:
        print_rows(make_console(), ("scene of A", "scene of B", ""), rows, numbers=0)
    same = sum(how == "equal" for *_, how in rows)
    click.echo(
        f"of {counted(len(tasks), 'scene')}: {same} equal, {len(rows) - same} equal but for colors"
    )


@scenes.command("complete")
@click.argument("data", metavar="FILE_OR_FOLDER", type=UserPath())
@jobs_option()
@click.option("--out", "-o", type=UserPath(), help="Folder to write.  [default: NAME-set here]")
def complete_set(data: Path, jobs: int, out: Path | None) -> None:
    """Make a data set from scenes that give type, color, position and euler of their blocks.

    FILE_OR_FOLDER is YAML, JSON, or JSON with one scene per line, or a folder of such files.
    Derives dependencies from contacts, and layers and levels from those; draws candidates unless
    they are given. Refuses scenes whose blocks overlap, float or fall. Never overwrites its input.
    """
    given = read_given(data)
    folder = out or Path(f"{data.resolve().stem}-set")
    check_out(folder, SCENE_FILES)
    done = mapped(_completed, given, jobs, "Completing")
    if problems := [problem for one in done if isinstance(one, tuple) for problem in one]:
        raise DataError(problems)
    whole = [one for one in done if isinstance(one, Completed)]
    made = [one.scene for one in whole]
    palette = PALETTES[palette_of(made)]
    tasks = [
        (one.scene, one.offered or make_candidates(one.scene, palette=palette)) for one in whole
    ]
    command = f"phyblock scenes complete {shlex.quote(data.name)} --out {shlex.quote(folder.name)}"
    write_scenes(folder, tasks, completed_card(folder.name, len(tasks), command))
    for one in whole:
        for note in one.notes:
            click.echo(f"note: scene {one.scene.id}: {note}")
    for finding in check_set(made):
        click.echo(f"note: scene {finding.scene}: {finding.field} {finding.message}")
    click.echo(f"{counted(len(tasks), 'scene')} completed: {shown_path(folder)}")
    here = str(folder) if folder.is_absolute() else f"./{folder}"
    click.echo(f"Next: phyblock run quick --set dataset.path={shlex.quote(here)}")


def _completed(read: ReadScene) -> Completed | tuple[Problem, ...]:
    try:
        return complete(read)
    except DataError as error:
        return tuple(error.problems)


@scenes.command("verify")
@click.argument("data", metavar="[PATH]", default="phyblock-400", type=NAME_OR_PATH)
@jobs_option()
def verify(data: str, jobs: int) -> None:
    """Check every number of every scene of PATH by geometry and physics.

    PATH is a folder with scenes.jsonl, an official checkout or a bundled set, by default the
    built-in phyblock-400. Nothing in it is changed.

    Checks contacts, layers, overlaps, gaps, stability of the whole at two time steps and of every
    step, candidates and duplicates. Overlaps and gaps of an official checkout may be 2 mm; all
    other sets are also checked for sizes, hidden blocks, parents and checksums. Exits with 1 when
    anything fails.
    """
    where = find_data_set(data)
    is_official = not (where / SCENES_FILE).is_file()
    read = read_data_set(data)
    tasks = [(task.scene, task.candidates) for task in read.tasks]
    names, work = (*VERIFIED, "duplicate", "parents"), verify_scene
    if is_official:
        names, work = (*FOREIGN_CHECKS, "duplicate"), verify_foreign
    found = [one for one in check_set([scene for scene, _ in tasks]) if one.check in names]
    found += chain.from_iterable(mapped(work, tasks, jobs, "Verifying"))
    failed = Counter(check for _, check in {(one.scene, one.check) for one in found})
    rows = [(check, str(len(tasks) - failed[check]), str(len(tasks))) for check in names]
    files, changed = (0, ()) if is_official else check_sums(where)
    if files:
        rows.append(("checksums", str(files - len(changed)), str(files)))
    rows.append(("all", str(len(tasks) - len({one.scene for one in found})), str(len(tasks))))
    print_rows(make_console(), ("check", "passed", "of"), rows, numbers=2)
    conclude(data, (*(finding.problem for finding in found), *changed))


@scenes.command("show")
@click.argument("data", metavar="PATH", type=NAME_OR_PATH)
@click.argument("scene")
def show(data: str, scene: str) -> None:
    """Show the facts of SCENE in the data set PATH: blocks, layers, dependencies, candidates.

    "on" names the blocks below, "pick" the candidate for the block, "seen" the share of it that is
    visible in the default goal picture.
    """
    task = read_data_set(data).task(scene)
    shown, offered = task.scene, task.candidates
    console = make_console()
    levels, parents = " and ".join(map(str, shown.levels)), ", ".join(shown.parents)
    size = f"{counted(len(shown), 'block')} · {counted(max(shown.graph.layers), 'layer')}"
    heading = f"scene {shown.id} · level {levels} · {size} · made from {parents}"
    console.print(heading, soft_wrap=True)
    numbers = (f"{name} {measure(task):.3g}" for name, measure in MEASURES.items())
    console.print(f"difficulty: {' · '.join(numbers)}", soft_wrap=True)
    seen = visible_shares(shown, PictureStyle())
    blocks = [
        (
            *(str(block.order), block.type, block.color),
            " ".join(map(str, sorted(block.depend))) or "ground",
            " ".join(f"{round(1000 * c, 1) + 0.0:g}" for c in block.position_m),
            _angles(block.euler_deg),
            *(str(block.layer), str(offered.index_of(block.look)), f"{seen[block.order]:.0%}"),
        )
        for block in shown.blocks
    ]
    columns: tuple[str, ...]
    columns = ("block", "type", "color", "on", "position mm", "euler deg", "layer", "pick", "seen")
    print_rows(console, columns, blocks, numbers=3)
    looks = Counter(block.look for block in shown.blocks)
    candidates = [
        (str(number), one.type, one.color, _angles(one.euler_deg), str(looks[one.look] or ""))
        for number, one in enumerate(offered.candidates, 1)
    ]
    columns = ("candidate", "type", "color", "euler deg", "needed")
    print_rows(console, columns, candidates, numbers=1)


def _angles(euler_deg: tuple[float, float, float]) -> str:
    return " ".join(f"{angle:g}" for angle in euler_deg)


@scenes.command("render")
@click.argument("data", metavar="PATH", type=NAME_OR_PATH)
@click.argument("scenes", metavar="[SCENE]...", nargs=-1)
@click.option("--out", "-o", type=UserPath(file_okay=False), required=True, metavar="DIR")
@click.option("--view", type=click.Choice([*VIEWS, "all"]), default="oblique", show_default=True)
@click.option(
    "--background",
    type=click.Choice([*BACKGROUNDS, "all"]),
    default="checkerboard",
    show_default=True,
)
@click.option("--composite", is_flag=True, help="Goal and candidates side by side, too.")
@click.option("--gif", is_flag=True, help="The assembly as an animated GIF, too.")
@worker_options()
def render(
    data: str,
    scenes: tuple[str, ...],
    out: Path,
    view: str,
    background: str,
    composite: bool,
    gif: bool,
    jobs: int,
    ray_address: str | None,
    shard: tuple[int, int] | None,
) -> None:
    """Draw the scenes SCENE... of the data set PATH, or all of them, at 512 by 512 pixels.

    Files are named SCENE-VIEW-BACKGROUND; earlier ones of this command are overwritten.
    """
    read = read_data_set(data)
    views = [name for name in VIEWS if view in (name, "all")]
    floors = [name for name in BACKGROUNDS if background in (name, "all")]
    drawings: dict[str, Callable[[], bytes]] = {}
    for task in map(read.task, scenes) if scenes else read.tasks:
        for seen in views:
            for floor in floors:
                style = PictureStyle(512, floor, *VIEWS[seen])
                stem = f"{task.scene.id}-{seen}-{floor}"
                drawings[f"{stem}.png"] = partial(goal_png, task.scene, style)
                if composite:
                    drawings[f"{stem}-composite.png"] = partial(_composite, task, style)
                if gif:
                    drawings[f"{stem}.gif"] = partial(assembly_gif, task.scene, style)
    folder = OutFolder(out)
    folder.check(drawings)
    work = f"scenes render: {read.sha256} {hex_digest(repr([RENDER_VERSION, *drawings]))}\n"
    shards = open_shards(shard, out, work)
    with open_workers(jobs, ray_address, shards) as workers:
        drawn = tracked(workers.map(call, drawings.values()), len(drawings), "Drawing")
        for name, picture in zip(drawings, drawn, strict=True):
            if shards is None or shards.writes:
                folder.write({name: picture})
    if left_to_first(shards, out):
        return
    click.echo(f"{counted(len(drawings), 'file')} in {shown_path(out)}")


def _composite(task: AssemblyTask, style: PictureStyle) -> bytes:
    return composite_png(goal_png(task.scene, style), candidates_png(task.candidates, style))
