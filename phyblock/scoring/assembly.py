"""Everything one plan is worth: every setting, matcher and criterion in one pass."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from phyblock.domain import CandidateSet, Plan, Scene
from phyblock.scoring.error_types import ErrorType, count_errors
from phyblock.scoring.goal import Goal
from phyblock.scoring.level1 import level1_counts
from phyblock.scoring.losses import BlockOutcome, block_outcomes
from phyblock.scoring.match import match_plan, step_errors
from phyblock.scoring.metrics import Counts
from phyblock.scoring.nearest import steps_kept
from phyblock.types import Criterion, Level1Criterion, Matcher, Setting

__all__ = ["AssemblyScorer", "Score"]


@dataclass(frozen=True)
class Score:
    """Counts of one plan under one criterion and setting.

    `matcher`, `errors` (wrong steps by type), `vertices` (the goal vertex each step placed),
    `step_errors`, `blocks` (goal blocks by what became of them) and `kept` (steps that the nearest
    valid order keeps) belong to criterion `aov` and are None for the Level-1 criteria.
    """

    criterion: Criterion
    setting: Setting
    counts: Counts
    matcher: Matcher | None = None
    errors: dict[ErrorType, int] | None = None
    vertices: tuple[int | None, ...] | None = None
    step_errors: tuple[ErrorType | None, ...] | None = None
    blocks: dict[BlockOutcome, int] | None = None
    kept: int | None = None


class AssemblyScorer:
    """Scores plans for one scene; build once, use for every model and seed."""

    def __init__(self, scene: Scene, candidates: CandidateSet, settings: Sequence[Setting]) -> None:
        self._scene = scene
        self._goals = {setting: Goal(scene, candidates, setting) for setting in settings}

    def score(
        self, plan: Plan, matchers: Sequence[Matcher], level1: Level1Criterion | None
    ) -> tuple[Score, ...]:
        """Scores by setting, then matcher; the Level-1 criterion only for scenes of level 1.

        Raises KeyError for a step that is no candidate.
        """
        scores: list[Score] = []
        for setting, goal in self._goals.items():
            scores += _aov(goal, plan, setting, matchers) if matchers else ()
            if level1 is not None and 1 in self._scene.levels:
                scores.append(Score(level1, setting, level1_counts(goal, plan, level1)))
        return tuple(scores)


def _aov(goal: Goal, plan: Plan, setting: Setting, matchers: Sequence[Matcher]) -> Iterator[Score]:
    matches = [match_plan(goal, plan, matcher) for matcher in matchers]
    placed = [match.counts.tp for match in matches]
    kept = steps_kept(goal, plan, max(placed))
    outcomes = block_outcomes(goal, plan, placed)
    for matcher, match, blocks in zip(matchers, matches, outcomes, strict=True):
        why = step_errors(goal, plan, match)
        errors = count_errors(why)
        yield Score(
            "aov", setting, match.counts, matcher, errors, match.vertices, why, blocks, kept
        )
