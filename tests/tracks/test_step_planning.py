"""Step planning: what each reply does, what ends an episode, what is recorded and what is asked."""

import asyncio
import functools
import json
import zlib
from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.domain.scene import AssemblyTask, Candidate, CandidateSet, Scene
from phyblock.models.request import Image
from phyblock.parsing.answer import MOVE_PROBLEMS
from phyblock.records.record import Reply
from phyblock.scoring.steps import MOVE_OUTCOMES
from phyblock.tracks.pictures import Workshop
from phyblock.tracks.step_planning import ENDINGS, Feedback, PastStep, StepPlanning
from phyblock.types import SETTINGS
from tests.parsing.test_replies import ROWS
from tests.shipped import TASKS, official_tasks
from tests.sim.structures import block
from tests.sim.structures import tower as stacked
from tests.tracks.conftest import seesaw, track_of

OPEN = {"max_failures": None, "max_repeats": None}


@functools.cache
def made(form="text", **steps):
    """The track; nothing is simulated unless that is asked for."""
    fields = {"answer_format": form, "steps": {"physics": "off", **steps}}
    return track_of("step_planning", TASKS[:1], **fields)


def tower(*colors):
    """Cubes one on another; candidates are five colors of cube, and a red arch that is no use."""
    blocks = tuple(
        replace(one, color=color, depend=(i,) if i else (), layer=i + 1)
        for i, (one, color) in enumerate(zip(stacked(len(colors)), colors, strict=True))
    )
    looks = [("cube", color) for color in ("red", "yellow", "blue", "green", "orange")]
    numbered = tuple(Candidate(*look, (0, 0, 0)) for look in (*looks, ("arch", "red")))
    return AssemblyTask(Scene("tower", (3,), blocks, ("tower",)), CandidateSet(numbered))


def scripted(*texts):
    """Says these texts one after another, then Done."""
    left = list(texts)
    return lambda _: left.pop(0) if left else "Done"


def baseline(name):
    rule = StepPlanning.baselines[name]

    def ask(request):
        seed = zlib.crc32(f"{name} {request.key} {request.seed}".encode())
        return rule(request.subject, np.random.default_rng(seed))

    return ask


def play(task, agent, track=None, seed=0, *, with_messages=False):
    episode = (track or made(**OPEN)).start(task, seed, {}, with_messages=with_messages)

    async def requests():
        asked = []
        while (request := await episode.request()) is not None:
            asked.append(request)
            reply = agent(request)
            episode.take(reply if isinstance(reply, Reply) else Reply(text=reply))
            assert len(asked) < 500, "the episode does not end"
        return asked

    asked = asyncio.run(requests())
    return dict(episode.judgement().fields), asked


def scores(fields, criterion, setting="A"):
    ways = {(s["criterion"], s["setting"]): (s["tp"], s["fp"], s["fn"]) for s in fields["scores"]}
    return ways[criterion, setting]


def test_each_reply_has_its_outcome():
    fields, requests = play(
        tower("red", "blue", "red"),
        scripted(
            "Move(6)", "Move(3)", "Move(1)", "Move(99)", "hm", "", "Move(1) Move(2)",
            "Move(2)\nDone", "Move(3)", "Next plan: Move(1)",
        ),
        made(max_steps=20, max_failures=None),
    )  # fmt: skip
    assert fields["outcomes"] == [
        *("shape_not_in_gt", "dependency_not_met", "placed", "invalid", "no_move", "empty"),
        *("several_moves", "several_moves", "placed", "placed"),
    ]
    assert (fields["ending"], len(requests)) == ("completed", 10)
    assert [turn["placed"] for turn in fields["turns"]] == [None, None, 0, *[None] * 5, 1, 2]
    assert fields["turns"][-1]["world"] == [0, 1, 2]
    assert fields["parse"]["plan"] == [6, 3, 1, 99, 3, 1]
    assert (scores(fields, "placed"), scores(fields, "attempted")) == ((3, 0, 0), (3, 3, 0))


@given(st.lists(st.sampled_from([*(f"Move({n})" for n in range(1, 7)), "Done"]), max_size=8))
def test_an_episode_goes_the_same_way_in_json(operations):
    task = tower("red", "blue", "red")
    text, asked = (made(form, **OPEN) for form in ("text", "json_schema"))
    form = asked.form(task)
    told = [json.dumps({"reasoning": "Move(2) comes later.", form.key: one}) for one in operations]
    one, _ = play(task, scripted(*operations), text)
    other, requests = play(task, scripted(*told), asked)
    assert all(request.response_format == form.response_format for request in requests)
    assert {turn["parse"]["rule"] for turn in other["turns"][: len(told)]} <= {"json"}
    for turn in (*one["turns"], *other["turns"]):
        del turn["parse"], turn["reply"]
    assert one == other
    broken = ('{"operation": "Move(1)"', '{"operation": 1.5}', '{"operation": "Done"}')
    fields, _ = play(tower("red", "blue"), scripted(*broken), made("json_schema", **OPEN))
    assert fields["outcomes"] == ["placed", "no_move", "done"]


@pytest.mark.parametrize(
    ("limits", "agent", "ending", "steps"),
    [
        (OPEN, scripted(*["Move(6)"] * 50), "max_steps", 6),
        ({"max_steps": 4, "max_failures": 9}, scripted(*["?"] * 50), "max_steps", 4),
        ({"max_failures": 9, "max_repeats": 2},
         scripted("Move(6)", "Move(5)", "Move(6)", "Move(6)"), "max_repeats", 4),
        ({"max_steps": 3}, scripted("Move(1)", "Move(1)", "Move(3)"), "completed", 3),
    ],
)  # fmt: skip
def test_limits_end_an_episode(limits, agent, ending, steps):
    fields, _ = play(tower("red", "red", "blue"), agent, made(**limits))
    assert (fields["ending"], len(fields["outcomes"])) == (ending, steps)


def test_no_hostile_reply_stops_an_episode():
    for _, _, text in ROWS:
        fields, _ = play(tower("red", "blue"), scripted(text, "Move(1)", "Move(3)"))
        assert set(fields["outcomes"]) <= {*MOVE_OUTCOMES, *MOVE_PROBLEMS, "done"}, text
        expected = "done" if fields["outcomes"][0] == "done" else "completed"
        assert fields["ending"] == expected, text
        json.dumps(fields, allow_nan=False, default=str)


@given(st.lists(st.sampled_from(["Move(1)", "Move(3)", "Move(6)", "?", "Move(40)"]), max_size=60))
def test_whatever_is_said_the_default_limits_end_it_the_same_way(texts):
    task = tower("red", "blue", "red", "blue")
    fields, requests = play(task, scripted(*texts), made(), seed=3)
    assert play(task, scripted(*texts), made(), seed=3) == (fields, requests)
    assert len(requests) <= 8
    assert fields["ending"] in ENDINGS
    tp, fp, fn = scores(fields, "attempted")
    assert tp + fn == 4
    assert tp + fp == len(fields["parse"]["plan"])
    assert tp == fields["outcomes"].count("placed")


@pytest.mark.parametrize(
    ("of", "accepts"), [(one, "A") for one in ("built-in", "official")] + [("built-in", "B")]
)
def test_the_oracle_completes_every_scene(of, accepts, request):
    """Also where orientations do not matter to the simulator, it makes no mistake in them."""
    is_ours = of == "built-in"
    tasks = TASKS if is_ours else official_tasks(request.getfixturevalue("official_checkout"))
    for task in tasks:
        fields, _ = play(task, baseline("oracle"), made(setting=accepts))
        assert fields["ending"] == "completed"
        for setting in SETTINGS:
            assert scores(fields, "attempted", setting) == (len(task.scene), 0, 0), task.scene.id


def test_a_turned_block_is_placed_in_b_and_wrong_in_a():
    blocks = (block(1, "arch", (0, 0, 0.025)), block(2, "cube", (0, 0, 0.075), depend=(1,)))
    looks = [("arch", 0), ("arch", 90), ("cube", 0)]
    numbered = tuple(Candidate(t, "red", (0, 0, turn)) for t, turn in looks)
    task = AssemblyTask(Scene("s", (2,), blocks, ("s",)), CandidateSet(numbered))
    agent = baseline("oracle-no-orientation")
    in_b, _ = play(task, agent, made(setting="B"))
    assert (in_b["ending"], in_b["parse"]["plan"]) == ("completed", [2, 3])
    assert (scores(in_b, "placed", "A"), scores(in_b, "placed", "B")) == ((1, 1, 1), (2, 0, 0))
    in_a, _ = play(task, agent, made(setting="A"))
    assert (in_a["ending"], {*in_a["outcomes"]}) == ("max_repeats", {"incorrect_orientation"})


@pytest.mark.parametrize(
    ("physics", "ending", "placed", "fallen"),
    [("off", "completed", (3, 0, 0), [None] * 3), ("settle", "completed", (3, 0, 0), [[], [3], []]),
     ("strict", "collapsed", (1, 1, 2), [[], [3]])],
)  # fmt: skip
def test_a_collapse_ends_an_episode_under_strict_physics_alone(physics, ending, placed, fallen):
    track = made(physics=physics, **OPEN)
    fields, _ = play(seesaw(), scripted("Move(1)", "Move(3)", "Move(2)"), track)
    assert (fields["ending"], scores(fields, "placed")) == (ending, placed)
    assert [turn.get("fallen") for turn in fields["turns"]] == fallen
    fields, _ = play(seesaw(), scripted("Move(1)", "Move(2)", "Move(3)"), track)
    assert fields["ending"] == "completed"


@settings(max_examples=25)
@given(
    st.lists(st.sampled_from([1, 2, 6, None]), min_size=1, max_size=12),
    st.integers(1, 4),
    st.integers(1, 4),
)
def test_runs_of_failures_end_an_episode(moves, most_failures, most_repeats):
    track = made(max_failures=most_failures, max_repeats=most_repeats, max_steps=99)
    named = [*moves, *[6] * 4]
    said = scripted(*("?" if move is None else f"Move({move})" for move in named))
    fields, _ = play(tower("red", "blue", "red", "blue"), said, track)
    outcomes, failures, repeats = fields["outcomes"], 0, 0
    for place, (move, outcome) in enumerate(zip(named, outcomes, strict=False)):
        is_placed, is_same = outcome == "placed", place and failures and move == named[place - 1]
        failures = 0 if is_placed else failures + 1
        repeats = 0 if is_placed or move is None else repeats + 1 if is_same else 1
        is_end = repeats >= most_repeats or failures >= most_failures
        assert is_end == (place == len(outcomes) - 1) or fields["ending"] == "completed"
    wanted = "max_repeats" if repeats >= most_repeats else "max_failures"
    assert fields["ending"] in (wanted, "completed")


@pytest.mark.parametrize("feedback", get_args(Feedback))
def test_feedback_tells_no_more_than_it_may(feedback):
    outcomes = [*MOVE_OUTCOMES, *MOVE_PROBLEMS]
    told = {outcome: PastStep(1, outcome).report(feedback) for outcome in outcomes}
    wrong = {told[outcome] for outcome in MOVE_OUTCOMES if outcome != "placed"}
    assert len(wrong) == (5 if feedback == "error_type" else 1)
    assert (set(told.values()) == {""}) == (feedback == "none") == (told["placed"] in wrong)


def test_pictures_of_states_are_drawn_and_kept(tmp_path):

    def right_move(request):
        return f"Move({request.subject.valid[0]})"

    found, task = [], TASKS[0]
    for expected in (2 + len(task.scene), 0):
        shop = Workshop(1, tmp_path)
        images = {"layout": "separate"}
        track = track_of("step_planning", [task], shop, images=images, steps={"physics": "settle"})
        _, asked = play(task, right_move, track, with_messages=True)
        parts = [request.messages[1].parts for request in asked]
        found.append([[part.data for part in seen if isinstance(part, Image)] for seen in parts])
        assert shop.rendered == expected
        outlines = list(track.outlines(task))
        are_real = [all(one.data for one in outline.images) for outline in outlines]
        assert are_real == [True] + [False] * (len(outlines) - 1)
        track.close()
    assert found[0] == found[1]
    assert len({step[2] for step in found[0]}) == len(task.scene)
