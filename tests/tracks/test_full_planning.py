"""The full-planning track: what is asked, and what a reply is worth."""

import sys
from collections import Counter
from itertools import product
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

import phyblock
from phyblock.domain.scene import AssemblyTask, Candidate, CandidateSet, Plan, Scene
from phyblock.tracks.base import presented
from phyblock.tracks.full_planning import goal_blind_plans, pose_counts
from phyblock.types import MATCHERS
from tests.scoring.cases import block
from tests.tracks.conftest import track_of
from tests.workspace import plan_text


@pytest.fixture(scope="module")
def track(tasks):
    return track_of("full_planning", tasks, scoring={"level1": "selection"})


@given(
    st.none()
    | st.text(max_size=300)
    | st.lists(st.integers(-2, 20), max_size=8).map(lambda n: plan_text(*n))
)
def test_any_reply_is_judged_and_every_goal_block_accounted_for(track, text):
    task = track.items[0]
    fields = track.judge(task, text).fields
    plan = fields["parse"]["plan"] if text is not None else []
    ways = Counter((one["criterion"], one["setting"], one["matcher"]) for one in fields["scores"])
    every = [*product(["aov"], "AB", MATCHERS), *product(["selection"], "AB", [None])]
    assert ways == Counter(every)
    for score in fields["scores"]:
        assert score["tp"] + score["fn"] == len(task.scene)
        assert score["tp"] + score["fp"] == len(plan)
    assert all(1 <= step <= len(task.candidates) for step in plan)


def test_learned_plans_are_those_of_the_order_shown(tasks):
    track = track_of("full_planning", tasks, limit=2, candidates={"order": "shuffled"})
    for seed in (0, 7):
        offered = {task.key: presented(task, seed, "shuffled").candidates for task in tasks}
        plans = goal_blind_plans([task.scene for task in tasks], offered, "A")
        for task in track.items:
            (request,) = track.outlines(track.shown(task, seed))
            assert request.subject.guess() == plans[task.key] != Plan()


@pytest.mark.parametrize(
    ("name", "text"),
    [("full_planning", plan_text(1, 3, 2, 4)), ("vqa", "I see\na cube.\n\nAnswer: B")],
)
def test_a_reply_is_judged_in_ten_modules(name, text):
    track, entered = track_of(name, limit=1), set[str]()
    sys.setprofile(lambda frame, *_: entered.add(frame.f_code.co_filename))
    try:
        assert track.judge(track.items[0], text).is_read
    finally:
        sys.setprofile(None)
    modules = {file for file in entered if file.startswith(str(Path(phyblock.__file__).parent))}
    assert 2 < len(modules) <= 10, sorted(modules)


UP, OVER, ASIDE = (0.0, 0.0, 0.0), (90.0, 0.0, 0.0), (0.0, 0.0, 90.0)
LOOKS = (("cuboid2", "red", UP), ("cuboid2", "red", OVER), ("arch", "blue", ASIDE))
LOOKS += (("arch", "blue", UP), ("cube", "green", UP), ("triangle", "red", UP))
CANDIDATES = CandidateSet(tuple(Candidate(*look) for look in (*LOOKS, ("triangle", "red", OVER))))
BLOCKS = tuple(block(n, LOOKS[place], range(1, n)) for n, place in enumerate((0, 3, 4), 1))


def counted_poses(candidates, plan):
    record = SimpleNamespace(parse=SimpleNamespace(plan=plan))
    return pose_counts(AssemblyTask(Scene("poses", (2,), BLOCKS, ("poses",)), candidates), record)


@pytest.mark.parametrize(
    ("plan", "counts"),
    [
        ([1, 4, 5, 6], (1, 1, 1, 1)),
        ([2, 1, 3, 4], (0, 1, 0, 1)),
        ([4], (0, 0, 1, 1)),
        ([5, 6, 7, 0, 99], (0, 0, 0, 0)),
    ],
)
def test_the_first_pose_named_of_a_kind_counts(plan, counts):
    assert counted_poses(CANDIDATES, plan) == counts


@given(st.lists(st.integers(-1, 9), max_size=10), st.permutations(range(1, 8)))
def test_the_order_of_the_list_moves_choices_between_first_and_later_alone(plan, order):
    shown = CandidateSet(tuple(CANDIDATES[number] for number in order))
    there = [order.index(n) + 1 if 1 <= n <= 7 else n for n in plan]
    counts = [counted_poses(*one) for one in ((CANDIDATES, plan), (shown, there))]
    (right, asked), again = [(a + c, b + d) for a, b, c, d in counts]
    assert (right, asked) == again
    assert right <= asked <= len(set(plan))
