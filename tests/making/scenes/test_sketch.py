from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.domain import BLOCK_TYPES, orientation_class
from phyblock.making.poses import POSES
from phyblock.making.scenes.sketch import make_scene
from phyblock.sim.contact import find_gaps, find_overlaps, support_graph
from tests.designs.pad import Pad
from tests.designs.scenes import designed_scenes

grid = st.integers(-3, 3)
steps = st.lists(
    st.sampled_from(BLOCK_TYPES).flatmap(
        lambda block_type: st.tuples(
            st.just(block_type), grid, grid, st.sampled_from(sorted(POSES[block_type]))
        )
    ),
    min_size=1,
    max_size=8,
)


@given(steps)
@settings(max_examples=40, deadline=None)
def test_whatever_is_put_down_neither_overlaps_nor_floats(drawn) -> None:
    sketch = Pad()
    for block_type, y, x, pose in drawn:
        sketch.put(block_type, y, x, pose)
    assert find_overlaps(sketch.blocks, 1e-5) == ()
    assert find_gaps(sketch.blocks, 1e-5) == ()


@pytest.mark.parametrize("block_type", BLOCK_TYPES)
def test_poses_of_a_type_look_different(block_type) -> None:
    poses = POSES[block_type].values()
    assert len({orientation_class(block_type, euler) for euler in poses}) == len(poses)


def test_a_scene_is_centered_and_its_graph_comes_from_contact() -> None:
    sketch = Pad(origin=(20.0, -8.0))
    sketch.pair("cube", 2)
    sketch.put("cuboid3", pose="flat-y")
    scene = make_scene("test", (1,), sketch.blocks)
    assert [block.depend for block in scene.blocks] == [(), (), (1, 2)]
    assert [block.layer for block in scene.blocks] == [1, 1, 2]
    assert scene.blocks[2].position_m == (0.0, 0.0, 0.0625)
    assert scene.parents == ("test",)


def test_designs_declare_what_contact_says() -> None:
    for scene in designed_scenes():
        below = support_graph(scene.blocks)
        for block, layer in zip(scene.blocks, scene.graph.layers, strict=True):
            assert set(block.depend) == below[block.order] - {0}
            assert block.layer == layer
