"""`phyblock scenes stats`: what is in a data set, by level."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import click

from phyblock.cli.console import make_console, print_rows
from phyblock.cli.options import NAME_OR_PATH
from phyblock.data import AssemblyTask, Dataset, read_data_set
from phyblock.domain import BLOCK_TYPES, COLORS, Scene
from phyblock.text import counted

__all__ = ["command"]


@click.command("stats")
@click.argument("data", metavar="PATH", type=NAME_OR_PATH)
def command(data: str) -> None:
    """Show statistics of the data set PATH, by level.

    Sizes, types, colors and layers as mean and most of a scene; blocks of every type and color;
    candidate sets.
    """
    read = read_data_set(data)
    console = make_console()
    scenes, bases = counted(len(read.tasks), "scene"), counted(_bases(read), "base scene")
    console.print(f"{read.name}: {scenes}, {bases}")
    by_level = _by_level(read)
    headings = ("level", "scenes", "blocks", "layers", "types", "colors", "dependencies")
    console.print("A scene has, mean and most")
    print_rows(console, headings, [_sizes(*one) for one in by_level], numbers=6)
    console.print("Blocks, by type and color")
    print_rows(console, ("type", *COLORS, "all", "share"), _palette(read), numbers=7)
    console.print("Candidate sets")
    offered = ("level", "candidates", "needed", "other pose", "other color", "other type")
    print_rows(console, offered, [_offers(*one) for one in by_level], numbers=5)
    console.print(
        "Candidates that are not needed differ from what is needed by their pose alone, else by "
        "their color, else by their type.",
        style="dim",
    )


def _bases(read: Dataset) -> int:
    return len({parent for task in read.tasks for parent in task.scene.parents})


def _by_level(read: Dataset) -> list[tuple[str, list[AssemblyTask]]]:
    """Tasks of every level, a scene of two levels in both, and of all together."""
    levels = sorted({level for task in read.tasks for level in task.scene.levels})
    by_level = [(str(n), [task for task in read.tasks if n in task.scene.levels]) for n in levels]
    return [*by_level, ("all", list(read.tasks))]


def _sizes(level: str, tasks: Sequence[AssemblyTask]) -> tuple[str, ...]:
    scenes = [task.scene for task in tasks]
    columns = (
        [len(scene) for scene in scenes],
        [max(scene.graph.layers) for scene in scenes],
        [len({block.type for block in scene.blocks}) for scene in scenes],
        [len({block.color for block in scene.blocks}) for scene in scenes],
        [_edges(scene) for scene in scenes],
    )
    return (level, str(len(scenes)), *map(_mean_and_most, columns))


def _edges(scene: Scene) -> int:
    return sum(len(block.depend) for block in scene.blocks)


def _palette(read: Dataset) -> list[tuple[str, ...]]:
    kinds = Counter(block.kind for task in read.tasks for block in task.scene.blocks)
    total = sum(kinds.values())
    rows = []
    for block_type in BLOCK_TYPES:
        counts = [kinds[(block_type, color)] for color in COLORS]
        cells = [str(count) if count else "" for count in counts]
        rows.append((block_type, *cells, str(sum(counts)), f"{100 * sum(counts) / total:.1f} %"))
    whole = [sum(kinds[(t, color)] for t in BLOCK_TYPES) for color in COLORS]
    return [*rows, ("all", *map(str, whole), str(total), "")]


def _offers(level: str, tasks: Sequence[AssemblyTask]) -> tuple[str, ...]:
    counts = [_offered(task) for task in tasks]
    return (level, *(_mean_and_most([count[i] for count in counts]) for i in range(5)))


def _offered(task: AssemblyTask) -> tuple[int, int, int, int, int]:
    """Candidates; those needed; and others by what sets them apart: pose, color, type."""
    looks = {block.look for block in task.scene.blocks}
    kinds = {block.kind for block in task.scene.blocks}
    types = {block.type for block in task.scene.blocks}
    all_of_them = task.candidates.candidates
    needed = sum(one.look in looks for one in all_of_them)
    pose = sum(one.look not in looks and one.kind in kinds for one in all_of_them)
    color = sum(one.kind not in kinds and one.type in types for one in all_of_them)
    return len(all_of_them), needed, pose, color, len(all_of_them) - needed - pose - color


def _mean_and_most(numbers: Sequence[int]) -> str:
    return f"{sum(numbers) / len(numbers):.1f} {max(numbers):>3}"
