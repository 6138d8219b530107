"""Full planning: a whole plan in one reply."""

from __future__ import annotations

import functools
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import numpy as np

from phyblock.config.validation import PictureControls
from phyblock.data.official import official_prompt
from phyblock.domain.scene import AssemblyTask, Block, CandidateSet, Kind, Plan, Scene
from phyblock.errors import DataError, Problem
from phyblock.files import bundled
from phyblock.parsing.plan import ParsedPlan, parse_plan, plan_form
from phyblock.parsing.text import AnswerForm
from phyblock.records.record import Line, Record, Score
from phyblock.scoring.plan import BLOCK_OUTCOMES, ERROR_TYPES, AssemblyScorer, Counts
from phyblock.tracks.base import Judgement, SceneTrack
from phyblock.tracks.goal_blind import blind_guesses
from phyblock.tracks.measures import SampleCounts, level_cells
from phyblock.tracks.picking import Picking, candidate_choices
from phyblock.tracks.prompts import OfficialPrompt, Prompt


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
    """The scene that baselines and people answer about; `guess` returns a plan learned without
    the goal, or with only the areas of its colors if it `sees_colors`.
    """

    scene: Scene
    candidates: CandidateSet
    guess: Callable[..., Plan] = field(default=lambda **_: Plan(), compare=False)


def plan_text(steps: Iterable[int]) -> str:
    """Return a plan in the benchmark's own reply form."""
    return "\n".join(f"Step{i}: Move block with index {n}" for i, n in enumerate(steps, 1))


_RANDOM_STEPS = 4
"""The number of steps in the paper's Random row."""


def _in_valid_order(choose: Callable[[PlanSubject, Block, np.random.Generator], int | None]) -> Any:
    """Return the rule that takes a random valid order, and chooses a candidate for each block."""

    def rule(subject: PlanSubject, rng: np.random.Generator) -> str:
        blocks, order = subject.scene.blocks, subject.scene.graph.random_order(rng)
        return plan_text(
            choose(subject, blocks[v], rng) or needed_candidate(subject, blocks[v]) for v in order
        )

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


PLAN_RULES: Mapping[str, Callable[..., str]] = {
    "random": lambda subject, rng: plan_text(
        rng.integers(1, len(subject.candidates) + 1, _RANDOM_STEPS).tolist()
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


def pick_plan(subject: PlanSubject) -> Picking:
    """Return the choices of a person: any candidates, each as often as needed."""
    return Picking(
        candidate_choices(len(subject.candidates)),
        least=1,
        most=99,  # Far more than any goal has.
        repeats=True,
        noun="step",
        write=lambda picks: plan_text(pick.place + 1 for pick in picks),
        task="Pick the blocks that build the goal, each once all it rests on is there.",
    )


def pose_counts(item: AssemblyTask, record: Any) -> tuple[int, ...]:
    """Count the kinds that a plan or an episode names and whose pose could be wrong.

    These are needed in some poses and offered in others, too. Returns the number that is first
    named in a right pose and the total, for kinds whose first listed pose is right, then for all
    others. Numbers that no candidate has are ignored.
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
    f1 = Counts(score.tp, score.fp, score.fn).f1 or 0.0
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
COUNTS = (
    SampleCounts("steps", ("tp", "fp", "fn", "whole", "f1", "plans"), score=_steps),
    SampleCounts("blocks", (*_OUTCOMES, "blocks", "distance", "plans"), score=_blocks),
    SampleCounts("wrong_steps", ERROR_TYPES, score=_wrong_steps),
    POSE_COUNTS,
)


class FullPlanning(SceneTrack):
    """Asks for a whole plan in one reply."""

    name = "full_planning"
    title = "Full planning"
    section = name
    options = PlanningSpec
    template = bundled("prompts", "full_planning.j2")
    baselines = PLAN_RULES
    by_hand = staticmethod(pick_plan)
    record = PlanRecord
    counted = COUNTS
    results: ClassVar = {"cells": level_cells}
    varies = ("prompt", "background", "view", "candidate_order", "layout", "repeats")

    def open(self) -> None:
        """Select scenes."""
        super().open()
        self._guess = blind_guesses(self.suite, self.dataset.tasks, self.suite.settings[0])
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
        return PlanSubject(item.scene, item.candidates, functools.partial(self._guess, item))

    def judge(self, item: AssemblyTask, text: str | None) -> Judgement:
        """Parse and score a reply; a missing reply (None) is scored as an empty plan."""
        suite, parsed, key = self.suite, ParsedPlan(Plan(), None), (item.key, item.candidates)
        if text is not None:
            parsed = parse_plan(text, len(item.candidates), suite.parser)
        if key not in self._scorers:
            self._scorers[key] = AssemblyScorer(item.scene, item.candidates, suite.settings)
        level1 = None if suite.scoring.level1 == "aov" else suite.scoring.level1
        scores = self._scorers[key].score(parsed.plan, suite.scoring.matchers, level1)
        parse = {
            "parser": suite.parser,
            "plan": parsed.plan.steps,
            **{n: getattr(parsed, n) for n in ("rule", "dropped", "problem", "truncated")},
        }
        fields = {"parse": parse, "scores": list(map(vars, scores))}
        return Judgement(parsed.rule is not None, fields)


TRACK = FullPlanning
