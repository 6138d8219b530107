from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.domain import BLOCK_TYPES, SHAPES, Block
from phyblock.domain.symmetry import SYMMETRIES, Symmetry, canonical_form
from phyblock.making.scenes.sketch import POSES, transformed
from phyblock.sim.contact import find_overlaps, support_graph
from phyblock.sim.pictures import drawn_m
from tests.designs import designed_scenes

SCENES = designed_scenes()
EVERY_POSE = [(kind, euler) for kind in BLOCK_TYPES for euler in POSES[kind].values()]
angles = st.floats(-180, 180).map(lambda angle: round(angle, 3))
poses = st.sampled_from(EVERY_POSE) | st.tuples(
    st.sampled_from([kind for kind in BLOCK_TYPES if not SHAPES[kind].is_round]),
    st.tuples(angles, st.sampled_from([-90.0, 0.0, 90.0]) | angles, angles),
)
structures = st.sampled_from(SCENES).map(lambda scene: scene.blocks)


def block_at(kind, euler) -> Block:
    return Block(1, kind, "red", (0.03, -0.11, 0.2), euler, (), 1)


def corners(block: Block) -> np.ndarray:
    return drawn_m(block)


def apart_m(first: np.ndarray, second: np.ndarray) -> float:
    distances = np.linalg.norm(first[:, None] - second[None], axis=2)
    return float(max(distances.min(axis=0).max(), distances.min(axis=1).max()))


@given(poses, st.sampled_from(SYMMETRIES))
@settings(deadline=None)
def test_the_image_of_a_block_fills_the_image_of_its_space(pose, symmetry: Symmetry) -> None:
    block = block_at(*pose)
    (image,) = transformed([block], symmetry)
    # An upright cylinder turned by 90 degrees has its 18 corners halfway between: 4.4 mm away.
    tolerance_m = 0.005 if SHAPES[block.type].is_round else 1e-5
    assert apart_m(corners(block) @ symmetry.matrix.T, corners(image)) < tolerance_m


@pytest.mark.parametrize("symmetry", SYMMETRIES)
def test_known_poses_map_to_known_poses_one_to_one(symmetry: Symmetry) -> None:
    for kind in BLOCK_TYPES:
        images = [transformed([block_at(kind, e)], symmetry)[0] for e in POSES[kind].values()]
        assert sorted(image.euler_deg for image in images) == sorted(POSES[kind].values())


@given(structures, st.sampled_from(SYMMETRIES), st.tuples(angles, angles), st.randoms())
@settings(deadline=None)
def test_the_form_is_kept_by_turning_mirroring_shifting_and_order(
    blocks, symmetry, shift, random
) -> None:
    step_m = 0.001
    moved = [
        replace(b, position_m=(x + shift[0] * step_m, y + shift[1] * step_m, z))
        for b in transformed(blocks, symmetry)
        for x, y, z in [b.position_m]
    ]
    random.shuffle(moved)
    assert canonical_form(moved) == canonical_form(blocks)


@given(structures, st.integers(0, 50))
@settings(deadline=None)
def test_another_color_or_place_is_another_form(blocks, pick: int) -> None:
    block = blocks[pick % len(blocks)]
    other = replace(block, color="red" if block.color != "red" else "blue")
    x, y, z = block.position_m
    raised = replace(block, position_m=(x, y, z + 0.003))
    for changed in (other, raised):
        whole = [changed if b is block else b for b in blocks]
        assert canonical_form(whole) != canonical_form(blocks)


@given(structures, st.sampled_from(SYMMETRIES))
@settings(deadline=None, max_examples=25)
def test_contacts_are_kept(blocks, symmetry: Symmetry) -> None:
    image = transformed(blocks, symmetry)
    assert support_graph(image) == support_graph(blocks)
    assert find_overlaps(image) == find_overlaps(blocks)
