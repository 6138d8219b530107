"""A reply judged: read, scored with and without poses, and carried out."""

from __future__ import annotations

import functools
import math
import threading
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from phyblock.data import AssemblyTask
from phyblock.domain import (
    Block,
    Candidate,
    CandidateSet,
    Plan,
    PosePlan,
    PoseStep,
    Scene,
    euler_deg_to_matrix,
    turn_deg,
)
from phyblock.parsing.poses import ParsedPoses, parse_poses, pose_form
from phyblock.parsing.structured import AnswerForm
from phyblock.parsing.text import READER_VERSION
from phyblock.scoring.plan import AssemblyScorer, Score
from phyblock.scoring.pose import (
    PoseError,
    PoseFit,
    PoseScore,
    PoseScorer,
    blocks_reached,
    pose_errors,
)
from phyblock.scoring.pose_matching import TURN_TOLERANCE_DEG
from phyblock.sim.contact import voxel_iou
from phyblock.sim.dynamics import ExecutedStep, Execution, ExecutionLimits, execute
from phyblock.sim.engine import described_engine
from phyblock.sim.geometry import put
from phyblock.tracks.plans import score_fields
from phyblock.tracks.pose_planning.bodies import laid, pieces_of
from phyblock.tracks.pose_planning.ended import Ended, borne_out
from phyblock.tracks.pose_planning.resting import Rest, rests_of
from phyblock.tracks.showing import file_plan
from phyblock.types import AnswerFormat, Matcher, PoseRotation, Setting

__all__ = ["CARRY_VERSION", "Earlier", "PoseJudgement", "PoseRules", "judge_poses"]

CARRY_VERSION = 2
"""Version of how plans are carried out and of how what stands in the end is measured; it goes up
where some plan may end otherwise. Before 2 everything in the world was let go together, for 5 s
where it crept, and voxels were whole or empty.
"""
_ONE_AT_A_TIME = threading.Lock()
_KEPT = 32
_DIGITS = 4
_PARSER = "poses"


@dataclass(frozen=True)
class PoseRules:
    """How replies are read, scored and carried out; the first matcher is the headline."""

    rotation: PoseRotation
    settings: tuple[Setting, ...]
    matchers: tuple[Matcher, ...]
    limits: ExecutionLimits
    reached_cm: float
    reached_deg: float
    answer_format: AnswerFormat = "text"

    @property
    def is_free(self) -> bool:
        """Whether steps bring a rotation."""
        return self.rotation == "free"

    @property
    def told(self) -> dict[str, float]:
        """The tolerances of what is carried out, as records tell them."""
        return {
            **asdict(self.limits),
            "reached_cm": self.reached_cm,
            "reached_deg": self.reached_deg,
        }

    def form(self, item: AssemblyTask) -> AnswerForm[Any] | None:
        """The form in which a plan for a scene is asked for; None where that is text."""
        if self.answer_format == "text":
            return None
        return pose_form(len(item.candidates), free=self.is_free)


@dataclass(frozen=True)
class Earlier:
    """A plan that was carried out before, by which tolerances, and what became of it."""

    steps: tuple[PoseStep, ...]
    limits: Mapping[str, float]
    ended: Ended

    def is_of(self, steps: Sequence[PoseStep], rules: PoseRules) -> bool:
        """Whether this is what became of these steps under these rules."""
        is_whole = len(self.ended.steps) == len(steps)
        return is_whole and (self.steps, self.limits) == (tuple(steps), rules.told)


@dataclass(frozen=True)
class PoseJudgement:
    """What a reply was read as, and what that is worth.

    `fits` and `errors` have an entry for each step that was read, `kept` are those that name a
    candidate.
    """

    parsed: ParsedPoses
    kept: tuple[PoseStep, ...]
    in_file: tuple[int, ...] | None
    scores: tuple[Score, ...]
    poses: tuple[PoseScore, ...]
    fits: tuple[PoseFit | None, ...]
    errors: tuple[PoseError | None, ...]
    ended: Ended
    rules: PoseRules

    @property
    def steps(self) -> tuple[int, ...]:
        """The candidates that were named, in order."""
        return tuple(step.candidate for step in self.kept)

    @property
    def is_read(self) -> bool:
        """Whether a rule matched."""
        return self.parsed.rule is not None

    def fields(self) -> dict[str, Any]:
        """`parse`, `scores` and `pose` of the record (docs/results.md)."""
        given = self.parsed.plan.steps
        kept = set(self.kept)
        dropped = [step.candidate for step in given if step not in kept]
        return {
            "parse": {
                "parser": _PARSER,
                "rule": self.parsed.rule,
                "plan": list(self.steps),
                "file_plan": self.in_file,
                "dropped": dropped,
                "version": READER_VERSION,
                "problem": self.parsed.problem,
                "steps": [_given(step) for step in given],
            },
            "scores": [score_fields(score) for score in self.scores],
            "pose": self._outcome(),
        }

    def _outcome(self) -> dict[str, Any]:
        motion = self.poses[-1].motion
        whole = zip(self.fits, self.ended.steps, self.ended.rests, self.errors, strict=True)
        return {
            "rotation": self.rules.rotation,
            "right": {score.frame: list(score.right) for score in self.poses},
            "shift_cm": [round(part, _DIGITS) + 0.0 for part in motion.shift_cm],
            "turn_deg": round(math.degrees(motion.turn_rad), _DIGITS) + 0.0,
            "steps": [_step(*step) for step in whole],
            "reached": self.ended.reached,
            "iou": self.ended.iou,
            "completed": self.ended.completed,
            "limits": self.rules.told,
            "engine": self.ended.engine,
        }


def judge_poses(
    item: AssemblyTask, text: str | None, rules: PoseRules, earlier: Earlier | None = None
) -> PoseJudgement:
    """Read, score and carry out a reply; None, where there is no reply, is an empty plan.

    A plan that is the `earlier` one ended as it did, as far as that is borne out by where its
    blocks came to lie.
    """
    parsed = ParsedPoses(PosePlan(), None)
    if text is not None:
        parsed = parse_poses(text, len(item.candidates), free=rules.is_free)
    given = parsed.plan.steps
    n = len(item.candidates)
    kept = tuple(step for step in given if 1 <= step.candidate <= n)
    scorer = _scorer(item.scene, item.candidates, "B" if rules.is_free else "A")
    poses = scorer.score([laid(step, item.candidates[step.candidate]) for step in kept])
    blocks = [put(step, item.candidates) for step in given]
    if earlier is not None and earlier.is_of(given, rules):
        reached = (rules.reached_cm, rules.reached_deg)
        ended = borne_out(blocks, item.scene.blocks, earlier.ended, rules.limits, reached)
    else:
        ended = _carried(item, blocks, rules)
    found = iter(poses[0].fits)
    fits = tuple(next(found) if 1 <= step.candidate <= n else None for step in given)
    numbers, ends = [step.candidate for step in given], [step.end for step in ended.steps]
    return PoseJudgement(
        parsed,
        kept,
        file_plan(item, [step.candidate for step in kept]),
        _plan_scores(item, kept, rules),
        poses,
        fits,
        pose_errors(scorer.goal, numbers, fits, ends),
        ended,
        rules,
    )


def _carried(item: AssemblyTask, blocks: Sequence[Block | None], rules: PoseRules) -> Ended:
    # An engine has no more than one plan at a time, whichever thread asks.
    with _ONE_AT_A_TIME:
        done: Execution = execute(blocks, rules.limits)
    goal = item.scene.blocks
    reached = blocks_reached(goal, done.blocks, rules.reached_cm, rules.reached_deg)
    is_whole = reached == len(goal) == len(done.blocks)
    iou = round(voxel_iou(goal, done.blocks), _DIGITS)
    rests = rests_of(blocks, done.worlds)
    return Ended(done.steps, rests, reached, iou, is_whole, described_engine())


@functools.lru_cache(maxsize=_KEPT)
def _scorer(scene: Scene, candidates: CandidateSet, setting: Setting) -> PoseScorer:
    return PoseScorer(scene, candidates, setting, pieces_of)


def _plan_scores(
    item: AssemblyTask, kept: Sequence[PoseStep], rules: PoseRules
) -> tuple[Score, ...]:
    """The plan without its poses, under every setting and matcher."""
    numbers, candidates = [step.candidate for step in kept], item.candidates
    if rules.is_free:
        numbers, candidates = _as_candidates(item, kept)
    scorer = AssemblyScorer(item.scene, candidates, rules.settings)
    return scorer.score(Plan(tuple(numbers)), rules.matchers, None)


def _as_candidates(item: AssemblyTask, kept: Sequence[PoseStep]) -> tuple[list[int], CandidateSet]:
    """Steps with rotations as candidates that are turned so.

    One that is within the tolerance of how some block of the goal is turned is turned just so.
    """
    numbers: list[int] = []
    found: dict[Candidate, int] = {}
    for step in kept:
        one = item.candidates[step.candidate]
        turned = replace(one, euler_deg=step.euler_deg or one.euler_deg)
        near = [
            (_apart_deg(turned, block.euler_deg), place, block.euler_deg)
            for place, block in enumerate(item.scene.blocks)
            if block.kind == one.kind
        ]
        if near and min(near)[0] <= TURN_TOLERANCE_DEG:
            turned = replace(one, euler_deg=min(near)[2])
        numbers.append(found.setdefault(turned, len(found) + 1))
    return numbers, CandidateSet(tuple(found))


def _apart_deg(one: Candidate, euler_deg: tuple[float, float, float]) -> float:
    rotations = [np.array(euler_deg_to_matrix(euler)) for euler in (one.euler_deg, euler_deg)]
    return turn_deg(one.type, rotations[0], rotations[1])


def _given(step: PoseStep) -> dict[str, Any]:
    turned = {} if step.euler_deg is None else {"euler_deg": list(step.euler_deg)}
    return {"block": step.candidate, "center_cm": list(step.center_cm), **turned}


def _step(
    fit: PoseFit | None,
    end: ExecutedStep,
    rests: tuple[Rest, ...] | None,
    error: PoseError | None,
) -> dict[str, Any]:
    told: dict[str, Any] = {"vertex": None}
    if fit is not None:
        told = {
            "vertex": fit.vertex,
            "position_cm": fit.position_cm,
            "sideways_cm": fit.sideways_cm,
            "up_cm": fit.up_cm,
            "turn_deg": fit.turn_deg,
            "iou": fit.iou,
        }
    return {
        **told,
        "end": end.end,
        "moved_cm": end.moved_cm,
        "turned_deg": end.turned_deg,
        "gap_cm": end.gap_cm,
        "overlap_cm": end.overlap_cm,
        "knocked": list(end.knocked),
        "error": error,
        **({} if rests is None else {"rests": [asdict(rest) for rest in rests]}),
    }
