from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.domain import KIT_PALETTE, MAX_CANDIDATES, Block, Candidate, Scene
from phyblock.errors import DataError
from phyblock_making.poses import POSES
from phyblock_making.scenes import make_candidates
from tests.designs.scenes import designed_scene

EVERY_LOOK = [(kind, euler) for kind in KIT_PALETTE for euler in POSES[kind[0]].values()]


def scene_of(looks) -> Scene:
    blocks = tuple(
        Block(i, block_type, color, (0.0, 0.0, 0.0), euler, (), 1)
        for i, ((block_type, color), euler) in enumerate(looks, 1)
    )
    return Scene("drawn", (4,), blocks, ("drawn",))


scenes = st.lists(st.sampled_from(EVERY_LOOK), min_size=1, max_size=16).map(scene_of)


@given(scenes, st.integers(0, 9))
@settings(deadline=None)
def test_all_that_is_needed_is_there_and_no_look_twice(scene: Scene, seed: int) -> None:
    candidates = make_candidates(scene, seed)
    assert candidates.missing(scene) == ()
    assert len({block.look for block in scene.blocks}) <= len(candidates) <= MAX_CANDIDATES
    assert len({candidate.look for candidate in candidates.candidates}) == len(candidates)


@given(scenes)
@settings(deadline=None)
def test_a_distractor_differs_by_one_attribute(scene: Scene) -> None:
    needed = {block.look for block in scene.blocks}
    for candidate in make_candidates(scene).candidates:
        assert candidate.kind in KIT_PALETTE
        if candidate.look not in needed:
            assert any(_differ(candidate, block) for block in scene.blocks)


def _differ(candidate: Candidate, block: Block) -> bool:
    """In orientation alone, in color alone, or in type (a pose of another type is another pose)."""
    if candidate.type != block.type:
        return candidate.color == block.color
    return (candidate.color == block.color) != (candidate.look[2] == block.look[2])


@given(scenes)
@settings(deadline=None)
def test_the_order_tells_nothing_about_being_needed(scene: Scene) -> None:
    """Sorted by type, color and pose: an order that does not depend on what is needed."""
    chosen = list(make_candidates(scene).candidates)
    place = {(kind, euler): i for i, (kind, euler) in enumerate(_library())}
    places = [place[candidate.kind, candidate.euler_deg] for candidate in chosen]
    assert places == sorted(places)


def _library():
    kinds = sorted(KIT_PALETTE, key=lambda kind: (list(POSES).index(kind[0]), _color(kind[1])))
    return [(kind, euler) for kind in kinds for euler in POSES[kind[0]].values()]


def _color(color: str) -> int:
    return ["red", "yellow", "blue", "green", "orange"].index(color)


def test_seeds_give_other_distractors_and_the_same_seed_the_same() -> None:
    scene = designed_scene("l4-harbor")
    assert make_candidates(scene, 1) == make_candidates(scene, 1)
    assert len({make_candidates(scene, seed) for seed in range(5)}) > 1


@given(scenes)
@settings(deadline=None)
def test_colors_and_types_take_two_places_unless_orientations_run_out(scene: Scene) -> None:
    kinds = {block.kind for block in scene.blocks}
    chosen = make_candidates(scene).candidates
    looks = {candidate.look for candidate in chosen}
    if sum(candidate.kind not in kinds for candidate in chosen) > 2:
        poses = [Candidate(*kind, euler) for kind in kinds for euler in POSES[kind[0]].values()]
        assert all(candidate.look in looks for candidate in poses)


def test_too_many_different_blocks_are_refused() -> None:
    with pytest.raises(DataError, match="at most 16"):
        make_candidates(scene_of(EVERY_LOOK[:17]))


def test_angles_from_elsewhere_are_kept_as_they_are() -> None:
    """An official scene may name an orientation in its own way; the candidate keeps the name."""
    scene = scene_of([(("arch", "red"), (0.0, 180.0, 180.0))])
    assert Candidate("arch", "red", (0.0, 180.0, 180.0)) in make_candidates(scene).candidates
