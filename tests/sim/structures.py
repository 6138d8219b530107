"""Blocks and small structures that tests look at closely."""

from dataclasses import replace

import numpy as np
from hypothesis import strategies as st

from phyblock.domain.blocks import BLOCK_TYPES, BlockType, Color, Euler, euler_deg_to_matrix
from phyblock.domain.scene import Block
from phyblock.making.scenes.sketch import Draft


def built(text: str) -> Draft:
    """A draft with the blocks that a text names, as `Draft.build` reads it."""
    draft = Draft(np.random.default_rng(0))
    draft.build(text)
    return draft


angles_deg = st.floats(-180, 180)
eulers = st.tuples(angles_deg, angles_deg, angles_deg)
block_types = st.sampled_from(BLOCK_TYPES)


def block(
    order: int,
    block_type: BlockType,
    position_m: tuple[float, float, float],
    euler_deg: Euler = (0.0, 0.0, 0.0),
    color: Color = "red",
    depend: tuple[int, ...] = (),
) -> Block:
    """A block, in the second layer if it depends on others."""
    return Block(order, block_type, color, position_m, euler_deg, depend, 1 + bool(depend))


def tower(height: int) -> list[Block]:
    """Cubes on top of one another."""
    return [block(i + 1, "cube", (0.0, 0.0, 0.025 + 0.05 * i)) for i in range(height)]


def counterweighted_beam() -> list[Block]:
    """A plank that tips off its post until the second weight is on: stands only when finished."""
    return [
        block(1, "cube", (0.0, 0.0, 0.025)),
        block(2, "cuboid3", (0.0, 0.0, 0.0625), (0.0, 0.0, 90.0)),
        block(3, "cube", (0.0, 0.07, 0.1)),
        block(4, "cube", (0.0, -0.07, 0.1)),
    ]


def turned(blocks: list[Block], angle_deg: float, shift_m: tuple[float, float]) -> list[Block]:
    """The structure turned about the vertical and then moved on the ground."""
    matrix = euler_deg_to_matrix((0.0, 0.0, angle_deg))
    moved = []
    for one in blocks:
        x, y, z = (matrix @ one.position_m + [*shift_m, 0.0]).tolist()
        roll, pitch, yaw = one.euler_deg
        moved.append(replace(one, position_m=(x, y, z), euler_deg=(roll, pitch, yaw + angle_deg)))
    return moved


@st.composite
def clouds(draw: st.DrawFn, reach_m: float = 0.5, least: int = 1) -> list[Block]:
    """At most six blocks anywhere within a cube over the ground, in any orientation."""
    at = st.floats(-reach_m, reach_m)
    return [
        block(
            i + 1, draw(block_types), (draw(at), draw(at), draw(at) + reach_m + 0.1), draw(eulers)
        )
        for i in range(draw(st.integers(least, 6)))
    ]
