"""Pose planning: blocks, order and positions in one reply, executed in a physics engine."""

from __future__ import annotations

import functools
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, replace
from functools import partial
from typing import Any, ClassVar, Literal

import numpy as np

from phyblock.config.validation import PictureControls, TemplateName
from phyblock.domain.scene import AssemblyTask, Block, Plan, PoseStep, Scene
from phyblock.files import bundled
from phyblock.parsing import plan
from phyblock.parsing.plan import ParsedPoses
from phyblock.parsing.text import AnswerForm
from phyblock.records.record import Amount, Course, Line, Record, Whole
from phyblock.scoring import pose
from phyblock.scoring.plan import AssemblyScorer
from phyblock.scoring.pose import PoseError, PoseScorer
from phyblock.sim.balance import is_balanced, surely_stands
from phyblock.sim.contact import voxel_iou
from phyblock.sim.dynamics import EXECUTION_LIMITS, execute, execution_physics, groups
from phyblock.sim.engine import Pose, described_engine
from phyblock.sim.geometry import box_height_cm, center_cm, origin_m, put
from phyblock.sim.pictures import goal_style, kit_key, kit_png, ruled_key, ruled_png, written_style
from phyblock.text import plain_sum
from phyblock.tracks import base
from phyblock.tracks.base import Judgement, NumberField, Pick, Picking, SceneTrack
from phyblock.tracks.full_planning import RANDOM_STEPS, PlanParse, PlanSubject, needed_candidate
from phyblock.tracks.measures import SampleCounts, level_cells
from phyblock.tracks.pictures import Drawing, picture_style
from phyblock.types import REFUSED_ENDS, STEP_ENDS, Matcher, Setting, StepEnd, View

EXECUTION_VERSION = 4
"""Version of plan execution and its measurements; increased when the end of a plan may change."""
KIT_LABEL = "blocks"
"""The label of the sheet of candidates."""
Center = tuple[float, float, float]
_REACHED = {"reached_cm": 1.0, "reached_deg": 10.0}
_LIMITS = {**EXECUTION_LIMITS, **_REACHED}
"""Tolerances of execution, as records hold them: a goal block is reached if a block of its kind
ends up at most `reached_cm` from it, turned by at most `reached_deg`."""
_RANDOM_REACH_CM = 15.0
_STILL_M, _STILL_DEG = 0.001, 1.0
"""A block that moved by no more than this counts as unmoved."""
_ONE_AT_A_TIME = threading.Lock()


class PoseSpec(PictureControls):
    """The pose_planning track: the form of requests."""

    prompt: TemplateName = "default"
    """default, or the path of a .j2 template."""


class GivenStep(Line):
    """A parsed step."""

    block: int
    """Number of the candidate, as shown to the model."""
    center_cm: tuple[Amount, Amount, Amount]
    """x, y and z of the center of the block's box [cm]."""


class PoseParse(PlanParse):
    """The plan with poses of a reply; `plan` omits numbers that no candidate has."""

    steps: tuple[GivenStep, ...] = ()
    """The steps with their poses, including those that name no candidate."""


class RestingBlock(Line):
    """The pose in which a block came to rest."""

    step: Whole
    """Number of the step, from 1, that placed it."""
    center_cm: tuple[Amount, Amount, Amount]
    """x, y and z of the center of its box [cm]."""
    euler_deg: tuple[Amount, Amount, Amount]
    """Its rotation, extrinsic x-y-z angles [degrees]."""


class StepOutcome(Line):
    """The score of a step by geometry, and the result of its execution."""

    vertex: Whole | None
    """The goal block, from 0, that it is matched to; null: none."""
    position_cm: Amount | None = None
    """Distance of its center of mass from that block's [cm]."""
    sideways_cm: Amount | None = None
    """Its horizontal part [cm]."""
    up_cm: Amount | None = None
    """Its vertical part, positive if the block is too high [cm]."""
    turn_deg: Amount | None = None
    """Angle between the orientations, up to symmetry [degrees]."""
    iou: Amount | None = None
    """Intersection over union of the two volumes."""
    end: StepEnd
    """The ending."""
    moved_cm: Amount = 0.0
    """Distance from the place of the block to its place at rest [cm]."""
    overlap_cm: Amount = 0.0
    """Distance by which it was moved out of others, or depth at which it was refused [cm]."""
    knocked: tuple[Whole, ...] = ()
    """Numbers of the steps, from 1, whose blocks it moved."""
    error: PoseError | None = None
    """Type of error; null: none."""
    rests: tuple[RestingBlock, ...]
    """Blocks that moved by more than 1 mm or 1 degree in this step; its own from its place."""


class PoseOutcome(Line):
    """The score of a plan with poses."""

    right: dict[str, tuple[Whole, ...]]
    """By frame, `absolute` or `aligned`: right steps within 0.5, 1, 2 and 4 cm."""
    steps: tuple[StepOutcome, ...]
    """Outcome of each step."""
    reached: Whole
    """Goal blocks that are reached in the end."""
    iou: Amount
    """Intersection over union of final structure and goal, in voxels of 5 mm by 64 points."""
    completed: bool
    """True if the whole goal was reached and no other block is left."""
    limits: dict[str, Amount]
    """The tolerances of the execution [cm, degrees]."""
    engine: str
    """The physics engine, with its version."""


class PoseRecord(Record):
    """A plan with poses for a scene."""

    track: Literal["pose_planning"]
    """`pose_planning`."""
    parse: PoseParse | None = None
    """The parsed plan."""
    pose: PoseOutcome | None = None
    """Its score."""

    def executed(self, scene: Scene, steps: Sequence[Mapping[str, Any]]) -> PoseOutcome | None:
        """Return its result if it can be that of executing these steps, else None."""
        kept, given = self.pose, () if self.parse is None else self.parse.steps
        if kept is None or kept.limits != _LIMITS or [step.fields() for step in given] != steps:
            return None
        is_possible = (
            len(kept.steps) == len(steps)
            and 0 <= kept.iou <= 1
            and 0 <= kept.reached <= len(scene)
            and (kept.reached == len(scene) or not kept.completed)
        )
        return kept if is_possible else None

    def course(self, matcher: str) -> Course | None:
        """Return the error of each step, and how many goal blocks were not reached."""
        if self.pose is None or self.parse is None:
            return super().course(matcher)
        names = (str(step.block) for step in self.parse.steps)
        errors = (step.error for step in self.pose.steps)
        return Course(tuple(zip(names, errors, strict=True)), self.n_blocks - self.pose.reached)

    def built(self, task: AssemblyTask) -> tuple[Block, ...]:
        """Return the blocks that were not refused, where they came to rest."""
        world: dict[int, Block] = {}
        given = () if self.parse is None else self.parse.steps
        ended = () if self.pose is None else self.pose.steps
        for n, (one, step) in enumerate(zip(given, ended, strict=False), 1):
            block = put(PoseStep(one.block, one.center_cm), task.candidates)
            if block is not None and step.end not in REFUSED_ENDS:
                world[n] = block
            for rest in step.rests:
                moved = world[rest.step]
                place = origin_m(moved.type, rest.euler_deg, rest.center_cm)
                world[rest.step] = replace(moved, position_m=place, euler_deg=rest.euler_deg)
        return tuple(world.values())


_EXECUTED = {"steps", "limits", "reached", "iou", "completed", "engine"}
_ENDED = ("end", "moved_cm", "overlap_cm", "knocked")
_scorer = functools.lru_cache(maxsize=32)(PoseScorer)


def judge_poses(
    item: AssemblyTask,
    text: str | None,
    settings: tuple[Setting, ...],
    matchers: tuple[Matcher, ...],
    earlier: Record | None = None,
) -> Judgement:
    """Parse, score and execute a reply; a missing reply (None) is an empty plan.

    If an `earlier` record holds the same plan and tolerances, its result is used.
    """
    n, of_poses = len(item.candidates), _scorer(item.scene, item.candidates)
    parsed = ParsedPoses((), None) if text is None else plan.parse_poses(text, n)
    given, numbers = parsed.steps, [step.candidate for step in parsed.steps]
    blocks = [put(step, item.candidates) for step in given]
    poses = of_poses.score(numbers, blocks)
    fits = poses[0].fits
    steps = [{"block": step.candidate, "center_cm": step.center_cm} for step in given]
    if isinstance(earlier, PoseRecord) and (known := earlier.executed(item.scene, steps)):
        done = known.model_dump(include=_EXECUTED, exclude_unset=True)
    else:
        done = _executed(item.scene, blocks)
    errors = pose.pose_errors(of_poses.goal, numbers, fits, [step["end"] for step in done["steps"]])
    # The plan without its poses, under every setting and matcher.
    named = [number for number in numbers if 1 <= number <= n]
    of_plans = AssemblyScorer(item.scene, item.candidates, settings)
    scores = of_plans.score(Plan(tuple(named)), matchers, None)
    dropped = [number for number in numbers if not 1 <= number <= n]
    parse: dict[str, Any] = {"parser": "poses", "rule": parsed.rule, "problem": parsed.problem}
    parse |= {"plan": named, "dropped": dropped, "steps": steps}
    scored = [
        {
            "vertex": None,
            **({} if fit is None else asdict(fit)),
            **{name: end[name] for name in (*_ENDED, "rests") if name in end},
            "error": error,
        }
        for fit, end, error in zip(fits, done["steps"], errors, strict=True)
    ]
    right = {score.frame: list(score.right) for score in poses}
    judged = {**done, "right": right, "steps": scored}
    fields = {"parse": parse, "scores": scores, "pose": judged}
    return Judgement(parsed.rule is not None, fields)


def _executed(scene: Scene, blocks: Sequence[Block | None]) -> dict[str, Any]:
    """Return the fields of an executed plan; the engine executes one plan at a time."""
    with _ONE_AT_A_TIME:
        done = execute(blocks, physics=execution_physics(scene.blocks))
    goal, reached = scene.blocks, pose.blocks_reached(scene.blocks, done.blocks, *_REACHED.values())
    lies = {n: Pose.goal(block) for n, block in enumerate(blocks, 1) if block is not None}
    steps = []
    for step, world in zip(done.steps, done.worlds, strict=True):
        rests = []
        # Blocks of a world have the numbers of their steps as orders.
        for block in world:
            before, after = lies[block.order], Pose.goal(block)
            if before.distance_m(after) > _STILL_M or before.angle_deg(after) > _STILL_DEG:
                lies[block.order] = after
                at = [round(part, 2) + 0.0 for part in center_cm(block)]
                rests.append({"step": block.order, "center_cm": at, "euler_deg": block.euler_deg})
        steps.append({**{name: getattr(step, name) for name in _ENDED}, "rests": rests})
    return {
        "steps": steps,
        "limits": _LIMITS,
        "reached": reached,
        "iou": round(voxel_iou(goal, done.blocks), 4),
        "completed": reached == len(goal) == len(done.blocks),
        "engine": described_engine(),
    }


def written(steps: Iterable[PoseStep]) -> str:
    """Return steps in the form that the prompt asks for."""
    lines = []
    for n, step in enumerate(steps, 1):
        center = ", ".join(f"{round(value, 4) + 0.0:g}" for value in step.center_cm)
        lines.append(f"Step{n}: block {step.candidate} at ({center})")
    return "\n".join(lines)


def _built(
    subject: PlanSubject,
    rng: np.random.Generator,
    move: Callable[[Block, Center], Center] = lambda _, center: center,
) -> str:
    """Answer with the goal's blocks in a random valid order that keeps balance, each moved.

    Each step takes the first block that surely stands, else the first in balance, else the first.
    """
    blocks, graph = subject.scene.blocks, subject.scene.graph
    drawn = rng.random(len(blocks)).tolist()
    wanted = sorted(range(len(blocks)), key=lambda vertex: (graph.layers[vertex], drawn[vertex]))
    order: list[int] = []

    def holds(vertex: int, verdict: Callable[[Sequence[Block]], bool]) -> bool:
        placed = [replace(blocks[v], order=n) for n, v in enumerate((*order, vertex))]
        return verdict(next(group for group in groups(placed) if placed[-1] in group))

    while len(order) < len(blocks):
        ready = [v for v in wanted if v not in order and graph.depends_on[v] <= set(order)]
        steady = (v for rule in (surely_stands, is_balanced) for v in ready if holds(v, rule))
        order.append(next(steady, ready[0]))
    return written(
        PoseStep(needed_candidate(subject, blocks[v]), move(blocks[v], center_cm(blocks[v])))
        for v in order
    )


def _noisy(sigma_cm: float) -> Callable[[PlanSubject, np.random.Generator], str]:
    """Return the oracle with Gaussian noise on every coordinate [cm]."""

    def rule(subject: PlanSubject, rng: np.random.Generator) -> str:
        noise = np.random.default_rng(rng.integers(2**32))

        def moved(_: Block, center: Center) -> Center:
            x, y, z = np.array(center) + noise.normal(0.0, sigma_cm, 3)
            return float(x), float(y), float(z)

        return _built(subject, rng, moved)

    return rule


def _stack(subject: PlanSubject, rng: np.random.Generator) -> str:
    """Answer with the right blocks at the origin, one on another."""
    top = 0.0

    def stacked(block: Block, _: Center) -> Center:
        nonlocal top
        height = box_height_cm(block)
        top += height
        return 0.0, 0.0, top - height / 2

    return _built(subject, rng, stacked)


def _random(subject: PlanSubject, rng: np.random.Generator) -> str:
    """Answer with any blocks anywhere, without seeing the goal."""
    steps = []
    for _ in range(RANDOM_STEPS):
        number = int(rng.integers(1, len(subject.candidates) + 1))
        x, y = rng.uniform(-_RANDOM_REACH_CM, _RANDOM_REACH_CM, 2).tolist()
        steps.append(PoseStep(number, (x, y, float(rng.uniform(0.0, _RANDOM_REACH_CM)))))
        # Drawn but not used, so that answers stay the same as when turns were drawn.
        rng.integers(0, 4, 3)
    return written(steps)


def _right(record: PoseRecord) -> tuple[float, ...] | None:
    if (done := record.pose) is None:
        return None
    right, score = (n for frame in pose.POSE_FRAMES for n in done.right[frame]), record.scores[0]
    return (*right, score.tp + score.fp, score.tp + score.fn)


def _fits(record: PoseRecord) -> tuple[float, ...] | None:
    if (done := record.pose) is None:
        return None
    fits = [step for step in done.steps if step.vertex is not None]
    return (*(plain_sum(getattr(fit, part) for fit in fits) for part in _FITS), len(fits))


def _ends(record: PoseRecord) -> tuple[float, ...] | None:
    if (done := record.pose) is None:
        return None
    ends = Counter(name for step in done.steps for name in (step.end, step.error))
    whole = (done.reached, record.n_blocks, done.iou, done.completed, 1)
    return (*(ends[name] for name in (*STEP_ENDS, *pose.POSE_ERRORS)), len(done.steps), *whole)


def _plan(setting: Setting) -> SampleCounts:
    """Return the counts of the plan without its poses, by the headline matcher."""

    def of(record: PoseRecord) -> tuple[float, ...] | None:
        score = next((one for one in record.scores if one.setting == setting), None)
        return None if score is None else (score.tp, score.fp, score.fn)

    return SampleCounts(f"plan_{setting.lower()}", ("tp", "fp", "fn"), record=of)


_SAME = tuple(f"tracks.pose_planning.{key}" for key in (base.EXECUTION, base.ENGINE))
_FITS = ("position_cm", "turn_deg", "iou")
_WHOLE_COUNTS = ("steps", "reached", "blocks", "iou", "completed", "plans")
_RIGHT = tuple(f"{frame}_{cm:g}" for frame in pose.POSE_FRAMES for cm in pose.TOLERANCES_CM)
FITS = SampleCounts("fits", (*_FITS, "n"), record=_fits)


class PosePlanning(SceneTrack):
    """Asks for a whole plan with the place of every block, and executes it."""

    name = "pose_planning"
    title = "Pose planning"
    section = "pose"
    options = PoseSpec
    template = bundled("prompts", "pose_planning.j2")
    baselines: ClassVar = {
        "random": _random,
        "oracle": _built,
        "oracle-noise-1mm": _noisy(0.1),
        "oracle-noise-3mm": _noisy(0.3),
        "oracle-noise-1cm": _noisy(1.0),
        "oracle-2d": lambda subject, rng: _built(
            subject, rng, lambda block, center: (*center[:2], box_height_cm(block) / 2)
        ),
        "stack": _stack,
    }
    record = PoseRecord
    counted = (
        SampleCounts("poses", (*_RIGHT, "steps", "blocks"), record=_right),
        FITS,
        SampleCounts(
            "executed", (*STEP_ENDS, *pose.POSE_ERRORS, *_WHOLE_COUNTS), record=_ends, same=_SAME
        ),
        _plan("A"),
        _plan("B"),
    )
    results: ClassVar = {"cells": level_cells}
    varies = ("prompt", "background", "candidate_order", "repeats")
    simulates = True
    draws = True
    spec: PoseSpec

    @staticmethod
    def by_hand(subject: PlanSubject) -> Picking:
        """Return the choices of a person: any candidates, repeatedly, each with its place."""

        def write(picks: Sequence[Pick]) -> str:
            placed = ((pick.place + 1, pick.numbers) for pick in picks)
            return written(PoseStep(number, (x, y, z)) for number, (x, y, z) in placed)

        center = (NumberField(name, "cm", plan.FARTHEST_PLACE_CM, 2, 0.5, 5.0) for name in "xyz")
        return Picking(
            base.candidate_choices(len(subject.candidates), (KIT_LABEL,)),
            write,
            "Pick the blocks that build the goal, in order, and say where the center of each is.",
            most=plan.MOST_POSE_STEPS,
            repeats=True,
            fields=tuple(center),
        )

    def draw(self, item: AssemblyTask) -> tuple[Drawing, ...]:
        """Return the goal from two views, unless blind, and the sheet of candidates."""
        drawings, images = list[Drawing](), self.suite.images
        views: tuple[View, ...] = () if item.is_blind else ("oblique", "top")
        for view in views:
            style = written_style(goal_style(item.scene, picture_style(images, view)))
            drawings.append(Drawing.of(f"goal, {view}", ruled_key, ruled_png, item.scene, style))
        style = written_style(picture_style(images, "oblique"))
        return (*drawings, Drawing.of(KIT_LABEL, kit_key, kit_png, item.candidates, style))

    def identity(self) -> dict[str, Any]:
        """Return what determines its results, with the version of plan execution."""
        return {**super().identity(), base.EXECUTION: EXECUTION_VERSION}

    def json_form(self, item: AssemblyTask) -> AnswerForm[Any]:
        """Return the JSON form of a plan."""
        return plan.pose_form(len(item.candidates))

    def subject_of(self, item: AssemblyTask) -> PlanSubject:
        """Return the subject of baselines."""
        return PlanSubject(item.scene, item.candidates)

    def judge(self, item: AssemblyTask, text: str | None) -> Judgement:
        """Parse, score and execute a reply; a missing reply (None) is an empty plan."""
        suite = self.suite
        return judge_poses(item, text, suite.settings, suite.scoring.matchers)

    async def judge_apart(
        self, item: AssemblyTask, text: str | None, earlier: Record | None
    ) -> Judgement:
        """Return the result of `judge`, computed in another process, or without one in a thread.

        A plan that an earlier record holds is not executed again.
        """
        rules = (self.suite.settings, self.suite.scoring.matchers, earlier)
        found: Judgement = await self.compute(partial(judge_poses, item, text, *rules))
        return found
