"""Scenes, blocks and candidate sets."""

from __future__ import annotations

import pytest

from phyblock.domain import Block, Candidate, CandidateSet, Plan, Scene

BASE = Block(7, "cuboid2", "green", (0, 0, 0.0125), (0, 0, 0), (), 1)
TOP = Block(3, "cube", "red", (0, 0, 0.05), (0, 0, 45), (7,), 2)
SCENE = Scene("s", (1, 2), (TOP, BASE), ("s",))
CANDIDATES = CandidateSet(
    (
        Candidate("cube", "red", (0, 0, 0)),
        Candidate("cuboid2", "green", (0, 0, 180)),
        Candidate("cube", "red", (0, 0, 135)),
    )
)


def test_the_graph_follows_orders_not_file_positions() -> None:
    assert SCENE.graph.depends_on == (frozenset({1}), frozenset())
    assert SCENE.graph.layers == (2, 1)


def test_the_level_of_a_scene_is_the_highest_it_counts_in() -> None:
    assert SCENE.level == 2
    assert len(SCENE) == 2


def test_candidates_are_numbered_from_1() -> None:
    assert CANDIDATES[1] is CANDIDATES.candidates[0]
    assert CANDIDATES[3] is CANDIDATES.candidates[2]
    for index in (0, 4, -1):
        with pytest.raises(IndexError, match=rf"candidate {index} is outside 1\.\.3"):
            CANDIDATES[index]


def test_a_candidate_is_found_by_its_look_up_to_symmetry() -> None:
    assert [CANDIDATES.index_of(block.look) for block in SCENE.blocks] == [3, 2]
    assert CANDIDATES.missing(SCENE) == ()
    assert CandidateSet(CANDIDATES.candidates[:2]).missing(SCENE) == (3,)
    assert CANDIDATES.index_of(Candidate("cube", "blue", (0, 0, 0)).look) is None


def test_kind_is_setting_b_and_look_is_setting_a() -> None:
    first, _, third = CANDIDATES.candidates
    assert first.kind == third.kind == TOP.kind
    assert first.look != third.look == TOP.look


def test_a_plan_is_as_long_as_its_steps() -> None:
    assert len(Plan()) == 0
    assert len(Plan((1, 1, 2))) == 3
