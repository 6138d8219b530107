"""The full-planning track: one picture and prompt in, one whole plan out (paper section 4.1)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from phyblock.datasets import AssemblyTask
from phyblock.domain import Plan
from phyblock.models.base import Image, Request
from phyblock.parsing import ParsedPlan, PlanParser, parse_plan
from phyblock.scoring import AssemblyScorer, Level1Criterion, Matcher, Score, Setting
from phyblock.tasks.pictures import Pictures
from phyblock.tasks.prompts import Prompt

__all__ = ["FullPlanning", "Judgement", "Outcome", "PlanningRules"]

Outcome = Literal["ok", "parse_failure", "refusal", "truncated", "api_error", "missing"]


@dataclass(frozen=True)
class PlanningRules:
    """How replies are read and scored; the first matcher is the headline."""

    parser: PlanParser
    settings: tuple[Setting, ...]
    matchers: tuple[Matcher, ...]
    level1: Level1Criterion | None


@dataclass(frozen=True)
class Judgement:
    """What a reply was read as, and what that is worth."""

    parsed: ParsedPlan
    scores: tuple[Score, ...]


class FullPlanning:
    """Prompt, parse and score of the track; pure but for the pictures it asks for."""

    name = "full_planning"

    def __init__(
        self, rules: PlanningRules, prompt: Prompt | None = None, pictures: Pictures | None = None
    ) -> None:
        self.rules = rules
        self._prompt = prompt
        self._pictures = pictures
        self._scorers: dict[str, AssemblyScorer] = {}

    async def request(
        self, task: AssemblyTask, seed: int, params: Mapping[str, object], *, with_messages: bool
    ) -> Request:
        """The request of one sample; without messages for models that need none."""
        if not with_messages or self._prompt is None or self._pictures is None:
            return Request(task.scene.id, seed, (), params, "", task.scene, task.candidates)
        return self._request(task, seed, params, self._prompt, await self._pictures.of(task))

    def outline(self, task: AssemblyTask) -> tuple[Request, bool]:
        """A request with seed 0 and no parameters, made without rendering anything, and whether
        its pictures are the real ones.
        """
        if self._prompt is None or self._pictures is None:
            return Request(task.scene.id, 0, (), {}, "", task.scene, task.candidates), True
        pictures, real = self._pictures.outline(task)
        return self._request(task, 0, {}, self._prompt, pictures), real

    def _request(
        self,
        task: AssemblyTask,
        seed: int,
        params: Mapping[str, object],
        prompt: Prompt,
        pictures: tuple[Image, ...],
    ) -> Request:
        messages = prompt.messages(pictures, self.facts(task, pictures))
        version = prompt.version
        return Request(task.scene.id, seed, messages, params, version, task.scene, task.candidates)

    def facts(self, task: AssemblyTask, pictures: tuple[Image, ...]) -> dict[str, object]:
        """What templates may use; nothing in it gives an answer away."""
        return {
            "pictures": [picture.label for picture in pictures],
            "n_candidates": len(task.candidates),
        }

    def judge(self, task: AssemblyTask, text: str | None) -> Judgement:
        """Read and score a reply; None, where there is no reply, is scored as an empty plan."""
        parsed = (
            ParsedPlan(Plan(), None)
            if text is None
            else parse_plan(text, len(task.candidates), self.rules.parser)
        )
        scorer = self._scorers.get(task.scene.id)
        if scorer is None:
            scorer = AssemblyScorer(task.scene, task.candidates, self.rules.settings)
            self._scorers[task.scene.id] = scorer
        return Judgement(parsed, scorer.score(parsed.plan, self.rules.matchers, self.rules.level1))
