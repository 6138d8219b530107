"""Plans carried out: how steps end, in every engine that is installed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.domain import Block, BlockType, euler_deg_to_matrix
from phyblock.domain.blocks import SHAPES
from phyblock.scoring.pose import blocks_reached, overlap_volume, placed
from phyblock.sim.contact import VOXEL_M, filled_voxels, find_overlaps, voxel_iou
from phyblock.sim.dynamics import ExecutionLimits, execute
from phyblock.sim.engine import (
    PhysicsEngine,
    installed_engines,
    physics_engine,
)
from phyblock.tracks.pose_planning import pieces_of
from tests.sim.structures import block, counterweighted_beam, tower

CREEP_M_S = 0.0015


@pytest.fixture(params=installed_engines(), scope="module")
def engine(request: pytest.FixtureRequest) -> PhysicsEngine:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PHYBLOCK_PHYSICS", request.param)
        return physics_engine()


def at(one: Block, x_m: float, y_m: float, z_m: float) -> Block:
    return replace(one, position_m=(x_m, y_m, z_m))


def ends(blocks: list[Block | None], engine: PhysicsEngine, **limits: float) -> list[str]:
    return [step.end for step in execute(blocks, ExecutionLimits(**limits), engine).steps]


def test_a_tower_stands_in_its_order_and_falls_in_the_opposite_one(engine: PhysicsEngine) -> None:
    done = execute(tower(3), engine=engine)
    assert [step.end for step in done.steps] == ["stands"] * 3
    assert [len(world) for world in done.worlds] == [1, 2, 3]
    assert voxel_iou(tower(3), done.blocks) == 1
    assert blocks_reached(tower(3), done.blocks, 1, 10) == 3
    assert ends(tower(3)[::-1], engine)[0] == "falls"


def test_what_floats_falls_as_far_as_the_gap_below_it(engine: PhysicsEngine) -> None:
    (step,) = execute([at(tower(1)[0], 0, 0, 0.065)], engine=engine).steps
    assert (step.end, step.gap_cm, step.overlap_cm) == ("falls", pytest.approx(4), 0)
    assert step.moved_cm == pytest.approx(4, abs=0.1)


def test_overlaps_beyond_the_tolerance_are_refused_and_smaller_ones_give_way(
    engine: PhysicsEngine,
) -> None:
    first = tower(1)[0]
    deep, slight = at(first, 0.03, 0, 0.025), at(first, 0.046, 0, 0.025)
    assert ends([first, deep, slight], engine) == ["stands", "overlaps", "stands"]
    assert ends([first, slight], engine, overlap_cm=0.3) == ["stands", "overlaps"]
    done = execute([first, deep, slight], engine=engine)
    assert [len(world) for world in done.worlds] == [1, 1, 2]
    assert done.steps[1].overlap_cm == pytest.approx(2, abs=0.01)
    assert done.steps[2].overlap_cm == pytest.approx(0.4, abs=0.05)
    assert done.blocks[1].position_m[0] == pytest.approx(0.05, abs=0.001)


def test_what_is_under_the_floor_or_no_block_is_not_put(engine: PhysicsEngine) -> None:
    first = tower(1)[0]
    blocks = [at(first, 0, 0, 0.01), at(first, 0, 0, -0.5), None, at(first, 0, 0, 0.0215)]
    done = execute(blocks, engine=engine)
    found = [step.end for step in done.steps]
    assert found == ["under_floor", "under_floor", "no_block", "stands"]
    assert done.blocks[0].order == 4


def test_who_is_knocked_over_is_named_and_stays_so(engine: PhysicsEngine) -> None:
    beam = counterweighted_beam()
    done = execute([*beam[:3], None, beam[0]], engine=engine)
    assert [step.end for step in done.steps[:2]] == ["stands", "stands"]
    assert done.steps[2].end == "knocks_over"
    assert done.steps[2].knocked == (2,)
    lying = {one.order: one for one in done.worlds[3]}
    assert lying == {one.order: one for one in done.worlds[2]}
    assert blocks_reached(beam, done.blocks, 1, 10) < len(beam)


def test_the_same_plan_ends_the_same_to_the_last_digit_whatever_came_before(
    engine: PhysicsEngine,
) -> None:
    beam: list[Block | None] = [*counterweighted_beam()[:3]]
    first = execute(beam, engine=engine)
    execute(tower(2), engine=engine)
    assert execute(beam, engine=engine) == first


def test_what_stands_elsewhere_changes_no_verdict(engine: PhysicsEngine) -> None:
    far = [
        block(1, "arch", (-0.005, 0.0375, 0.025), (0.0, 0.0, 90.0)),
        block(2, "arch", (-0.005, 0.0875, 0.025), (0.0, 0.0, 90.0)),
        block(3, "cuboid2", (0.02, 0.0625, 0.0625), (0.0, 0.0, 90.0)),
        block(4, "cuboid2", (-0.03, 0.0625, 0.0625), (0.0, 0.0, 90.0)),
        block(5, "cylinder", (0.02, 0.0625, 0.125)),
        block(6, "triangle", (0.02, 0.0625, 0.175), (0.0, 0.0, 90.0)),
    ]
    # A cylinder on a plank lies on one of its narrow faces, from which little makes it roll.
    lying = [
        block(1, "cylinder", (0.0375, -0.0625, 0.02462), (90.0, 0.0, 0.0)),
        block(2, "cylinder", (-0.0375, -0.0625, 0.02462), (90.0, 0.0, 0.0)),
        block(3, "cuboid3", (0.0, -0.0625, 0.06174)),
        block(4, "cube", (-0.05, -0.0625, 0.09924)),
        block(5, "cylinder", (0.025, -0.0625, 0.09886), (90.0, 0.0, 90.0)),
    ]
    for near in (lying, [at(tower(1)[0], 0.0, -0.1, 0.065)]):
        alone, beside = execute(near, engine=engine), execute([*far, *near], engine=engine)
        assert beside.steps[len(far) :] == alone.steps
        assert [one.position_m for one in beside.blocks[len(far) :]] == [
            one.position_m for one in alone.blocks
        ]


def test_what_falls_upon_others_that_stand_apart_moves_them(engine: PhysicsEngine) -> None:
    low, post = at(tower(1)[0], 0.11, 0.0, 0.025), block(1, "cube", (0.0, 0.0, 0.025))
    plank = block(2, "cuboid3", (0.0, 0.0, 0.125), (0.0, 90.0, 0.0))
    leaning = replace(plank, position_m=(0.03, 0.0, 0.125))
    done = execute([low, post, leaning], engine=engine)
    assert [step.end for step in done.steps[:2]] == ["stands", "stands"]
    assert done.steps[2].end in ("falls", "knocks_over")
    assert not find_overlaps(done.blocks, 0.002)


@settings(max_examples=40)
@given(
    st.sampled_from(("cube", "cuboid2", "triangle", "arch", "cylinder")),
    st.tuples(*[st.floats(-0.03, 0.03, allow_nan=False)] * 3),
    st.floats(0.0, 90.0, allow_nan=False),
)
def test_voxels_know_what_two_blocks_share_nearly(
    kind: BlockType, way_m: tuple[float, float, float], turn_deg: float
) -> None:
    one = block(1, kind, (0.01, 0.02, 0.06))
    x, y, z = one.position_m
    dx, dy, dz = way_m
    other = replace(one, position_m=(x + dx, y + dy, z + dz), euler_deg=(0.0, 0.0, turn_deg))
    pieces = [
        placed(pieces_of(kind), euler_deg_to_matrix(b.euler_deg), np.array(b.position_m))
        for b in (one, other)
    ]
    shared = overlap_volume(*pieces)
    iou = shared / (2 * SHAPES[kind].volume_m3 - shared)
    assert voxel_iou([one], [other]) == pytest.approx(iou, abs=0.08)
    assert voxel_iou([one], [one]) == 1


def test_a_voxel_counts_by_how_much_of_it_a_block_fills() -> None:
    cube = block(1, "cube", (0.0, 0.0, 0.025))
    assert len(filled_voxels([cube])[0]) == round((0.05 / VOXEL_M) ** 3)
    assert voxel_iou([cube], [at(cube, 0.025, 0, 0.025)]) == pytest.approx(1 / 3)
    assert voxel_iou([cube], [at(cube, 0, 0, 0.02625)]) == pytest.approx(39 / 41)
    assert voxel_iou([cube, cube], [cube]) == 1
    assert voxel_iou([], []) == 1
    assert voxel_iou([cube], []) == 0
