"""Full planning: a whole plan in one reply.

Baselines make plans without seeing the goal, from how often blocks like each candidate are needed.
They may also use how much of each color the picture of the goal shows, and nothing else in it. The
plan of a scene never uses scenes that share a base scene with it.
"""

from __future__ import annotations

import functools
import math
from collections import Counter, defaultdict
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import product
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from phyblock.config.validation import PictureControls
from phyblock.data.official import official_prompt
from phyblock.domain.scene import AssemblyTask, Block, Candidate, CandidateSet, Kind, Plan, Scene
from phyblock.errors import DataError, Problem
from phyblock.files import bundled
from phyblock.parsing.plan import ParsedPlan, parse_plan, plan_form
from phyblock.parsing.text import AnswerForm
from phyblock.records.record import Line, Record, Score
from phyblock.scoring.plan import BLOCK_OUTCOMES, ERROR_TYPES, AssemblyScorer, Goal, most_placed
from phyblock.sim.pictures import PictureStyle, goal_camera, segments
from phyblock.tracks.base import Judgement, Picking, SceneTrack, candidate_choices, presented
from phyblock.tracks.measures import SampleCounts, level_cells
from phyblock.tracks.prompts import OfficialPrompt, Prompt
from phyblock.types import CandidateOrder, Setting, View


class PlanningSpec(PictureControls):
    """Presentation of scenes in the full_planning track, besides `images` and `candidates`."""


class PlanParse(Line):
    """The plan that was parsed from a reply."""

    parser: str
    """Parser of replies."""
    rule: str | None
    """The rule that matched; null: nothing could be parsed."""
    plan: tuple[int, ...]
    """Candidate numbers in order, as shown to the model."""
    dropped: tuple[int, ...] = ()
    """Numbers that no candidate has."""
    problem: str | None = None
    """Reason why nothing could be parsed."""
    truncated: bool = False
    """True if the text breaks off within the plan."""


class PlanRecord(Record):
    """A plan for a scene."""

    track: Literal["full_planning"]
    """`full_planning`."""
    parse: PlanParse | None = None
    """The parsed plan."""

    def built(self, task: AssemblyTask) -> tuple[Block, ...]:
        """Return the blocks that were placed by the headline score."""
        placed = next((one.placed for one in self.scores if one.placed is not None), ())
        return tuple(task.scene.blocks[vertex] for vertex in placed if vertex is not None)


@dataclass(frozen=True)
class PlanSubject:
    """A scene to plan; `guess` never sees the goal, or of it only color areas (`sees_colors`)."""

    scene: Scene
    candidates: CandidateSet
    guess: Callable[..., Plan] = field(default=lambda **_: Plan(), compare=False)


Floats = NDArray[np.float64]
_MOST_COPIES = 6
"""The most times that one unit is named."""
_PRIOR = 4.0
"""Weight of the overall frequency in every row of a table, in units."""
_THRESHOLDS = (0.0, 0.1, 0.14, 0.18, 0.23, 0.3, 0.4)
_SIDE_PX = 128
"""Side of the pictures in which colors are measured [pixels]."""
Areas = Mapping[str, float]
"""Share of each color in the area of blocks in a picture; colors not shown are absent."""


class Unit(NamedTuple):
    """A group of candidates that are equal under a setting: one in A, all of a kind in B.

    `numbers` are its candidates', `candidate` the first; `poses` is how many its kind has, `rank`
    its place among them from 0, `area` the share of its color in the goal's picture, if known.
    """

    numbers: tuple[int, ...]
    candidate: Candidate
    poses: int
    rank: int
    area: float = 0.0


Key = Callable[[Unit], Hashable]
KEYS: tuple[Key, ...] = (
    lambda unit: unit.candidate.look,
    lambda unit: (unit.candidate.type, unit.poses, unit.rank),
)
"""Rows of the table of frequencies: looks; types by the poses offered and the place among them."""
AREA_KEYS: tuple[Key, ...] = (
    lambda unit: math.ceil(10 * unit.area),
    lambda unit: (math.ceil(10 * unit.area), unit.candidate.type),
)
"""Rows where areas are known: tenths of the color, 0 for none; the same by type."""


def units(candidates: CandidateSet, setting: Setting, areas: Areas | None = None) -> list[Unit]:
    """Return the units of a candidate set under a setting, by their numbers."""
    numbers_of: dict[Kind, list[int]] = defaultdict(list)
    for number, one in enumerate(candidates.candidates, 1):
        numbers_of[one.kind].append(number)
    made = []
    for number, one in enumerate(candidates.candidates, 1):
        same, area = tuple(numbers_of[one.kind]), (areas or {}).get(one.color, 0.0)
        if setting == "A":
            made.append(Unit((number,), one, len(same), same.index(number), area))
        elif number == same[0]:
            made.append(Unit(same, one, len(same), 0, area))
    return made


def related(scenes: Sequence[Scene]) -> list[list[int]]:
    """Return for each scene the places of scenes that share a base scene with it, its own too."""
    bases = [{scene.id, *scene.parents} for scene in scenes]
    by_base: dict[str, set[int]] = defaultdict(set)
    for place, names in enumerate(bases):
        for name in names:
            by_base[name].add(place)
    return [sorted(set().union(*(by_base[name] for name in names))) for names in bases]


def goal_blind_plans(
    scenes: Sequence[Scene],
    candidates: Mapping[str, CandidateSet],
    setting: Setting,
    keys: Sequence[Key] = KEYS,
    repeats: bool = True,
    areas: Mapping[str, Areas] | None = None,
) -> dict[str, Plan]:
    """Return for each scene a plan learned from unrelated scenes.

    Each combination of key, threshold and order makes plans; a scene uses the one that scores best
    on unrelated scenes. Without `repeats` no candidate is named twice. `areas` are the goals'.
    """
    kin, seen = related(scenes), areas or {}
    goals = [Goal(scene, candidates[scene.id], setting) for scene in scenes]
    offered = [units(candidates[one.id], setting, seen.get(one.id)) for one in scenes]

    def height(unit: Unit, goal: Goal) -> tuple[bool, float]:
        equal, layers = goal.equal_to[unit.numbers[0]], goal.graph.layers
        mean = sum(layers[v] for v in equal) / len(equal) / max(layers) if equal else 0.0
        return bool(equal), mean

    def pose(unit: Unit) -> Hashable:
        return unit.candidate.type, unit.candidate.look[2]

    # The mean height, 0..1, of the type and pose of each unit in unrelated scenes. Sums from which
    # a part was subtracted are accurate to nine digits.
    heights = [
        ((part[:, 2] + whole[2] / max(whole[1], 1.0)) / (part[:, 1] + 1.0)).round(9)
        for part, whole in _left_out(offered, goals, kin, pose, height)
    ]
    likely = zip(*(chances(offered, goals, kin, key) for key in keys), strict=True)
    plans_of = map(partial(_plans, repeats=repeats), offered, likely, heights)
    ways = list(zip(*plans_of, strict=True))

    @functools.cache
    def score(place: int, plan: Plan) -> tuple[int, int]:
        tp = most_placed(goals[place], plan)
        return tp, len(plan) + len(goals[place].graph) - 2 * tp

    scores = [[score(place, plan) for place, plan in enumerate(way)] for way in ways]
    counts = np.array(scores, dtype=np.int64)
    total = counts.sum(axis=1)
    plans = {}
    for place, (scene, others) in enumerate(zip(scenes, kin, strict=True)):
        tp, wrong = (total - counts[:, others].sum(axis=1)).T
        # Without unrelated scenes, nothing is learned.
        best = int((2 * tp / np.maximum(2 * tp + wrong, 1)).argmax())
        every = Plan(tuple(range(1, len(candidates[scene.id]) + 1)))
        plans[scene.id] = ways[best][place] if (tp + wrong).any() else every
    return plans


def chances(
    offered: Sequence[Sequence[Unit]], goals: Sequence[Goal], kin: Sequence[Sequence[int]], key: Key
) -> list[Floats]:
    """Return, for each scene, the probability that the goal has at least n copies of a unit.

    Shape (units, copies); rare rows of the table are shrunk towards the overall frequency.
    """

    def needed(unit: Unit, goal: Goal) -> list[bool]:
        count = len(goal.equal_to[unit.numbers[0]])
        return [count > copy for copy in range(_MOST_COPIES)]

    return [
        (part[:, 1:] + _PRIOR * whole[1:] / max(whole[0], 1.0)) / (part[:, :1] + _PRIOR)
        for part, whole in _left_out(offered, goals, kin, key, needed)
    ]


def _left_out(
    offered: Sequence[Sequence[Unit]],
    goals: Sequence[Goal],
    kin: Sequence[Sequence[int]],
    key: Key,
    measure: Callable[[Unit, Goal], Sequence[float]],
) -> Iterator[tuple[Floats, Floats]]:
    """Yield for each scene the number and the summed measures of units in unrelated scenes, of
    those that have the key of each of its units, and of all.
    """
    row_of: dict[Hashable, int] = {}
    rows = [[row_of.setdefault(key(unit), len(row_of)) for unit in of] for of in offered]
    values = [
        np.array([(1.0, *measure(unit, goal)) for unit in of])
        for of, goal in zip(offered, goals, strict=True)
    ]
    table = np.zeros((len(rows), len(row_of), values[0].shape[1]))
    for of_scene, places, value in zip(table, rows, values, strict=True):
        np.add.at(of_scene, places, value)
    total = table.sum(axis=0)
    for place, others in enumerate(kin):
        rest = total - table[others].sum(axis=0)
        yield rest[rows[place]], rest.sum(axis=0)


def _plans(
    offered: Sequence[Unit], by_key: Sequence[Floats], heights: Floats, *, repeats: bool
) -> list[Plan]:
    """Return the plans of every way: all likely units by height, once or repeatedly."""
    own = np.array([len(unit.numbers) for unit in offered])
    unit, copy = (of.ravel() for of in np.indices(by_key[0].shape))
    number = np.array([one.numbers[n % len(one.numbers)] for one in offered
                       for n in range(_MOST_COPIES)])  # fmt: skip
    height, is_first = heights[unit], copy < own[unit]
    orders = (np.lexsort((number, copy, height)), np.lexsort((number, height, copy)))
    plans = []
    for likely in by_key:
        least = np.minimum(_THRESHOLDS, likely[:, 0].max())
        any_copy = likely.ravel() >= least[:, None]
        first = any_copy & is_first
        # If every unit is likely enough, none is named again.
        any_copy[0] = first[0]
        for n, by, again in product(range(len(least)), orders, {False, repeats}):
            named = (any_copy if again else first)[n, by]
            plans.append(Plan(tuple(number[by][named].tolist())))
    return plans


@functools.lru_cache(maxsize=4096)
def color_areas(scene: Scene, view: View) -> Areas:
    """Return the share of each color in the area of blocks in the picture of a goal."""
    camera = goal_camera(scene, PictureStyle.from_view(view, _SIDE_PX))
    seen = segments(scene.blocks, camera, _SIDE_PX)
    shown = [scene.blocks[vertex].color for vertex in seen[seen >= 0].tolist()]
    return {color: n / len(shown) for color, n in Counter(shown).items()}


@functools.lru_cache(maxsize=16)
def blind_guesses(
    pool: tuple[AssemblyTask, ...], order: CandidateOrder, setting: Setting
) -> Callable[..., Plan]:
    """Return a function from a task of a pool and a view to its plan, in the numbers shown.

    A plan that `sees_colors` also uses their areas in the picture of the goal. Each order has its
    own plans, as places in the file's are informative. The task's own goal is never used.
    """

    @functools.cache
    def learned(seed: int, view: View | None) -> dict[str, Plan]:
        shown = [presented(one, seed, order) for one in pool]
        scenes = [one.scene for one in shown]
        candidates = {one.key: one.candidates for one in shown}
        if view is None:
            return goal_blind_plans(scenes, candidates, setting)
        areas = {scene.id: color_areas(scene, view) for scene in scenes}
        return goal_blind_plans(scenes, candidates, setting, AREA_KEYS, areas=areas)

    def plan(task: AssemblyTask, view: View, *, sees_colors: bool = False) -> Plan:
        return learned(task.seed, view if sees_colors else None)[task.key]

    return plan


def plan_text(steps: Iterable[int]) -> str:
    """Return a plan in the benchmark's own reply form."""
    return "\n".join(f"Step{i}: Move block with index {n}" for i, n in enumerate(steps, 1))


RANDOM_STEPS = 4
"""The number of steps in the paper's Random row."""


def _in_valid_order(choose: Callable[[PlanSubject, Block, np.random.Generator], int | None]) -> Any:
    """Return the rule that takes a random valid order, and chooses a candidate for each block."""

    def rule(subject: PlanSubject, rng: np.random.Generator) -> str:
        blocks = [subject.scene.blocks[v] for v in subject.scene.graph.random_order(rng)]
        return plan_text(choose(subject, b, rng) or needed_candidate(subject, b) for b in blocks)

    return rule


def _turned(subject: PlanSubject, block: Block, rng: np.random.Generator) -> int | None:
    """Return a candidate of the block's kind that looks different, or None."""
    listed = enumerate(subject.candidates.candidates, 1)
    wrong = [n for n, one in listed if one.kind == block.kind and one.look != block.look]
    return wrong[int(rng.integers(len(wrong)))] if wrong else None


def needed_candidate(subject: Any, block: Block) -> int:
    """Return the number of the candidate that looks like a block. Raises DataError if none does."""
    index: int | None = subject.candidates.index_of(block.look)
    if index is None:
        found = f"{block.color} {block.type} turned {block.euler_deg}"
        where, place = f"scene {subject.scene.id}", f"blocks[order={block.order}]"
        raise DataError(Problem(where, "no candidate looks like this block", place, found))
    return index


def pose_counts(item: AssemblyTask, record: Any) -> tuple[int, ...]:
    """Count the kinds that a plan or an episode names and whose pose could be wrong.

    These are needed in some poses and offered in others, too. Returns the number first named in a
    right pose and the total, for kinds whose first listed pose is right, then for all others.
    """
    offered, chosen = item.offered, dict[Kind, bool]()
    for step in record.parse.plan:
        if 1 <= step <= len(offered):
            chosen.setdefault(*offered[step - 1])
    counts = Counter[tuple[bool, bool]]()
    for kind in {block.kind for block in item.scene.blocks} & chosen.keys():
        right = [is_right for of, is_right in offered if of == kind]
        counts[right[0], chosen[kind]] += not all(right)
    first, later = ((counts[one, True], counts[one, False]) for one in (True, False))
    return first[0], sum(first), later[0], sum(later)


POSE_COUNTS = SampleCounts(
    "poses", ("first_right", "first_n", "later_right", "later_n"), sample=pose_counts
)


def _steps(score: Score) -> tuple[float, ...]:
    """Count steps; under `membership`, repeated ones count again, so single plans have no value."""
    alone = score.criterion != "membership"
    named = 2 * score.tp + score.fp + score.fn
    f1 = 2 * score.tp / named if named else 0.0
    whole = alone and score.fp == score.fn == 0
    return score.tp, score.fp, score.fn, whole, alone * f1, alone


def _wrong_steps(score: Score) -> list[int] | None:
    errors = score.errors or {}
    return [errors.get(name, 0) for name in ERROR_TYPES] if score.criterion == "aov" else None


def _blocks(score: Score) -> tuple[float, ...] | None:
    """Count plans under criteria that require an order."""
    if score.criterion != "aov" or score.kept is None:
        return None
    blocks, outcomes = score.tp + score.fn, score.blocks or {}
    both = blocks + score.tp + score.fp
    distance = 1 - 2 * score.kept / both if both else 0.0
    return (*(outcomes.get(name, 0) for name in BLOCK_OUTCOMES), blocks, distance, 1)


_OUTCOMES = tuple(f"blocks_{name}" for name in BLOCK_OUTCOMES)


class FullPlanning(SceneTrack):
    """Asks for a whole plan in one reply."""

    name = "full_planning"
    title = "Full planning"
    section = name
    options = PlanningSpec
    template = bundled("prompts", "full_planning.j2")
    baselines: ClassVar = {
        "random": lambda subject, rng: plan_text(
            rng.integers(1, len(subject.candidates) + 1, RANDOM_STEPS).tolist()
        ),
        "all-candidates": lambda subject, _: plan_text(range(1, len(subject.candidates) + 1)),
        "goal-blind": lambda subject, _: plan_text(subject.guess().steps),
        "color-areas": lambda subject, _: plan_text(subject.guess(sees_colors=True).steps),
        "first-pose": _in_valid_order(
            lambda subject, block, _: subject.candidates.first_of(block.kind)
        ),
        "oracle": _in_valid_order(lambda *_: None),
        "oracle-no-orientation": _in_valid_order(_turned),
    }
    record = PlanRecord
    counted = (
        SampleCounts("steps", ("tp", "fp", "fn", "whole", "f1", "plans"), score=_steps),
        SampleCounts("blocks", (*_OUTCOMES, "blocks", "distance", "plans"), score=_blocks),
        SampleCounts("wrong_steps", ERROR_TYPES, score=_wrong_steps),
        POSE_COUNTS,
    )
    results: ClassVar = {"cells": level_cells}
    varies = ("prompt", "background", "view", "candidate_order", "layout", "repeats")

    @staticmethod
    def by_hand(subject: PlanSubject) -> Picking:
        """Return the choices of a person: any candidates, each as often as needed."""
        return Picking(
            candidate_choices(len(subject.candidates)),
            lambda picks: plan_text(pick.place + 1 for pick in picks),
            "Pick the blocks that build the goal, each once all it rests on is there.",
            most=99,  # Far more than any goal has.
            repeats=True,
        )

    def open(self) -> None:
        """Select scenes."""
        super().open()
        suite, pool = self.suite, tuple(self.dataset.tasks)
        self._guess = blind_guesses(pool, suite.candidates.order, suite.settings[0])
        self._scorers: dict[object, AssemblyScorer] = {}

    def open_prompt(self) -> Prompt:
        """Return the official prompt, or a template."""
        if self.suite.prompt != "official":
            return super().open_prompt()
        return OfficialPrompt(official_prompt(self.suite.files.dataset))

    def json_form(self, item: AssemblyTask) -> AnswerForm[list[int]]:
        """Return the JSON form of a plan."""
        return plan_form(len(item.candidates))

    def subject_of(self, item: AssemblyTask) -> PlanSubject:
        """Return the subject of baselines."""
        view = self.suite.images.view
        return PlanSubject(item.scene, item.candidates, partial(self._guess, item, view))

    def judge(self, item: AssemblyTask, text: str | None) -> Judgement:
        """Parse and score a reply; a missing reply (None) is scored as an empty plan."""
        suite, parsed, key = self.suite, ParsedPlan(Plan(), None), (item.key, item.candidates)
        if text is not None:
            parsed = parse_plan(text, len(item.candidates), suite.parser)
        if key not in self._scorers:
            self._scorers[key] = AssemblyScorer(item.scene, item.candidates, suite.settings)
        level1 = None if suite.scoring.level1 == "aov" else suite.scoring.level1
        scores = self._scorers[key].score(parsed.plan, suite.scoring.matchers, level1)
        parse = {"parser": suite.parser, **vars(parsed), "plan": parsed.plan.steps}
        return Judgement(parsed.rule is not None, {"parse": parse, "scores": scores})
