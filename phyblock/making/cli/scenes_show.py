"""`phyblock scenes show`: the facts of one scene."""

from __future__ import annotations

import click

from phyblock.cli.console import make_console, print_rows
from phyblock.cli.options import NAME_OR_PATH
from phyblock.data import AssemblyTask, read_data_set
from phyblock.domain import Block
from phyblock.making.cli.scene_sets import find_scenes
from phyblock.sim.pictures import PictureStyle, visible_shares
from phyblock.text import counted

__all__ = ["command"]


@click.command("show")
@click.argument("data", metavar="PATH", type=NAME_OR_PATH)
@click.argument("scene")
def command(data: str, scene: str) -> None:
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
        what = (str(block.order), block.type, block.color, _below(block))
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


def _below(block: Block) -> str:
    return " ".join(map(str, sorted(block.depend))) or "ground"


def _angles(euler_deg: tuple[float, float, float]) -> str:
    return " ".join(f"{angle:g}" for angle in euler_deg)
