"""The full-planning track: one picture and prompt in, one whole plan out (paper section 4.1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from phyblock.data import AssemblyTask
from phyblock.domain import Plan
from phyblock.models.base import Image
from phyblock.parsing.plan import ParsedPlan, parse_plan, plan_form, reader_version
from phyblock.parsing.structured import AnswerForm
from phyblock.scoring.plan import AssemblyScorer, Score
from phyblock.tracks.examples import Examples
from phyblock.tracks.full_planning.baselines import PlanSubject
from phyblock.tracks.full_planning.worked import worked_plan
from phyblock.tracks.goal_blind.guessing import BlindGuesses
from phyblock.tracks.pictures import Pictures
from phyblock.tracks.plans import score_fields
from phyblock.tracks.prompts import Prompt
from phyblock.tracks.showing import TaskShowing, file_plan
from phyblock.tracks.whole_plans import AS_IN_FILE, WholePlanTrack
from phyblock.types import AnswerFormat, Level1Criterion, Matcher, PlanParser, Setting

__all__ = ["FullPlanning", "PlanJudgement", "PlanningRules"]


@dataclass(frozen=True)
class PlanningRules:
    """How replies are read and scored; the first matcher is the headline."""

    parser: PlanParser
    settings: tuple[Setting, ...]
    matchers: tuple[Matcher, ...]
    level1: Level1Criterion | None
    answer_format: AnswerFormat = "text"

    def form(self, item: AssemblyTask) -> AnswerForm[list[int]] | None:
        """The form in which a plan for a scene is asked for; None where that is text."""
        return None if self.answer_format == "text" else plan_form(len(item.candidates))

    def read(self, item: AssemblyTask, text: str) -> ParsedPlan:
        """What a reply to a question about a scene says."""
        return parse_plan(text, len(item.candidates), self.parser)


@dataclass(frozen=True)
class PlanJudgement:
    """What a reply was read as, and what that is worth."""

    parser: PlanParser
    parsed: ParsedPlan
    scores: tuple[Score, ...]
    in_file: tuple[int, ...] | None = None
    """The plan in the numbers of the file, where others were shown."""

    @property
    def steps(self) -> tuple[int, ...]:
        """The candidates that were named, in order."""
        return self.parsed.plan.steps

    @property
    def is_read(self) -> bool:
        """Whether a rule matched."""
        return self.parsed.rule is not None

    def fields(self) -> dict[str, Any]:
        """`parse` and `scores` of the record (docs/results.md)."""
        return {
            "parse": {
                "parser": self.parser,
                "rule": self.parsed.rule,
                "plan": list(self.parsed.plan.steps),
                "file_plan": self.in_file,
                "dropped": list(self.parsed.dropped),
                "version": reader_version(self.parser),
                "problem": self.parsed.problem,
                "truncated": self.parsed.truncated,
            },
            "scores": [score_fields(score) for score in self.scores],
        }


class FullPlanning(WholePlanTrack[PlanningRules, Pictures]):
    """Prompt, parse and score of the track; pure but for the pictures it asks for."""

    name = "full_planning"

    def __init__(
        self,
        rules: PlanningRules,
        prompt: Prompt | None = None,
        pictures: Pictures | None = None,
        items: Sequence[AssemblyTask] = (),
        showing: TaskShowing = AS_IN_FILE,
        pool: Sequence[AssemblyTask] = (),
        examples: Examples[AssemblyTask] | None = None,
    ) -> None:
        """`prompt` and `pictures` are None where every model is a recording; from `pool`, else
        `items`, baselines learn. `examples` are in the form in which they are shown.
        """
        super().__init__(rules, prompt, pictures, items, showing, examples)
        self._guesses = BlindGuesses(showing, pool or items, rules.settings[0])
        self._scorers: dict[object, AssemblyScorer] = {}

    def facts(self, item: AssemblyTask, pictures: tuple[Image, ...]) -> dict[str, object]:
        """What templates may use; nothing in it gives an answer away."""
        scale = None if self._pictures is None else self._pictures.candidate_scale
        return {**super().facts(item, pictures), "candidate_scale": scale}

    def _right_answer(self, item: AssemblyTask) -> str:
        return worked_plan(item, self._form(item))

    def _subject(self, item: AssemblyTask) -> PlanSubject:
        guess = partial(self._guesses.plan, item)
        return PlanSubject(item.scene, item.candidates, guess)

    def judge(self, item: AssemblyTask, text: str | None) -> PlanJudgement:
        """Read and score a reply; None, where there is no reply, is scored as an empty plan."""
        parsed = ParsedPlan(Plan(), None) if text is None else self.rules.read(item, text)
        key = (item.key, item.candidates)
        scorer = self._scorers.get(key)
        if scorer is None:
            scorer = AssemblyScorer(item.scene, item.candidates, self.rules.settings)
            self._scorers[key] = scorer
        scores = scorer.score(parsed.plan, self.rules.matchers, self.rules.level1)
        in_file = file_plan(item, parsed.plan.steps)
        return PlanJudgement(self.rules.parser, parsed, scores, in_file)
