"""Words for blocks: what names one is read back as that one; what is close to call is no name."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.data import read_builtin
from phyblock.domain import BLOCK_TYPES, Block, BlockType, Color, QuestionPicture, Scene
from phyblock.making.questions.question_draft import UnfairError
from phyblock.making.questions.referring import (
    SHAPE_WORDS,
    Feature,
    names,
    resolve,
    resolve_one,
    shape_word,
)
from phyblock.resources import bundled

FEATURES: tuple[Feature, ...] = ("color", "type", "size", "layer", "side", "support")
SCENES = [t.scene for t in read_builtin(bundled("benchmarks", "data", "phyblock-400")).tasks][::10]


def block(
    order: int, kind: BlockType, color: Color, y: float = 0.0, z: float = 0.025, layer: int = 1
) -> Block:
    below = (order - 1,) if layer > 1 else ()
    return Block(order, kind, color, (0.0, y, z), (0.0, 0.0, 0.0), below, layer)


def seen(*blocks: Block, azimuth: float = 45.0) -> QuestionPicture:
    return QuestionPicture("scene", blocks, (azimuth, 22.0))


@settings(deadline=None)
@given(st.sampled_from(SCENES), st.sets(st.sampled_from(FEATURES), min_size=1), st.floats(0, 360))
def test_a_name_fits_its_block_alone_and_speaks_of_what_it_may(
    scene: Scene, features: set[Feature], azimuth: float
) -> None:
    picture = QuestionPicture("scene", scene.blocks, (azimuth, 25.0))
    for one in scene.blocks:
        for name in names(one, picture, sorted(features)):
            assert resolve(name, picture) == resolve(name, picture, loosely=True) == (one.order,)
            assert resolve_one(f"the {name}", picture) == one
            if "color" not in features:
                assert not {"red", "yellow", "blue", "green", "orange"} & set(name.split())
            if not {"type", "size"} & features:
                assert not any(word in name for word in SHAPE_WORDS)


def test_the_shortest_names_come_first_and_no_longer_one_says_the_same() -> None:
    blocks = [
        block(1, "cube", "red"),
        block(2, "arch", "red", y=0.2),
        block(3, "cube", "blue", 0.4),
    ]
    assert names(blocks[1], seen(*blocks), ("color", "type", "layer")) == ("arch",)
    assert names(blocks[2], seen(*blocks), ("color", "type")) == ("blue block",)
    assert names(blocks[0], seen(*blocks), ("color", "type")) == ("red cube",)


def test_cubes_and_short_prisms_are_not_told_apart_by_name() -> None:
    blocks = [block(1, "cube", "red"), block(2, "cuboid1", "red", y=0.2), block(3, "arch", "blue")]
    assert not names(blocks[0], seen(*blocks), ("color", "type"))
    with pytest.raises(UnfairError, match="may be taken for another block"):
        resolve_one("red cube", seen(*blocks))


def test_blocks_about_as_far_to_the_left_are_neither_leftmost() -> None:
    near = [block(1, "cube", "red"), block(2, "cube", "blue", y=0.06, z=0.025)]
    apart = [block(1, "cube", "red"), block(2, "cube", "blue", y=0.2, z=0.025)]
    raised = [block(1, "cube", "red"), block(2, "cube", "blue", z=0.075, layer=2)]
    # From azimuth 45 degrees, larger y is to the right.
    assert resolve("leftmost cube", seen(*apart)) == (1,)
    assert resolve("rightmost cube", seen(*apart)) == (2,)
    assert resolve("leftmost cube", seen(*apart, azimuth=225.0)) == (2,)
    assert resolve("leftmost cube", seen(*raised)) == ()
    assert resolve("topmost cube", seen(*raised)) == (2,)
    assert resolve("topmost cube", seen(*near)) == ()


def test_a_support_names_what_rests_on_it_alone() -> None:
    blocks = [
        block(1, "cube", "red"),
        block(2, "cube", "blue", z=0.075, layer=2),
        block(3, "cube", "blue", z=0.125, layer=3),
    ]
    assert resolve("blue cube resting on the red cube", seen(*blocks)) == (2,)
    assert resolve("blue cube in layer 3", seen(*blocks)) == (3,)
    assert resolve("blue cube resting on the blue cube", seen(*blocks)) == ()


@pytest.mark.parametrize("text", ["purple cube", "cube of red", "", "the the cube", "red"])
def test_words_that_are_no_name_are_refused(text: str) -> None:
    with pytest.raises(UnfairError, match="names no block"):
        resolve(text, seen(block(1, "cube", "red")))


def test_every_type_has_one_of_six_words() -> None:
    assert len(SHAPE_WORDS) == 6
    assert {shape_word(kind) for kind in BLOCK_TYPES} == set(SHAPE_WORDS)
