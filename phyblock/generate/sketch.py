"""A sketch pad for structures: put blocks down one after another, as a person builds.

A block is let down from above at a place on the grid, and its height follows from what it lands
on; so a design holds no heights, no overlap and no gap, and its order can be built by hand.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from phyblock.domain.aov import AOVGraph
from phyblock.domain.blocks import (
    BlockType,
    Color,
    euler_deg_to_quat_xyzw,
    quat_xyzw_to_matrix,
)
from phyblock.domain.scene import Block, Scene
from phyblock.generate.poses import KIT_COLOR, POSES
from phyblock.sim.geometry import solid_mesh
from phyblock.sim.support import GROUND, drop_height_m, support_graph

__all__ = ["UNIT_M", "Design", "Sketch", "make_scene"]

UNIT_M = 0.025
"""Grid unit [m]: half the side of a cube."""
_ABOVE_M = 1.0


@dataclass
class Sketch:
    """A structure in the making; `origin` shifts all that follows, in grid units (y, x)."""

    blocks: list[Block] = field(default_factory=list)
    origin: tuple[float, float] = (0.0, 0.0)

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
        rotation = quat_xyzw_to_matrix(euler_deg_to_quat_xyzw(euler))
        corners = solid_mesh(block_type).vertices_m @ rotation.T
        middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
        place = np.array([x + self.origin[1], y + self.origin[0]]) * UNIT_M - middle[:2]
        above = (float(place[0]), float(place[1]), _ABOVE_M)
        order = len(self.blocks) + 1
        block = Block(order, block_type, color or KIT_COLOR[block_type], above, euler, (), 1)
        fall_m = drop_height_m(block, self.blocks)
        landed = tuple(round(c, 6) + 0.0 for c in (above[0], above[1], _ABOVE_M - fall_m))
        self.blocks.append(replace(block, position_m=(landed[0], landed[1], landed[2])))

    def pair(
        self,
        block_type: BlockType,
        y: float,
        x: float = 0.0,
        poses: tuple[str, str] = ("", ""),
        color: Color | None = None,
    ) -> None:
        """The same block at -y and at +y, the mirror image when the two poses say so."""
        self.put(block_type, -y, x, poses[0], color)
        self.put(block_type, y, x, poses[1], color)


Design = Callable[[Sketch], None]
"""A structure as the steps that draw it."""


def make_scene(
    name: str, levels: tuple[int, ...], blocks: list[Block], parents: tuple[str, ...] = ()
) -> Scene:
    """The scene that blocks make: dependencies from contact, layers from the longest path.

    The structure is moved so that the middle of its ground plan is the origin. Raises CycleError
    when contacts name no order.
    """
    blocks = _centered(blocks)
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
    corners = []
    for block in blocks:
        rotation = quat_xyzw_to_matrix(euler_deg_to_quat_xyzw(block.euler_deg))
        corners.append(solid_mesh(block.type).vertices_m @ rotation.T + block.position_m)
    points = np.vstack(corners)[:, :2]
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
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
