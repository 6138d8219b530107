from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.domain import COLORS, KIT_PALETTE, Block, Candidate, CandidateSet, Plan, Scene
from phyblock.scoring.counts import micro
from phyblock.scoring.plan import Goal, match_plan
from phyblock.tracks.goal_blind import (
    KEYS,
    chances,
    goal_blind_plans,
    related,
    units,
)
from phyblock.types import Setting

KIT = tuple(Candidate(*kind, (0.0, 0.0, 0.0)) for kind in KIT_PALETTE)


def scene(name: str, needed: tuple[Candidate, ...], parents: tuple[str, ...] = ()) -> Scene:
    """Blocks beside one another: any order is right."""
    blocks = tuple(
        Block(order, one.type, one.color, (0.0, 0.0, 0.0), one.euler_deg, (), 1)
        for order, one in enumerate(needed, 1)
    )
    return Scene(name, (2,), blocks, parents or (name,))


def f1(scenes: list[Scene], sets: dict[str, CandidateSet], plans, setting: Setting) -> float:
    counts = [
        match_plan(Goal(one, sets[one.id], setting), plans[one.id], "optimal").counts
        for one in scenes
    ]
    return micro(counts).f1 or 0.0


@st.composite
def drawn_sets(draw: st.DrawFn) -> tuple[list[Scene], dict[str, CandidateSet]]:
    """Scenes of one to three blocks, some of them made from others, each with a set of the kit."""
    scenes: list[Scene] = []
    sets = {}
    for number in range(draw(st.integers(2, 8))):
        offered = draw(st.permutations(KIT))[: draw(st.integers(3, 8))]
        needed = tuple(draw(st.lists(st.sampled_from(offered), min_size=1, max_size=3)))
        names = [one.id for one in scenes]
        parents = draw(st.lists(st.sampled_from(names), max_size=2)) if names else []
        scenes.append(scene(f"s{number}", needed, tuple(dict.fromkeys(parents))))
        sets[f"s{number}"] = CandidateSet(tuple(offered))
    return scenes, sets


@given(drawn_sets(), st.sampled_from(["A", "B"]), st.booleans())
@settings(deadline=None, max_examples=25)
def test_a_plan_names_candidates_of_its_set(drawn, setting: Setting, repeats: bool) -> None:
    scenes, sets = drawn
    plans = goal_blind_plans(scenes, sets, setting, repeats=repeats)
    assert set(plans) == set(sets)
    for name, plan in plans.items():
        assert plan.steps
        assert all(1 <= step <= len(sets[name]) for step in plan.steps)
        assert repeats or len(set(plan.steps)) == len(plan)


@given(drawn_sets(), st.sampled_from(["A", "B"]), st.data())
@settings(deadline=None, max_examples=25)
def test_no_goal_has_a_part_in_what_is_learned_for_its_own_base_scene(
    drawn, setting: Setting, data: st.DataObject
) -> None:
    """Another goal in place of a scene's own changes no chance in the scenes it is related to."""
    scenes, sets = drawn
    at = data.draw(st.integers(0, len(scenes) - 1))
    own = sets[scenes[at].id].candidates
    others = tuple(data.draw(st.lists(st.sampled_from(own), min_size=1, max_size=5)))
    changed = [*scenes[:at], scene(scenes[at].id, others, scenes[at].parents), *scenes[at + 1 :]]
    kin = related(scenes)
    offered = [units(sets[one.id], setting) for one in scenes]
    goals = [[Goal(one, sets[one.id], setting) for one in known] for known in (scenes, changed)]
    for key in KEYS:
        before, after = (chances(offered, known, kin, key) for known in goals)
        for place in kin[at]:
            np.testing.assert_array_equal(before[place], after[place])


@pytest.mark.parametrize("setting", ["A", "B"])
def test_a_planted_tell_is_found(setting: Setting) -> None:
    rng = np.random.default_rng(3)
    scenes, sets = [], {}
    for number in range(40):
        offered = [KIT[int(i)] for i in rng.permutation(len(KIT))[:8]]
        red = [one for one in offered if one.color == COLORS[0]] or offered[:1]
        scenes.append(scene(f"s{number}", tuple(red)))
        sets[f"s{number}"] = CandidateSet(tuple(offered))
    every = {name: Plan(tuple(range(1, 9))) for name in sets}
    learned = goal_blind_plans(scenes, sets, setting)
    evenly = goal_blind_plans(scenes, sets, setting, [lambda _: None])
    assert f1(scenes, sets, learned, setting) > 0.8
    assert f1(scenes, sets, every, setting) < 0.5
    assert f1(scenes, sets, evenly, setting) < 0.5


def test_what_has_none_to_learn_from_names_every_candidate_once() -> None:
    first = scene("s0", KIT[:2])
    scenes = [first, replace(first, id="s1", parents=("s0",))]
    sets = {one.id: CandidateSet(KIT) for one in scenes}
    plan = Plan(tuple(range(1, len(KIT) + 1)))
    assert goal_blind_plans(scenes, sets, "A") == {"s0": plan, "s1": plan}
    assert goal_blind_plans([], {}, "A") == {}


def test_units_are_candidates_in_a_and_kinds_in_b() -> None:
    turned = replace(KIT[0], euler_deg=(0.0, 0.0, 90.0))
    offered = CandidateSet((KIT[0], KIT[1], turned))
    assert [unit.numbers for unit in units(offered, "A")] == [(1,), (2,), (3,)]
    assert [unit.numbers for unit in units(offered, "B")] == [(1, 3), (2,)]
    last = units(offered, "A")[2]
    assert (last.poses, last.rank) == (2, 1)
