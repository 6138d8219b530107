"""Laws of the built-in baselines."""

from __future__ import annotations

import asyncio
import re
from collections import Counter
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.config.models import ModelConfig
from phyblock.domain import Candidate, CandidateSet, Plan
from phyblock.errors import DataError, SpecError
from phyblock.models import Reply, Request, build_model
from phyblock.tracks.full_planning import PLAN_RULES, PlanSubject
from tests.models.factory import CANDIDATES, SCENE, make_request

PLANNERS = list(PLAN_RULES)
keys = st.text(min_size=1, max_size=5)
seeds = st.integers(0, 10**6)


def reply(name: str, request: Request) -> Reply:
    model = build_model(ModelConfig(name=name), cache=None)
    assert not model.needs_messages
    answer = asyncio.run(model.ask(request))
    assert answer is not None
    return answer


def steps(name: str, request: Request) -> list[int]:
    """The steps of a reply whose every line has the benchmark's form."""
    lines = reply(name, request).text.splitlines()
    read = [re.fullmatch(r"Step(\d+): Move block with index (\d+)", line) for line in lines]
    assert [int(match[1]) for match in read if match] == list(range(1, len(lines) + 1))
    return [int(match[2]) for match in read if match]


@given(keys, seeds)
def test_random_draws_four_candidates(key: str, seed: int) -> None:
    drawn = steps("random", make_request(key, seed))
    assert len(drawn) == 4
    assert all(1 <= index <= len(CANDIDATES) for index in drawn)


@given(keys)
def test_all_candidates_names_each_once(key: str) -> None:
    assert steps("all-candidates", make_request(key)) == [1, 2, 3, 4, 5]


@given(keys, seeds, st.lists(st.integers(1, 5), min_size=1).map(tuple))
def test_goal_blind_says_what_was_learned(key: str, seed: int, plan: tuple[int, ...]) -> None:
    subject = PlanSubject(SCENE, CANDIDATES, lambda: Plan(plan))
    assert steps("goal-blind", replace(make_request(key, seed), subject=subject)) == list(plan)


@given(keys, seeds)
def test_first_pose_names_the_right_kinds_each_in_the_pose_listed_first(
    key: str, seed: int
) -> None:
    subject = PlanSubject(SCENE, CANDIDATES)
    named = steps("first-pose", replace(make_request(key, seed), subject=subject))
    assert Counter(CANDIDATES[n].kind for n in named) == Counter(b.kind for b in SCENE.blocks)
    for n in named:
        assert all(CANDIDATES[other].kind != CANDIDATES[n].kind for other in range(1, n))


@given(keys, seeds)
def test_the_oracle_gives_a_valid_order_of_the_right_looks(key: str, seed: int) -> None:
    given_steps = steps("oracle", make_request(key, seed))
    looks = [CANDIDATES[index].look for index in given_steps]
    order = [[block.look for block in SCENE.blocks].index(look) for look in looks]
    assert SCENE.graph.is_valid(order)


@given(keys, seeds)
def test_without_orientation_only_the_orientation_is_wrong(key: str, seed: int) -> None:
    given_steps = steps("oracle-no-orientation", make_request(key, seed))
    kinds = [CANDIDATES[index].kind for index in given_steps]
    order = [[block.kind for block in SCENE.blocks].index(kind) for kind in kinds]
    assert SCENE.graph.is_valid(order)
    wrong = [
        CANDIDATES[i].look != SCENE.blocks[v].look for i, v in zip(given_steps, order, strict=True)
    ]
    assert wrong == [SCENE.blocks[v].type == "arch" for v in order]


@pytest.mark.parametrize("name", PLANNERS)
def test_what_is_drawn_depends_on_seed_and_key_alone(name: str) -> None:
    many = [make_request(f"{key:03}", seed) for key in range(10) for seed in range(5)]
    forwards = {(r.key, r.seed): reply(name, r) for r in many}
    backwards = {(r.key, r.seed): reply(name, r) for r in reversed(many)}
    assert forwards == backwards
    if name not in ("all-candidates", "goal-blind"):
        assert len({answer.text for answer in forwards.values()}) > 1


def test_an_oracle_without_its_candidate_is_an_error() -> None:
    poor = CandidateSet((Candidate("triangle", "orange", (0.0, 0.0, 0.0)),))
    with pytest.raises(DataError, match="no candidate looks like this block"):
        reply("oracle", replace(make_request(), subject=PlanSubject(SCENE, poor)))


def test_an_unknown_name_is_an_error_that_lists_the_known() -> None:
    with pytest.raises(SpecError, match="oracle-no-orientation"):
        reply("orcale", make_request())
