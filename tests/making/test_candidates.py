from collections import Counter
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.domain.blocks import KIT_PALETTE
from phyblock.domain.scene import MAX_CANDIDATES, Candidate, Plan, Scene
from phyblock.errors import DataError
from phyblock.making.scenes.production import NEEDED, Request, draw, make_candidates, shares
from phyblock.making.scenes.sketch import POSES
from phyblock.tracks.full_planning import goal_blind_plans
from phyblock.types import SETTINGS
from tests.scoring.cases import block, plans_f1
from tests.shipped import TASKS

EVERY_LOOK = [(kind, euler) for kind in KIT_PALETTE for euler in POSES[kind[0]].values()]
GAIN = 0.02
"""What a learner may win without seeing the goal: what is left is chance."""
DEVIATIONS = 4.0
"""Of a binomial count, for every one of the some thirty that are looked at."""


def scene_of(looks):
    blocks = tuple(block(i, (*kind, euler)) for i, (kind, euler) in enumerate(looks, 1))
    return Scene("drawn", (4,), blocks, ("drawn",))


BUILT_IN = [(task.scene, task.candidates) for task in TASKS]


@given(
    st.lists(st.sampled_from(EVERY_LOOK), min_size=1, max_size=16).map(scene_of), st.integers(0, 9)
)
def test_all_that_is_needed_is_there_once_and_the_rest_is_in_poses_that_goals_need(scene, seed):
    offered = make_candidates(scene, seed)
    looks = {candidate.look for candidate in offered.candidates}
    assert (offered.missing(scene), len(offered), len(looks)) == ((), *[MAX_CANDIDATES] * 2)
    poses = [(kind, POSES[kind[0]][pose]) for kind in KIT_PALETTE for pose in NEEDED[kind[0]]]
    known = {Candidate(*kind, euler).look for kind, euler in poses}
    assert looks <= {block.look for block in scene.blocks} | known


def test_too_many_different_blocks_are_refused():
    with pytest.raises(DataError, match="at most 16"):
        make_candidates(scene_of(EVERY_LOOK[:17]))


def test_distractors_are_drawn_as_goals_of_the_grammar_need_them():
    """The table of needs holds for the built-in goals, within chance and what seeds differ by."""
    pose = {
        Candidate(kind, color, euler).look: (kind, name)
        for kind, color in KIT_PALETTE
        for name, euler in reversed(POSES[kind].items())
    }
    found = Counter(pose[look] for goal, _ in BUILT_IN for look in {b.look for b in goal.blocks})
    for kind, needs in NEEDED.items():
        for name in POSES[kind]:
            rate = found[kind, name] / len(BUILT_IN)
            assert abs(rate - needs.get(name, 0.0)) < 0.1, (kind, name)


def test_no_place_tells_what_is_needed():
    needed = np.array(
        [
            [one.look in {b.look for b in scene.blocks} for one in offered.candidates]
            for scene, offered in BUILT_IN
        ]
    )
    chance = needed.mean()
    spread = (chance * (1 - chance) / len(needed)) ** 0.5
    assert np.abs(needed.mean(axis=0) - chance).max() < DEVIATIONS * spread


def gain(tasks, setting, repeats):
    """F1 of what is learned over that of naming all candidates once, or all equally often."""
    goals, sets = [scene for scene, _ in tasks], {scene.id: offered for scene, offered in tasks}
    learned = goal_blind_plans(goals, sets, setting, repeats=repeats)
    every = {name: Plan(tuple(range(1, len(one) + 1))) for name, one in sets.items()}
    plain = goal_blind_plans(goals, sets, setting, [lambda _: None]) if repeats else every
    return plans_f1(goals, sets, learned, setting) - plans_f1(goals, sets, plain, setting)


@pytest.mark.parametrize("setting", SETTINGS)
@pytest.mark.parametrize("repeats", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_no_learner_wins_by_the_candidates_of_the_built_in_set(setting, repeats):
    assert gain(BUILT_IN, setting, repeats) <= GAIN


@pytest.mark.slow
@pytest.mark.parametrize("setting", SETTINGS)
def test_nor_by_those_of_a_fresh_set(setting):
    """Base scenes of the grammar from another seed, in the shares of the built-in set."""
    tasks = []
    for share in shares(400):
        goals = (draw(Request(8, "kit", share.group, n)) for n in range(9 * 400))
        for n, goal in enumerate(islice(filter(None, goals), share.base + share.varied)):
            name = f"{share.group}-{n}"
            scene = replace(goal, id=name, parents=(name,))
            tasks.append((scene, make_candidates(scene, 8)))
    assert gain(tasks, setting, repeats=False) <= GAIN
    assert gain(tasks, setting, repeats=True) <= GAIN
