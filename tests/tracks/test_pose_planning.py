"""Pose planning: what a reply is worth in three settings, and a run of it from YAML to the page."""

import asyncio
import functools
import shutil

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.domain.scene import Block, Candidate, CandidateSet, PoseStep
from phyblock.errors import StoreError
from phyblock.parsing.plan import parse_poses
from phyblock.records.files import known_records
from phyblock.run.rescore import rescore
from phyblock.run.store import begun, judged
from phyblock.scoring.plan import Goal
from phyblock.scoring.pose import POSE_ERRORS, PoseFit, pose_errors
from phyblock.sim.dynamics import execute
from phyblock.sim.engine import Pose
from phyblock.sim.geometry import center_cm, put
from phyblock.tracks import pose_planning as pose_track
from phyblock.tracks.pose_planning import PosePlanning, written
from phyblock.types import STEP_ENDS
from tests.shipped import TASKS
from tests.sim.structures import block_types, eulers
from tests.tracks.conftest import track_of
from tests.workspace import call, plan_text

STANDS = "Step1: block 1 at (0, 0, 2.5)\nStep2: block 3 at (0, 0, 7.5)"


@functools.cache
def poses():
    """The track, judging in this process."""
    return track_of("pose_planning", TASKS[:1])


@pytest.fixture(scope="session")
def task(tasks):
    return tasks[0]


BUILT_IN = [t for t in TASKS if t.key.startswith(("l1-001-animal", "l2-020", "l3-028-arcade"))]
"""Three scenes with arches, triangles and cylinders that are turned."""


@given(block_types, eulers, st.tuples(*[st.floats(-1, 1)] * 3))
def test_a_block_is_put_where_its_box_is_said_to_be(name, euler_deg, place_m):
    block = Block(1, name, "red", place_m, euler_deg, (), 1)
    kept = CandidateSet((Candidate(name, "red", euler_deg),))
    found = put(PoseStep(1, center_cm(block)), kept)
    assert found.position_m == pytest.approx(place_m)
    assert found.euler_deg == euler_deg
    assert put(PoseStep(2, (0, 0, 0)), kept) is None


def test_true_poses_in_a_random_valid_order_are_right_and_stand():
    track = poses()
    for seed, item in enumerate(BUILT_IN):
        shown = track.shown(item, seed)
        subject = track.subject_of(shown)
        text = PosePlanning.baselines["oracle"](subject, np.random.default_rng(seed))
        fields, n = track.judge(shown, text).fields, len(item.scene)
        pose = fields["pose"]
        assert pose["right"] == {"absolute": [n] * 4, "aligned": [n] * 4}
        assert {(step["end"], step["error"]) for step in pose["steps"]} == {("stands", None)}
        assert (pose["reached"], pose["completed"]) == (n, True)
        assert pose["iou"] >= 0.98
        assert all(score["tp"] == n for score in fields["scores"])


@pytest.mark.parametrize(
    ("text", "right", "ends", "errors", "reached"),
    [
        (STANDS, (2, 2, 2, 2), ["stands"] * 2, [None] * 2, 2),
        (STANDS.replace("7.5", "7.9"), (2, 2, 2, 2), ["stands"] * 2, [None] * 2, 2),
        (STANDS.replace("7.5", "10.5"), (1, 1, 1, 2), ["stands", "falls"], [None, "off_height"], 2),
        (STANDS.replace("(0, 0, 7.5)", "(3.5, 0, 7.5)"), (1, 1, 1, 2), ["stands", "falls"],
         [None, "off_sideways"], 1),
        (STANDS.replace("7.5", "5.5"), (1, 1, 2, 2), ["stands", "overlaps"],
         [None, "off_height"], 1),
        (STANDS.replace("7.5", "6.8"), (1, 2, 2, 2), ["stands", "overlaps"],
         [None, "interpenetrating"], 1),
        (STANDS.replace("block 1", "block 99"), (0, 0, 0, 0), ["no_block", "falls"],
         ["wrong_kind", "too_early"], 0),
        ("Step1: block 1 at (9, 0, 2.5)", (0, 0, 0, 0), ["stands"], ["off_sideways"], 0),
        ("Step1: block 3 at (0, 0, 7.5)", (0, 0, 0, 0), ["falls"], ["too_early"], 0),
        ("I cannot say.", (0, 0, 0, 0), [], [], 0),
        (None, (0, 0, 0, 0), [], [], 0),
    ],
)  # fmt: skip
def test_a_reply_is_read_scored_and_carried_out(task, text, right, ends, errors, reached):
    track = poses()
    found = track.judge(task, text)
    pose = found.fields["pose"]
    assert pose["right"]["absolute"] == list(right)
    assert [step["end"] for step in pose["steps"]] == ends
    assert [step["error"] for step in pose["steps"]] == errors
    assert pose["reached"] == reached
    assert found.is_read == bool(ends)
    # Its record is written, read again and judged again, and says the same.
    fields = begun("s", track, "m", task, 0, None)
    record = judged(track, task, {**fields, **track.about(task)}, found)
    assert known_records().validate_json(record.as_json()) == record
    again = asyncio.run(track.judge_apart(task, text, record))
    assert judged(track, task, {**fields, **track.about(task)}, again) == record


@pytest.mark.parametrize("baseline", ["oracle-noise-1cm", "stack", "oracle-2d"])
def test_where_blocks_came_to_lie_follows_from_what_each_step_moved(baseline):
    item, track = BUILT_IN[0], poses()
    text = PosePlanning.baselines[baseline](track.subject_of(item), np.random.default_rng(1))
    found = track.judge(item, text)
    blocks = [put(step, item.candidates) for step in parse_poses(text, 16).steps]
    fields, worlds = begun("s", track, "m", item, 0, None), execute(blocks).worlds
    record = judged(track, item, fields, found)
    for n, world in enumerate(worlds, 1):
        ended = record.pose.model_copy(update={"steps": record.pose.steps[:n]})
        built = record.model_copy(update={"pose": ended}).built(item)
        for one, other in zip(world, built, strict=True):
            start, end = Pose.goal(one), Pose.goal(other)
            assert start.distance_m(end) < 0.0012
            assert start.angle_deg(end) < 1.1


@settings(max_examples=12)
@given(st.lists(st.sampled_from([1, 1, 3, 3, 2, 17, 0]), max_size=4))
def test_without_poses_a_plan_is_scored_as_full_planning_scores_it(task, numbers):
    """Far from one another, so that nothing falls on anything."""
    steps = [PoseStep(n, (20.0 * place, 0.0, 2.5)) for place, n in enumerate(numbers)]
    full = track_of("full_planning", TASKS[:1])
    found = full.judge(task, plan_text(*numbers) if numbers else None).fields["scores"]
    wanted = [score for score in found if score["criterion"] == "aov"]
    assert poses().judge(task, written(steps)).fields["scores"] == wanted


def fit(position_cm, up_cm, turn_deg=0.0):
    return PoseFit(0, position_cm, (position_cm**2 - up_cm**2) ** 0.5, up_cm, turn_deg, 1.0)


@pytest.mark.parametrize("end", STEP_ENDS)
@pytest.mark.parametrize(
    ("one", "error"),
    [
        (fit(0, 0), None),
        (fit(0.99, 0), None),
        (fit(3, 1), "off_sideways"),
        (fit(3, -2.9), "off_height"),
        (fit(3, 1, 16), "wrong_rotation"),
    ],
)
def test_a_step_has_one_error_the_first_in_time(task, one, error, end):
    """Errors of a reply come before those of its execution."""
    goal = Goal(task.scene, task.candidates, "A")
    physical = {"stands": None, "falls": "floating", "knocks_over": "toppling"}
    physical |= {"overlaps": "interpenetrating", "under_floor": "interpenetrating"}
    wanted = error or {**physical, "no_block": "wrong_kind"}[end]
    assert pose_errors(goal, [1], [one], [end]) == (wanted,)
    assert wanted is None or wanted in POSE_ERRORS


def test_a_run_is_scored_again_without_an_engine(inside, monkeypatch):
    """What fell when it was asked is what fell: nothing is carried out again."""
    inside.write_suite(tracks=["pose_planning"], models=["oracle", "oracle-2d"])
    run = ["run", "suite.yaml", "--out", "out", "--no-report"]
    assert not call(*run)
    monkeypatch.setattr(pose_track, "execute", None)
    monkeypatch.setattr(pose_track, "EXECUTION_VERSION", pose_track.EXECUTION_VERSION + 1)
    again = shutil.copytree(inside.out, inside.root / "again")
    rescore(again)
    with pytest.raises(StoreError, match=r"pose_planning\.execution"):
        call(*run)
    whole, scored = ({r["sample"]: r for r in inside.records(path)} for path in (inside.out, again))
    for name in ("parse", "scores", "pose"):
        assert {key: r[name] for key, r in scored.items()} == {k: r[name] for k, r in whole.items()}
