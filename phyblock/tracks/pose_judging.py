"""Steps and blocks as the rigid bodies that are scored."""

from __future__ import annotations

import functools
import math
import threading
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from phyblock.data import AssemblyTask
from phyblock.domain import (
    Block,
    BlockType,
    Candidate,
    CandidateSet,
    Euler,
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
    POSE_ERRORS,
    POSE_FRAMES,
    Laid,
    Piece,
    PoseError,
    PoseFit,
    PoseScore,
    PoseScorer,
    blocks_reached,
    pose_errors,
)
from phyblock.scoring.pose_matching import TOLERANCES_CM, TURN_TOLERANCE_DEG
from phyblock.sim.balance import MARGIN_M, is_balanced
from phyblock.sim.contact import voxel_iou
from phyblock.sim.dynamics import (
    DEFAULT_TRIAL,
    ExecutedStep,
    Execution,
    ExecutionLimits,
    depth_cm,
    end_of,
    execute,
    groups,
    moved_between,
    settle,
)
from phyblock.sim.engine import Pose, described_engine
from phyblock.sim.geometry import center_cm, collision_pieces, origin_m, put
from phyblock.stable import plain_sum
from phyblock.tables.measures import SampleCounts
from phyblock.tracks.plans import score_fields
from phyblock.tracks.showing import file_plan
from phyblock.types import (
    REFUSED_ENDS,
    SETTINGS,
    STEP_ENDS,
    AnswerFormat,
    Matcher,
    PoseRotation,
    Setting,
    StepEnd,
)


@functools.cache
def pieces_of(block_type: BlockType) -> tuple[Piece, ...]:
    """The convex pieces of a block in its body frame."""
    return tuple(Piece(p.vertices_m, p.face_normals) for p in collision_pieces(block_type))


def laid(step: PoseStep, candidate: Candidate) -> Laid:
    """A step as a rigid body; without a rotation of its own it has that of its candidate."""
    euler = candidate.euler_deg if step.euler_deg is None else step.euler_deg
    place = origin_m(candidate.type, euler, step.center_cm)
    return Laid(step.candidate, place, euler)


def _right(_: Any, judged: Any) -> tuple[int, ...]:
    by_frame = {score.frame: score.right for score in judged.poses}
    right = (count for frame in POSE_FRAMES for count in by_frame[frame])
    return (*right, len(judged.kept), judged.poses[0].n_blocks)


def _fits(_: Any, judged: Any) -> tuple[float, ...]:
    fits = [fit for fit in judged.fits if fit is not None]
    return (
        plain_sum(fit.position_cm for fit in fits),
        plain_sum(fit.turn_deg for fit in fits),
        plain_sum(fit.iou for fit in fits),
        len(fits),
    )


def _carried(_: Any, judged: Any) -> tuple[float, ...]:
    ended = judged.ended
    ends = Counter(step.end for step in ended.steps)
    whole = (ended.reached, judged.poses[0].n_blocks, ended.iou, ended.completed, 1)
    return (*(ends[name] for name in STEP_ENDS), len(ended.steps), *whole)


def _errors(_: Any, judged: Any) -> tuple[int, ...]:
    counts = Counter(error for error in judged.errors if error is not None)
    return (*(counts[name] for name in POSE_ERRORS), len(judged.errors))


def _plan(setting: Setting) -> SampleCounts:
    """The plan without its poses under a setting, by the headline matcher."""

    def count(_: Any, judged: Any) -> tuple[int, int, int] | None:
        scores = (score for score in judged.scores if score.setting == setting)
        counts = next((score.counts for score in scores), None)
        return None if counts is None else (counts.tp, counts.fp, counts.fn)

    return SampleCounts(f"plan_{setting.lower()}", ("tp", "fp", "fn"), sample=count)


RIGHT = SampleCounts(
    "poses",
    (*(f"{frame}_{cm:g}" for frame in POSE_FRAMES for cm in TOLERANCES_CM), "steps", "blocks"),
    sample=_right,
)
FITS = SampleCounts("fits", ("position_cm", "turn_deg", "iou", "n"), sample=_fits)
CARRIED = SampleCounts(
    "carried",
    (*STEP_ENDS, "steps", "reached", "blocks", "iou", "completed", "plans"),
    sample=_carried,
)
ERRORS = SampleCounts("pose_errors", (*POSE_ERRORS, "steps"), sample=_errors)
PLANS = {setting: _plan(setting) for setting in SETTINGS}
COUNTED = (RIGHT, FITS, CARRIED, ERRORS, *PLANS.values())


_STILL_M, _STILL_DEG = 0.001, 1.0
"""Within these, what was said of a block before is still true."""
_DIGITS = 2


@dataclass(frozen=True)
class Rest:
    """Where the block of a step, from 1, came to lie: the middle of its box [cm], its rotation."""

    step: int
    center_cm: tuple[float, float, float]
    euler_deg: Euler


def rests_of(
    put: Sequence[Block | None], worlds: Sequence[Sequence[Block]]
) -> tuple[tuple[Rest, ...], ...]:
    """For each step the blocks that lie elsewhere after it than before, its own than where it was
    put, by more than 1 mm or 1 degree.

    `worlds` are the blocks after each step, with the numbers of their steps as orders.
    """
    return tuple(_moved(put, worlds))


def _moved(
    put: Sequence[Block | None], worlds: Sequence[Sequence[Block]]
) -> Iterator[tuple[Rest, ...]]:
    known = {number: block for number, block in enumerate(put, 1) if block is not None}
    for world in worlds:
        moved = [block for block in world if not _is_still(known[block.order], block)]
        known |= {block.order: block for block in moved}
        yield tuple(_rest(block) for block in moved)


def worlds_of(
    put: Sequence[Block | None], stays: Sequence[bool], rests: Sequence[Sequence[Rest]]
) -> tuple[tuple[Block, ...], ...]:
    """The blocks after each step, to within 1 mm and 1 degree; `stays` says whose block was not
    refused.
    """
    lying: dict[int, Block] = {}
    worlds = []
    for number, (block, is_put, moved) in enumerate(zip(put, stays, rests, strict=True), 1):
        if block is not None and is_put:
            lying[number] = replace(block, order=number)
        for rest in moved:
            lying[rest.step] = _lying(lying[rest.step], rest)
        worlds.append(tuple(lying.values()))
    return tuple(worlds)


def _is_still(before: Block, after: Block) -> bool:
    start, end = Pose.goal(before), Pose.goal(after)
    return start.distance_m(end) <= _STILL_M and start.angle_deg(end) <= _STILL_DEG


def _rest(block: Block) -> Rest:
    x, y, z = (round(part, _DIGITS) + 0.0 for part in center_cm(block))
    return Rest(block.order, (x, y, z), block.euler_deg)


def _lying(block: Block, rest: Rest) -> Block:
    place = origin_m(block.type, rest.euler_deg, rest.center_cm)
    return replace(block, position_m=place, euler_deg=rest.euler_deg)


_CM = 100.0
_DIGITS_ENDED, _IOU_DIGITS = 3, 4
_SLACK_CM, _SLACK_DEG, _SLACK_IOU = 0.2, 2.0, 0.15
_SET_BACK_CM = DEFAULT_TRIAL.limit_m * _CM + _SLACK_CM
_SET_BACK_DEG = DEFAULT_TRIAL.limit_deg + _SLACK_DEG
"""Where all stands, blocks are set back by up to this much, and their steps tell from where."""


@dataclass(frozen=True)
class Ended:
    """What became of a plan that was carried out: its steps, what each of them moved (None where
    that was not kept), the blocks of the goal that were reached, all that stands beside the goal,
    whether that is the whole goal and nothing else, and the engine with its version.
    """

    steps: tuple[ExecutedStep, ...]
    rests: tuple[tuple[Rest, ...] | None, ...]
    reached: int
    iou: float
    completed: bool
    engine: str


def borne_out(
    put: Sequence[Block | None],
    goal: Sequence[Block],
    ended: Ended,
    limits: ExecutionLimits,
    reached: tuple[float, float],
) -> Ended:
    """What became of a plan, where it was kept what each step moved; as it was said where not.

    `put` are the blocks as steps put them; `reached` says how near [cm, degrees] to its place a
    block of the goal is reached.
    """
    rests = [step for step in ended.rests if step is not None]
    if len(rests) != len(put) or len(ended.steps) != len(put):
        return ended
    ends = [_refused(block, step, limits) for block, step in zip(put, ended.steps, strict=True)]
    stays = [step.end not in REFUSED_ENDS for step in ends]
    moved = _lying_alone(stays, rests)
    worlds = worlds_of(put, stays, moved)
    steps = tuple(
        _step(step, number, put[number - 1], worlds[:number][-2:], limits)
        for number, step in enumerate(ends, 1)
    )
    world = worlds[-1] if worlds else ()
    cm, deg = reached
    near, far = (
        blocks_reached(goal, world, max(0.0, cm + by * _SLACK_CM), max(0.0, deg + by * _SLACK_DEG))
        for by in (-1, 1)
    )
    count = ended.reached
    if not near <= count <= far:
        count = blocks_reached(goal, world, cm, deg)
    iou, by_rests = ended.iou, voxel_iou(goal, world)
    if abs(iou - by_rests) > _SLACK_IOU:
        iou = round(by_rests, _IOU_DIGITS)
    return Ended(steps, moved, count, iou, count == len(goal) == len(world), ended.engine)


def _lying_alone(
    stays: Sequence[bool], rests: Sequence[Sequence[Rest]]
) -> tuple[tuple[Rest, ...], ...]:
    """What each step moved, without blocks that were not there."""
    return tuple(
        tuple(rest for rest in moved if 1 <= rest.step <= number and stays[rest.step - 1])
        for number, moved in enumerate(rests, 1)
    )


def _refused(block: Block | None, step: ExecutedStep, limits: ExecutionLimits) -> ExecutedStep:
    """The step, refused where there is no block or no room above the floor, and only there."""
    end: StepEnd = "overlaps" if step.end == "overlaps" else "stands"
    if block is None:
        end = "no_block"
    elif depth_cm(block) > limits.overlap_cm:
        end = "under_floor"
    is_alike = end == step.end or (end == "stands" and step.end not in REFUSED_ENDS)
    return step if is_alike else replace(step, end=end)


def _step(
    step: ExecutedStep,
    number: int,
    block: Block | None,
    worlds: Sequence[Sequence[Block]],
    limits: ExecutionLimits,
) -> ExecutedStep:
    """How a step ended, by the worlds before and after it, of which the first is left out."""
    if block is None or step.end in REFUSED_ENDS:
        return step
    before = _poses(worlds[0]) if len(worlds) > 1 else {}
    after = _poses(worlds[-1])
    way = moved_between(Pose.goal(block), after[number])
    ways = {order: moved_between(pose, after[order]) for order, pose in before.items()}
    knocked = tuple(
        order for order, far in ways.items() if _is_past(far, order in step.knocked, limits)
    )
    is_past = _is_past(way, step.end != "stands", limits)
    end = end_of(knocked, not is_past)
    told = {}
    if abs(step.moved_cm - way[0]) > _SET_BACK_CM:
        told["moved_cm"] = round(way[0], _DIGITS_ENDED)
    if abs(step.turned_deg - way[1]) > _SET_BACK_DEG:
        told["turned_deg"] = round(way[1], _DIGITS_ENDED)
    return replace(step, end=end, knocked=knocked, **told)


def _poses(world: Sequence[Block]) -> Mapping[int, Pose]:
    return {block.order: Pose.goal(block) for block in world}


def _is_past(way: tuple[float, float], said: bool, limits: ExecutionLimits) -> bool:
    """Whether a block moved past the limits of standing; as it was said where that is near."""
    allowed = (limits.stand_cm, limits.stand_deg)
    slack = (_SET_BACK_CM, _SET_BACK_DEG)
    if any(far > most + by for far, most, by in zip(way, allowed, slack, strict=True)):
        return True
    if all(far <= most - by for far, most, by in zip(way, allowed, slack, strict=True)):
        return False
    return said


_MOST_TRIED = 200
_MOST_SETTLED = 16
"""States that the physics engine is asked about, each of which may take a second."""


def buildable_order(scene: Scene, wanted: Sequence[int]) -> list[int]:
    """The vertices of a scene in a valid order, as near to the `wanted` one, which is valid too, as
    balance lets it be.

    Each step takes the first block with which what stands is in balance with every weight off by
    `MARGIN_M`, else the first with which it is in balance at all and stands in the physics engine;
    where there is none, an earlier step is taken back. The wanted order where no other is found.
    """
    return _Search(scene, wanted).found() or list(wanted)


class _Search:
    def __init__(self, scene: Scene, wanted: Sequence[int]) -> None:
        self._blocks, self._needs = scene.blocks, scene.graph.depends_on
        self._wanted = wanted
        self._dead: set[frozenset[int]] = set()
        self._left, self._settles_left = _MOST_TRIED, _MOST_SETTLED

    def found(self, order: tuple[int, ...] = ()) -> list[int]:
        """The rest of an order that begins so; empty where there is none."""
        if len(order) == len(self._blocks):
            return list(order)
        placed = frozenset(order)
        if placed not in self._dead:
            for vertex in self._next(order):
                if whole := self.found((*order, vertex)):
                    return whole
            self._dead.add(placed)
        return []

    def _next(self, order: tuple[int, ...]) -> Iterator[int]:
        """The blocks that may come next, the surest first."""
        ready = [v for v in self._wanted if v not in order and self._needs[v] <= set(order)]
        doubtful = []
        for vertex in ready:
            if self._left <= 0:
                return
            self._left -= 1
            touched = self._touched((*order, vertex))
            if is_balanced(touched, margin_m=MARGIN_M):
                yield vertex
            elif is_balanced(touched):
                doubtful.append(vertex)
        # So near to an edge engines differ, and a structure may stand while its mirror image falls.
        yield from (vertex for vertex in doubtful if self._settles((*order, vertex)))

    def _settles(self, order: tuple[int, ...]) -> bool:
        self._settles_left -= 1
        return self._settles_left >= 0 and settle(self._touched(order)).stands

    def _touched(self, order: tuple[int, ...]) -> tuple[Block, ...]:
        """The blocks that hang together with the last one."""
        blocks = [replace(self._blocks[v], order=place) for place, v in enumerate(order)]
        return next(group for group in groups(blocks) if blocks[-1] in group)


CARRY_VERSION = 2
"""Version of how plans are carried out and of how what stands in the end is measured; it goes up
where some plan may end otherwise. Before 2 everything in the world was let go together, for 5 s
where it crept, and voxels were whole or empty.
"""
_ONE_AT_A_TIME = threading.Lock()
_KEPT = 32
_DIGITS_JUDGING = 4
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
            "shift_cm": [round(part, _DIGITS_JUDGING) + 0.0 for part in motion.shift_cm],
            "turn_deg": round(math.degrees(motion.turn_rad), _DIGITS_JUDGING) + 0.0,
            "steps": [_step_judging(*step) for step in whole],
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
        ended = _carried_judging(item, blocks, rules)
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


def _carried_judging(item: AssemblyTask, blocks: Sequence[Block | None], rules: PoseRules) -> Ended:
    # An engine has no more than one plan at a time, whichever thread asks.
    with _ONE_AT_A_TIME:
        done: Execution = execute(blocks, rules.limits)
    goal = item.scene.blocks
    reached = blocks_reached(goal, done.blocks, rules.reached_cm, rules.reached_deg)
    is_whole = reached == len(goal) == len(done.blocks)
    iou = round(voxel_iou(goal, done.blocks), _DIGITS_JUDGING)
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


def _step_judging(
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
