"""`phyblock scenes render`: pictures of scenes, for people."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path

import click

from phyblock.cli.console import make_console, shown_path
from phyblock.cli.options import NAME_OR_PATH, UserPath
from phyblock.data import AssemblyTask, read_data_set
from phyblock.files import OutFolder
from phyblock.making.cli.scene_sets import find_scenes
from phyblock.sim.camera import VIEWS
from phyblock.sim.film import animation, exploded_png, filmstrip_png
from phyblock.sim.pictures import PictureStyle, candidates_png, composite_png, goal_png
from phyblock.text import counted
from phyblock.types import BACKGROUNDS, Background

__all__ = ["command"]

_Drawing = tuple[str, Callable[[], bytes]]
"""A file's name, and how its bytes are made."""


def _finite(ctx: click.Context, param: click.Parameter, value: float | None) -> float | None:
    if value is not None and math.isnan(value):
        raise click.BadParameter("nan is no angle", ctx, param)
    return value


@click.command("render")
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
    "--azimuth",
    type=click.FloatRange(-360, 360),
    callback=_finite,
    metavar="DEG",
    help="0 looks from +x, 90 from +y.",
)
@click.option(
    "--elevation",
    type=click.FloatRange(1, 90),
    callback=_finite,
    metavar="DEG",
    help="90 looks straight down.",
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
@click.option("--exploded", is_flag=True, help="The structure pulled apart, too.")
@click.option("--filmstrip", is_flag=True, help="All steps in one picture, too.")
@click.option("--gif", is_flag=True, help="The assembly as an animated GIF, too.")
@click.option("--webp", is_flag=True, help="The assembly as an animated WebP, too.")
def command(
    data: str,
    scenes: tuple[str, ...],
    out: Path,
    view: str,
    azimuth: float | None,
    elevation: float | None,
    background: str,
    size: int,
    **extras: bool,
) -> None:
    """Draw the scenes SCENE... of the data set PATH, or all of them.

    Files are named SCENE-VIEW-BACKGROUND-WHAT; it writes over those that it wrote before.
    """
    read = read_data_set(data)
    tasks = find_scenes(read, scenes) if scenes else read.tasks
    styles = _styles(view, azimuth, elevation, background, size)
    wanted = [name for name, is_wanted in extras.items() if is_wanted]
    drawings = {
        f"{task.scene.id}-{name}{what}": make
        for task in tasks
        for name, style in styles.items()
        for what, make in _drawings(task, style, wanted)
    }
    folder = OutFolder(out)
    folder.check(drawings)
    for name, make in drawings.items():
        folder.write({name: make()})
    make_console().print(f"{counted(len(drawings), 'file')} in {shown_path(out)}")


def _styles(
    view: str, azimuth: float | None, elevation: float | None, background: str, size: int
) -> dict[str, PictureStyle]:
    """Every style asked for, by its part of the file names."""
    styles = {}
    floors: tuple[Background, ...] = tuple(b for b in BACKGROUNDS if background in (b, "all"))
    for named, (around, above) in VIEWS.items():
        if view not in (named, "all"):
            continue
        name: str = named
        if azimuth is not None or elevation is not None:
            around = around if azimuth is None else azimuth
            above = above if elevation is None else elevation
            name = f"{around:g}-{above:g}"
        for floor in floors:
            styles[f"{name}-{floor}"] = PictureStyle(size, floor, around, above)
    return styles


def _drawings(task: AssemblyTask, style: PictureStyle, extras: list[str]) -> Iterator[_Drawing]:
    scene, candidates = task.scene, task.candidates
    yield ".png", lambda: goal_png(scene, style)
    makers: dict[str, _Drawing] = {
        "composite": (
            "-composite.png",
            lambda: composite_png(goal_png(scene, style), candidates_png(candidates, style)),
        ),
        "exploded": ("-exploded.png", lambda: exploded_png(scene, style)),
        "filmstrip": ("-filmstrip.png", lambda: filmstrip_png(scene, style)),
        "gif": (".gif", lambda: animation(scene, style, "gif")),
        "webp": (".webp", lambda: animation(scene, style, "webp")),
    }
    yield from (makers[name] for name in extras)
