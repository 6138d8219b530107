"""Blocks and small structures that tests look at closely."""

import math
from dataclasses import replace

import numpy as np
from hypothesis import strategies as st

from phyblock.domain.blocks import BLOCK_TYPES, BlockType, Color, Euler
from phyblock.domain.scene import Block, Scene
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
) -> Block:
    return Block(order, block_type, color, position_m, euler_deg, (), 1)


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
    cosine, sine = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    moved = []
    for one in blocks:
        x, y, z = one.position_m
        roll, pitch, yaw = one.euler_deg
        place = (cosine * x - sine * y + shift_m[0], sine * x + cosine * y + shift_m[1], z)
        moved.append(replace(one, position_m=place, euler_deg=(roll, pitch, yaw + angle_deg)))
    return moved


@st.composite
def clouds(draw: st.DrawFn) -> list[Block]:
    """One to six blocks anywhere over a square meter, in any orientation."""
    reach = st.floats(-0.5, 0.5)
    return [
        block(i + 1, draw(block_types), (draw(reach), draw(reach), draw(reach) + 0.6), draw(eulers))
        for i in range(draw(st.integers(1, 6)))
    ]


def scene_of(blocks: list[Block], name: str = "test") -> Scene:
    return Scene(name, (3,), tuple(blocks), (name,))
