"""Episodes of step planning: what each reply does, what ends them, what is recorded."""

from __future__ import annotations

import asyncio
import json
import zlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.data import AssemblyTask, read_builtin, read_official
from phyblock.domain import Block, Candidate, CandidateSet, Scene
from phyblock.models.request import Request
from phyblock.parsing.move import MOVE_PROBLEMS, parse_move
from phyblock.records.reply import Reply, Usage
from phyblock.scoring.steps import MOVE_OUTCOMES
from phyblock.tracks.step_planning import (
    ENDINGS,
    STEP_RULES,
    StepEpisode,
    StepLimits,
    StepPlanning,
    StepRules,
    StepSubject,
    Tally,
    majority,
)
from phyblock.types import SETTINGS, Setting
from tests.parsing.test_move import REPLIES

BUILT_IN = Path(__file__).parents[2] / "benchmarks" / "data" / "phyblock-400"
OPEN = StepLimits(failures=None, repeats=None)

Agent = Callable[[Request], Reply | str]


def tower(*colors: str) -> AssemblyTask:
    """Cubes one on another; candidates are five colors of cube, and a red arch that is no use."""
    blocks = tuple(
        Block(i, "cube", c, (0, 0, 0.05 * i - 0.025), (0, 0, 0), (i - 1,) if i > 1 else (), i)  # type: ignore[arg-type]
        for i, c in enumerate(colors, 1)
    )
    cubes = [Candidate("cube", c, (0, 0, 0)) for c in ("red", "yellow", "blue", "green", "orange")]  # type: ignore[arg-type]
    arch = Candidate("arch", "red", (0, 0, 0))
    return AssemblyTask(Scene("tower", (3,), blocks, ("tower",)), CandidateSet((*cubes, arch)))


def seesaw() -> AssemblyTask:
    """A bar that tips unless the second cube is there before it."""
    blocks = (
        Block(1, "cube", "red", (0, 0, 0.025), (0, 0, 0), (), 1),
        Block(2, "cube", "blue", (0.11, 0, 0.025), (0, 0, 0), (), 1),
        Block(3, "cuboid3", "yellow", (0.055, 0, 0.0625), (0, 0, 0), (1,), 2),
    )
    numbered = tuple(Candidate(b.type, b.color, b.euler_deg) for b in blocks)
    return AssemblyTask(Scene("seesaw", (2,), blocks, ("seesaw",)), CandidateSet(numbered))


def scripted(*texts: str) -> Agent:
    """Says these texts one after another, then Done."""
    left = list(texts)
    return lambda _: left.pop(0) if left else "Done"


def baseline(name: str) -> Agent:
    rule = STEP_RULES[name]

    def ask(request: Request) -> str:
        seed = zlib.crc32(f"{name} {request.key} {request.seed}".encode())
        return rule(request.subject, np.random.default_rng(seed))

    return ask


async def _play(episode: StepEpisode, agent: Agent) -> list[Request]:
    requests = []
    while (request := await episode.request()) is not None:
        requests.append(request)
        reply = agent(request)
        episode.take(request, reply if isinstance(reply, Reply) else Reply(text=reply))
        assert len(requests) < 500, "the episode does not end"
    return requests


def play(
    task: AssemblyTask, agent: Agent, rules: StepRules | None = None, seed: int = 0
) -> tuple[dict[str, Any], list[Request]]:
    rules = rules or StepRules(limits=OPEN)
    episode = StepPlanning(rules).start(task, seed, {}, with_messages=False)
    requests = asyncio.run(_play(episode, agent))
    return episode.fields(), requests


def scores(fields: dict[str, Any], criterion: str, setting: Setting = "A") -> tuple[int, int, int]:
    (found,) = [
        s for s in fields["scores"] if (s["criterion"], s["setting"]) == (criterion, setting)
    ]
    return found["tp"], found["fp"], found["fn"]


def test_each_reply_has_its_outcome() -> None:
    fields, requests = play(
        tower("red", "blue", "red"),
        scripted(
            "Move(6)", "Move(3)", "Move(1)", "Move(99)", "hm", "", "Move(1) Move(2)",
            "Move(2)\nDone", "Move(3)", "Next plan: Move(1)",
        ),
        StepRules(limits=StepLimits(steps=20, failures=None)),
    )  # fmt: skip
    assert fields["outcomes"] == [
        *("shape_not_in_gt", "dependency_not_met", "placed", "invalid", "no_move", "empty"),
        *("several_moves", "several_moves", "placed", "placed"),
    ]
    assert fields["ending"] == "completed"
    assert fields["progress"] == [0, 0, 1, 1, 1, 1, 1, 1, 2, 3]
    assert [turn["placed"] for turn in fields["turns"]] == [None, None, 0, *[None] * 5, 1, 2]
    assert fields["turns"][-1]["world"] == [0, 1, 2]
    assert fields["parse"]["plan"] == [6, 3, 1, 99, 3, 1]
    assert scores(fields, "placed") == (3, 0, 0)
    assert scores(fields, "attempted") == (3, 3, 0)
    assert len(requests) == len(fields["turns"]) == 10


@given(
    st.lists(st.sampled_from([*(f"Move({n})" for n in range(1, 7)), "Done"]), max_size=8),
    st.sampled_from([1, 3]),
)
def test_an_episode_goes_the_same_way_in_json(operations: list[str], samples: int) -> None:
    task = tower("red", "blue", "red")
    rules = StepRules(limits=OPEN, samples=samples)
    asked = replace(rules, answer_format="json_schema")
    form = asked.form(len(task.candidates))
    assert form is not None
    told = [form.write(operation, "Move(2) comes later.") for operation in operations]
    (one, _), (other, requests) = play(task, scripted(*operations), rules), play(
        task, scripted(*told), asked
    )  # fmt: skip
    assert all(request.response_format == form.response_format for request in requests)
    said = [turn.pop("parse") for turn in other["turns"]]
    for fields in (one, other):
        for turn in fields["turns"]:
            turn.pop("parse", None)
    assert one == other
    assert {parse["rule"] for parse in said[: len(told)]} <= {"json"}


def test_json_that_is_no_operation_is_a_step_that_fails() -> None:
    rules = StepRules(limits=OPEN, answer_format="json_schema")
    told = ('{"operation": "Move(1)"', '{"operation": 1.5}', '{"operation": "Done"}')
    fields, _ = play(tower("red", "blue"), scripted(*told), rules)
    assert fields["outcomes"] == ["placed", "no_move", "done"]


def test_an_episode_ends_with_done_and_what_is_missing_is_missed() -> None:
    fields, _ = play(tower("red", "blue"), scripted("Move(1)", "Done", "Move(3)"))
    assert (fields["ending"], fields["outcomes"]) == ("done", ["placed", "done"])
    assert scores(fields, "placed") == scores(fields, "attempted") == (1, 0, 1)


def test_no_reply_at_all_is_an_episode_without_steps() -> None:
    episode = StepPlanning(StepRules()).start(tower("red"), 0, {}, with_messages=False)
    assert not episode.is_read
    fields = episode.fields()
    assert (fields["ending"], fields["outcomes"], fields["turns"]) == ("unanswered", [], [])
    assert scores(fields, "placed") == (0, 0, 1)


def usage(text: str, tokens: int | None, usd: float | None) -> Agent:
    return lambda _: Reply(
        text=text,
        usage=Usage(prompt_tokens=tokens, completion_tokens=10 if tokens else None),
        cost_usd=usd,
    )


@pytest.mark.parametrize(
    ("limits", "agent", "ending", "steps"),
    [
        (StepLimits(failures=None, repeats=None), scripted(*["Move(6)"] * 50), "max_steps", 6),
        (StepLimits(steps=4, failures=9), scripted(*["?"] * 50), "max_steps", 4),
        (StepLimits(failures=3, repeats=None), scripted(*["Move(6)"] * 50), "max_failures", 3),
        (StepLimits(failures=2), scripted("Move(1)", "Move(6)", "?", "Move(3)"), "max_failures", 3),
        (StepLimits(failures=9, repeats=2), scripted(*["Move(6)"] * 50), "max_repeats", 2),
        (
            StepLimits(failures=9, repeats=2),
            scripted("Move(6)", "Move(5)", "Move(6)", "Move(6)"),
            "max_repeats",
            4,
        ),
        (StepLimits(tokens=200), usage("Move(1)", 100, None), "max_tokens", 2),
        (StepLimits(usd=0.25), usage("?", None, 0.1), "max_cost", 3),
        (StepLimits(tokens=1, usd=0.01, failures=2), usage("?", None, None), "max_failures", 2),
    ],
)
def test_limits_end_an_episode(limits: StepLimits, agent: Agent, ending: str, steps: int) -> None:
    fields, _ = play(tower("red", "red", "blue"), agent, StepRules(limits=limits))
    assert (fields["ending"], len(fields["outcomes"])) == (ending, steps)


def test_completing_with_the_last_step_is_completing() -> None:
    fields, _ = play(tower("red"), scripted("Move(1)"), StepRules(limits=StepLimits(steps=1)))
    assert fields["ending"] == "completed"


def test_no_hostile_reply_stops_an_episode() -> None:
    """Each of them has its named outcome, and what follows is played as if it had not been."""
    allowed = {*MOVE_OUTCOMES, *MOVE_PROBLEMS, "done"}
    for text, _ in REPLIES:
        fields, _ = play(tower("red", "blue"), scripted(text, "Move(1)", "Move(3)"))
        assert set(fields["outcomes"]) <= allowed, text
        expected = "done" if fields["outcomes"][0] == "done" else "completed"
        assert fields["ending"] == expected, text
        json.dumps(fields, allow_nan=False)


@settings(deadline=None)
@given(st.lists(st.sampled_from(["Move(1)", "Move(3)", "Move(6)", "?", "Move(40)"]), max_size=60))
def test_whatever_is_said_the_default_limits_end_it(texts: list[str]) -> None:
    task = tower("red", "blue", "red", "blue")
    fields, requests = play(task, scripted(*texts), StepRules())
    assert len(requests) <= 8
    assert fields["ending"] in ENDINGS
    tp, fp, fn = scores(fields, "attempted")
    assert tp + fn == 4
    assert tp + fp == len(fields["parse"]["plan"])
    assert tp == fields["outcomes"].count("placed")


@settings(deadline=None)
@given(st.lists(st.sampled_from(["Move(1)", "Move(3)", "Move(6)", "?", "Done"]), max_size=12))
def test_the_same_replies_lead_to_the_same_requests_and_record(texts: list[str]) -> None:
    task = tower("red", "blue", "red", "blue")
    first, second = (play(task, scripted(*texts), StepRules(), seed=3) for _ in range(2))
    assert first == second


@pytest.mark.parametrize("accepts", SETTINGS)
def test_the_oracle_completes_every_built_in_scene(accepts: Setting) -> None:
    """Also where orientations do not matter to the simulator, it makes no mistake in them."""
    for task in read_builtin(BUILT_IN).tasks:
        fields, _ = play(task, baseline("oracle"), StepRules(accepts))
        assert fields["ending"] == "completed"
        for setting in SETTINGS:
            assert scores(fields, "attempted", setting) == (len(task.scene), 0, 0), task.scene.id


def test_the_oracle_completes_every_official_scene(official_checkout: Path) -> None:
    for task in read_official(official_checkout).tasks:
        fields, _ = play(task, baseline("oracle"), StepRules())
        assert fields["ending"] == "completed", task.scene.id
        assert scores(fields, "attempted") == (len(task.scene), 0, 0)


@pytest.mark.parametrize("name", ["random", "repeat"])
def test_agents_that_know_nothing_end_within_the_limits(name: str) -> None:
    endings = set()
    for task in read_builtin(BUILT_IN).tasks[::4]:
        fields, requests = play(task, baseline(name), StepRules())
        assert len(requests) <= 2 * len(task.scene)
        endings.add(fields["ending"])
    assert endings <= {"max_steps", "max_failures", "max_repeats", "completed"}
    assert "max_repeats" in endings or name == "random"


def test_a_turned_block_is_placed_in_b_and_wrong_in_a() -> None:
    """The oracle without orientation: what setting B lets pass is counted in setting A."""
    blocks = (
        Block(1, "arch", "red", (0, 0, 0.025), (0, 0, 0), (), 1),
        Block(2, "cube", "red", (0, 0, 0.075), (0, 0, 0), (1,), 2),
    )
    looks = [("arch", 0), ("arch", 90), ("cube", 0)]
    numbered = tuple(Candidate(t, "red", (0, 0, turn)) for t, turn in looks)  # type: ignore[arg-type]
    task = AssemblyTask(Scene("s", (2,), blocks, ("s",)), CandidateSet(numbered))
    agent = baseline("oracle-no-orientation")
    in_b, _ = play(task, agent, StepRules("B"))
    assert in_b["ending"] == "completed"
    assert in_b["parse"]["plan"] == [2, 3]
    assert (scores(in_b, "placed", "A"), scores(in_b, "placed", "B")) == ((1, 1, 1), (2, 0, 0))
    in_a, _ = play(task, agent, StepRules("A"))
    assert in_a["ending"] == "max_repeats"
    assert set(in_a["outcomes"]) == {"incorrect_orientation"}


@pytest.mark.parametrize(
    ("physics", "ending", "placed"),
    [("off", "completed", (3, 0, 0)), ("settle", "completed", (3, 0, 0)),
     ("strict", "collapsed", (1, 1, 2))],
)  # fmt: skip
def test_a_collapse_ends_an_episode_under_strict_physics_alone(
    physics: Any, ending: str, placed: tuple[int, int, int]
) -> None:
    rules = StepRules(physics=physics, limits=OPEN)
    fields, _ = play(seesaw(), scripted("Move(1)", "Move(3)", "Move(2)"), rules)
    assert fields["ending"] == ending
    assert scores(fields, "placed") == placed
    told = [turn.get("fallen") for turn in fields["turns"]]
    assert told == {"off": [None] * 3, "settle": [[], [3], []], "strict": [[], [3]]}[physics]


def test_under_strict_physics_a_good_order_completes() -> None:
    rules = StepRules(physics="strict")
    fields, _ = play(seesaw(), scripted("Move(1)", "Move(2)", "Move(3)"), rules)
    assert fields["ending"] == "completed"


def test_layers_gate_where_that_is_asked_for() -> None:
    outcomes = {}
    for gating in ("aov", "layer"):
        rules = StepRules(gating=gating, limits=OPEN)  # type: ignore[arg-type]
        fields, _ = play(seesaw(), scripted("Move(1)", "Move(3)", "Move(2)", "Move(3)"), rules)
        outcomes[gating] = fields["outcomes"]
    assert outcomes["aov"] == ["placed"] * 3
    assert outcomes["layer"] == ["placed", "dependency_not_met", "placed", "placed"]


def test_several_samples_a_step_are_voted_on() -> None:
    rules = StepRules(samples=3, limits=OPEN)
    said = scripted("Move(6)", "Move(1)", "So, Move(1)", "?", "Done", "Move(3)", "?", "!", "")
    fields, requests = play(tower("red", "blue", "blue"), said, rules, seed=4)
    assert fields["outcomes"] == ["placed", "done"]
    assert [turn["outcome"] for turn in fields["turns"]] == [
        *(None, "placed", None),
        *(None, "done", None),
    ]
    assert [request.seed for request in requests] == [12, 13, 14] * 2
    keys = [request.key for request in requests]
    assert len(set(keys)) == len(keys) == 6
    assert scores(fields, "attempted") == (1, 0, 2)


def test_a_tie_goes_to_what_was_said_first_and_the_unread_have_no_vote() -> None:
    def chosen(*texts: str) -> int:
        return majority([parse_move(text) for text in texts])

    assert chosen("Move(2)", "Move(1)") == 0
    assert chosen("?", "?", "Move(1)") == 2
    assert chosen("Move(2)", "Move(1)", "Done", "Move(1)") == 1
    assert chosen("?", "") == 0


@settings(max_examples=50, deadline=None)
@given(st.lists(st.tuples(st.integers(1, 3), st.booleans()), max_size=20))
def test_a_tally_counts_runs_of_failures(steps: Sequence[tuple[int, bool]]) -> None:
    tally = Tally()
    for move, is_placed in steps:
        tally.count(move, is_placed=is_placed)
    ends = [place for place, (_, is_placed) in enumerate(steps) if is_placed]
    tail = steps[ends[-1] + 1 :] if ends else steps
    same = next((n for n, s in enumerate(reversed(tail)) if s[0] != tail[-1][0]), len(tail))
    assert (tally.steps, tally.failures, tally.repeats) == (len(steps), len(tail), same)


def test_a_request_tells_baselines_what_is_right() -> None:
    _, requests = play(tower("red", "blue"), scripted("Move(6)", "Move(1)", "Move(3)"))
    subjects = [request.subject for request in requests]
    assert [(s.valid, s.exact, s.last_failed) for s in subjects if isinstance(s, StepSubject)] == [
        ((1,), (1,), None),
        ((1,), (1,), 6),
        ((3,), (3,), None),
    ]


def test_outlines_are_as_many_as_an_episode_can_have() -> None:
    track = StepPlanning(StepRules(samples=2))
    outlines = list(track.outlines(tower("red", "blue")))
    assert len(outlines) == 2 * 4
    assert not any(is_real for _, is_real in outlines), "seeds of samples are not those of runs"
    once = StepPlanning(StepRules()).outlines(tower("red", "blue"))
    assert [is_real for _, is_real in once] == [True, False, False, False]
    few = replace(StepRules(), limits=StepLimits(steps=1))
    assert len(list(StepPlanning(few).outlines(tower("red", "blue")))) == 1
