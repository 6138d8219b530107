"""A sketch pad for structures: put blocks down one after another, as a person builds.

A block is let down from above at a place on the grid, and its height follows from what it lands
on; so a design holds no heights, no overlap and no gap, and its order can be built by hand.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from phyblock.domain.aov import AOVGraph
from phyblock.domain.blocks import SHAPES, BlockType, Color
from phyblock.domain.scene import Block, Scene
from phyblock.making.poses import POSES
from phyblock.sim.geometry import corners_m
from phyblock.sim.support import GROUND, drop_height_m, support_graph, whole_bounds_m

__all__ = ["UNIT_M", "Sketch", "make_scene", "scene_of"]

UNIT_M = 0.025
"""Grid unit [m]: half the side of a cube."""
_ABOVE_M = 1.0


@dataclass
class Sketch:
    """A structure in the making."""

    blocks: list[Block] = field(default_factory=list)

    def put(
        self,
        block_type: BlockType,
        y: float = 0.0,
        x: float = 0.0,
        pose: str = "",
        color: Color | None = None,
    ) -> None:
        """Let a block down with the center of its outline at (x, y) [grid units].

        `pose` is a name from `POSES`, by default the first; `color` by default the kit's.
        """
        poses = POSES[block_type]
        euler = poses[pose] if pose else next(iter(poses.values()))
        corners = corners_m(block_type, (0.0, 0.0, 0.0), euler)
        middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
        place = np.array([x, y]) * UNIT_M - middle[:2]
        above = (float(place[0]), float(place[1]), _ABOVE_M)
        order = len(self.blocks) + 1
        color = color or SHAPES[block_type].kit_colors[0]
        block = Block(order, block_type, color, above, euler, (), 1)
        fall_m = drop_height_m(block, self.blocks)
        landed = tuple(round(c, 6) + 0.0 for c in (above[0], above[1], _ABOVE_M - fall_m))
        self.blocks.append(replace(block, position_m=(landed[0], landed[1], landed[2])))


def make_scene(name: str, levels: tuple[int, ...], blocks: list[Block]) -> Scene:
    """The scene that blocks make, moved so that the middle of its ground plan is the origin.

    Raises CycleError as `scene_of`.
    """
    return scene_of(name, levels, _centered(blocks))


def scene_of(
    name: str, levels: tuple[int, ...], blocks: Sequence[Block], parents: tuple[str, ...] = ()
) -> Scene:
    """The scene that blocks make where they are: dependencies from contact, layers from the longest
    path. Raises CycleError when contacts name no order.
    """
    below = support_graph(blocks)
    number = {block.order: index for index, block in enumerate(blocks)}
    rests_on = [sorted(below[block.order] - {GROUND}) for block in blocks]
    graph = AOVGraph(tuple(frozenset(number[order] for order in orders) for orders in rests_on))
    finished = tuple(
        replace(block, depend=tuple(orders), layer=layer)
        for block, orders, layer in zip(blocks, rests_on, graph.layers, strict=True)
    )
    return Scene(name, levels, finished, parents or (name,))


def _centered(blocks: list[Block]) -> list[Block]:
    low, high = whole_bounds_m(blocks)
    middle = (low + high) / 2
    return [
        replace(
            block,
            position_m=(
                round(block.position_m[0] - float(middle[0]), 6) + 0.0,
                round(block.position_m[1] - float(middle[1]), 6) + 0.0,
                block.position_m[2],
            ),
        )
        for block in blocks
    ]
