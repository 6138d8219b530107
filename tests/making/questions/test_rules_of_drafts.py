"""Rules by which answers are derived: lengths, turns, layers, hidden blocks, structures alike."""

from __future__ import annotations

import itertools
from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.data import read_builtin
from phyblock.domain import Block, BlockType, Color, QuestionPicture, Scene
from phyblock.domain.blocks import SHAPES, Euler
from phyblock.domain.symmetry import SYMMETRIES, Symmetry, turned_form
from phyblock.making.poses import POSES, transformed
from phyblock.making.questions.affordance import shifted
from phyblock.making.questions.measures import (
    LENGTHS,
    along_and_across_m,
    grid_cm,
    layers_of,
    put_beside,
    sure_blocks,
)
from phyblock.making.questions.question_draft import Draft, UnfairError
from phyblock.making.questions.rotations import AXIS_TURNS, axis_turns, tipped_over
from phyblock.making.questions.viewpoint import ViewpointMaker
from phyblock.resources import bundled
from phyblock.sim.contact import find_overlaps, support_graph
from phyblock.sim.question_pictures import least_difference, seen

SCENES = [t.scene for t in read_builtin(bundled("benchmarks", "data", "phyblock-400")).tasks]
scenes = st.sampled_from(SCENES[::9])


def block(
    order: int,
    place: tuple[float, float, float],
    depend: tuple[int, ...] = (),
    kind: BlockType = "cube",
    color: Color = "red",
    euler: Euler = (0.0, 0.0, 0.0),
) -> Block:
    return Block(order, kind, color, place, euler, depend, 1 + bool(depend))


@given(st.sampled_from([name for name, shape in SHAPES.items() if shape.is_long]), st.data())
def test_a_turn_is_the_one_that_was_made(kind: BlockType, data: st.DataObject) -> None:
    euler = data.draw(st.sampled_from(sorted(POSES[kind].values())))
    lying = block(1, (0, 0, 0.1), kind=kind, euler=euler)
    try:
        turned = tipped_over(lying)
    except UnfairError:
        return
    named = [name for one in turned for name in axis_turns(one, lying)]
    assert axis_turns(lying, lying)[0] == AXIS_TURNS[0]
    assert set(named) == set(AXIS_TURNS)


@settings(max_examples=30, deadline=None)
@given(scenes, st.integers(0, 2**32 - 1))
def test_a_loose_block_stands_free_on_the_ground(scene: Scene, seed: int) -> None:
    loose = put_beside(scene.blocks[0], scene.blocks, np.random.default_rng(seed))
    every = (*scene.blocks, loose)
    assert not find_overlaps(every)
    assert support_graph(every)[loose.order] == {0}
    assert len({one.order for one in every}) == len(every)


@settings(max_examples=40, deadline=None)
@given(scenes)
def test_layers_are_one_more_than_what_is_below(scene: Scene) -> None:
    try:
        layers = layers_of(scene.blocks)
    except UnfairError:
        return
    below = support_graph(scene.blocks)
    for order, layer in layers.items():
        assert layer == 1 + max(layers.get(other, 0) for other in below[order])


@settings(max_examples=40, deadline=None)
@given(scenes, st.sampled_from(SYMMETRIES), st.sampled_from(sorted(LENGTHS)))
def test_lengths_stay_what_they_are_in_a_mirror_and_after_a_turn(
    scene: Scene, symmetry: Symmetry, rule: str
) -> None:
    other = transformed(scene.blocks, symmetry)
    for (a, x), (b, y) in itertools.islice(
        itertools.permutations(zip(scene.blocks, other, strict=True), 2), 20
    ):
        try:
            length = LENGTHS[rule](a, b, scene.blocks)
        except UnfairError:
            continue
        assert LENGTHS[rule](x, y, other) == pytest.approx(length, abs=1e-5)


def test_a_gap_is_measured_between_sides_and_with_nothing_in_it() -> None:
    left, right = block(2, (-0.05, 0, 0.05), (1,)), block(3, (0.05, 0, 0.05), (1,))
    slab = block(1, (0, 0, 0.0125), kind="cuboid3")
    between = block(4, (0, 0, 0.05), (1,), kind="cuboid1")
    assert grid_cm(LENGTHS["gap"](left, right, (slab, left, right))) == 5
    with pytest.raises(UnfairError, match="stands in the gap"):
        LENGTHS["gap"](left, right, (slab, left, right, between))
    assert along_and_across_m(left, slab) == pytest.approx((0.05, 0.0))


def test_a_hidden_block_is_sure_where_one_that_shows_rests_on_it_alone() -> None:
    wall = [block(i, (0.06, y, 0.025)) for i, y in enumerate((-0.05, 0.0, 0.05), 1)]
    low, high = block(5, (0, 0, 0.025)), block(6, (0, 0, 0.075), (5,))
    tower = (*wall, low, high)
    from_front = QuestionPicture("scene", tower, (0.0, 18.0))
    assert sure_blocks(from_front) == 5
    with pytest.raises(UnfairError, match="nothing that can be seen rests on block 5"):
        sure_blocks(QuestionPicture("scene", tower[:-1], (0.0, 18.0)))


@settings(max_examples=5, deadline=None)
@given(scenes, st.integers(0, 2**32 - 1))
def test_a_shifted_block_rests_on_something_and_overlaps_nothing(scene: Scene, seed: int) -> None:
    moved = shifted(scene.blocks, np.random.default_rng(seed))
    if moved is not None:
        assert sum(a != b for a, b in zip(scene.blocks, moved, strict=True)) == 1
        assert not find_overlaps(moved)
        assert all(support_graph(moved).values())


@pytest.fixture(scope="module")
def viewpoints() -> list[Draft]:
    small = [scene for scene in SCENES if len(scene) <= 6][::40]
    maker, rng = ViewpointMaker(), np.random.default_rng(5)
    return [draft for scene in small for draft in maker.drafts(scene, rng)]


def test_options_of_viewpoints_have_the_same_blocks_in_the_same_colors(
    viewpoints: list[Draft],
) -> None:
    assert len(viewpoints) >= 2
    for draft in viewpoints:
        options = [option for option in draft.options if isinstance(option, QuestionPicture)]
        assert len({_contents(option) for option in options}) == 1
        shots = [seen(option) for option in options]
        area = max((shot.block >= 0).sum() for shot in shots)
        assert least_difference(shots) >= 0.1 * area
        forms = Counter(repr(turned_form(option.blocks)) for option in options)
        assert len(forms) == (4 if draft.kind == "vp-match" else len(forms))
        shown = turned_form(draft.pictures[0].blocks)
        right = [turned_form(option.blocks) == shown for option in options]
        assert right[0]
        assert sum(right) == (1 if len(forms) == 4 else 2)


def _contents(picture: QuestionPicture) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Types and colors, each for itself: two blocks may have exchanged their colors."""
    types, colors = zip(*((one.type, one.color) for one in picture.blocks), strict=True)
    return tuple(sorted(types)), tuple(sorted(colors))
