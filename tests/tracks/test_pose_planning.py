"""Pose planning: what a reply is worth in three settings, and a run of it from YAML to the page."""

import asyncio
import shutil

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.domain.scene import Candidate, CandidateSet, PoseStep
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
from tests.sim.structures import block, block_types, eulers
from tests.tracks.conftest import track_of
from tests.workspace import call, plan_text

STANDS = "Step1: block 1 at (0, 0, 2.5)\nStep2: block 3 at (0, 0, 7.5)"


@pytest.fixture(scope="module")
def track():
    """It judges in this process."""
    return track_of("pose_planning", TASKS[:1])


@pytest.fixture(scope="session")
def task(tasks):
    return tasks[0]


BUILT_IN = [t for t in TASKS if t.key.startswith(("l1-001-animal", "l2-020", "l3-028-arcade"))]
"""Three scenes with arches, triangles and cylinders that are turned."""


@given(block_types, eulers, st.tuples(*[st.floats(-1, 1)] * 3))
def test_a_block_is_put_where_its_box_is_said_to_be(name, euler_deg, place_m):
    kept = CandidateSet((Candidate(name, "red", euler_deg),))
    found = put(PoseStep(1, center_cm(block(1, name, place_m, euler_deg))), kept)
    assert found.position_m == pytest.approx(place_m)
    assert found.euler_deg == euler_deg
    assert put(PoseStep(2, (0, 0, 0)), kept) is None


def text_of(track, baseline, item, seed):
    rule = PosePlanning.baselines[baseline]
    return rule(track.subject_of(item), np.random.default_rng(seed))


@pytest.mark.parametrize(("seed", "item"), [*enumerate(BUILT_IN)])
def test_true_poses_in_a_random_valid_order_are_right_and_stand(track, seed, item):
    shown, n = track.shown(item, seed), len(item.scene)
    fields = track.judge(shown, text_of(track, "oracle", shown, seed)).fields
    pose = fields["pose"]
    assert pose["right"] == {"absolute": [n] * 4, "aligned": [n] * 4}
    assert {(step["end"], step["error"]) for step in pose["steps"]} == {("stands", None)}
    assert (pose["reached"], pose["completed"]) == (n, True)
    assert pose["iou"] >= 0.98
    assert {score["tp"] for score in fields["scores"]} == {n}


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
def test_a_reply_is_read_scored_and_carried_out(track, task, text, right, ends, errors, reached):
    found = track.judge(task, text)
    pose = found.fields["pose"]
    assert (pose["right"]["absolute"], pose["reached"]) == (list(right), reached)
    told = [(step["end"], step["error"]) for step in pose["steps"]]
    assert told == list(zip(ends, errors, strict=True))
    assert found.is_read == bool(ends)
    # Its record is written, read again and judged again, and says the same.
    fields = begun("s", track, "m", task, 0, None) | track.about(task)
    record = judged(track, task, fields, found)
    assert known_records().validate_json(record.as_json()) == record
    impossible = {"iou": 1e300}, {"reached": 99}, {"completed": True, "reached": 0}, {"x": "<b>"}
    changed = [record.pose.model_copy(update=one) for one in impossible]
    for kept in (record, *(record.model_copy(update={"pose": one}) for one in changed)):
        again = asyncio.run(track.judge_apart(task, text, kept))
        assert judged(track, task, fields, again) == record


@pytest.mark.parametrize("baseline", ["oracle-noise-1cm", "stack", "oracle-2d"])
def test_where_blocks_came_to_lie_follows_from_what_each_step_moved(track, baseline):
    item = BUILT_IN[0]
    text = text_of(track, baseline, item, 1)
    record = judged(track, item, begun("s", track, "m", item, 0, None), track.judge(item, text))
    blocks = [put(step, item.candidates) for step in parse_poses(text, 16).steps]
    for n, world in enumerate(execute(blocks).worlds, 1):
        ended = record.pose.model_copy(update={"steps": record.pose.steps[:n]})
        built = record.model_copy(update={"pose": ended}).built(item)
        for one, other in zip(world, built, strict=True):
            start, end = Pose.goal(one), Pose.goal(other)
            assert start.distance_m(end) < 0.0012
            assert start.angle_deg(end) < 1.1


@settings(max_examples=12)
@given(st.lists(st.sampled_from([1, 1, 3, 3, 2, 17, 0]), max_size=4))
def test_without_poses_a_plan_is_scored_as_full_planning_scores_it(track, task, numbers):
    """Far from one another, so that nothing falls on anything."""
    steps = [PoseStep(n, (20.0 * place, 0.0, 2.5)) for place, n in enumerate(numbers)]
    full = track_of("full_planning", TASKS[:1])
    found = full.judge(task, plan_text(*numbers) if numbers else None).fields["scores"]
    wanted = [score for score in found if score["criterion"] == "aov"]
    assert track.judge(task, written(steps)).fields["scores"] == wanted


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
    whole, scored = (
        {r["sample"]: (r["parse"], r["scores"], r["pose"]) for r in inside.records(path)}
        for path in (inside.out, again)
    )
    assert whole == scored
