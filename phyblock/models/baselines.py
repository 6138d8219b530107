"""Built-in baselines: they answer as a model would, in the benchmark's own reply form."""

from __future__ import annotations

import numpy as np

from phyblock.config.models import ModelConfig
from phyblock.errors import Problem, SpecError
from phyblock.models.request import Request
from phyblock.records.reply import Reply, Usage
from phyblock.registry import baseline_names, baseline_rules
from phyblock.stable import drawn_bytes


class BaselineModel:
    """A rule instead of a model.

    What it draws depends on its name, the seed and the request's key alone, not on the order in
    which it is asked. It looks at no prompt and no picture, and so none is made for it.
    """

    needs_messages = False

    def __init__(self, config: ModelConfig) -> None:
        if config.name not in baseline_names():
            allowed = ", ".join(baseline_names())
            problem = Problem(f"model {config.name}", "is no baseline", "", config.name, allowed)
            raise SpecError(problem)
        self.name = config.name
        self._rules = baseline_rules(config.name)

    async def ask(self, request: Request) -> Reply:
        """Return the rule's answer; DataError when an oracle lacks a candidate, SpecError for a
        subject that the baseline has no rule for.
        """
        rule = self._rules.get(type(request.subject))
        if rule is None:
            problem = Problem(f"model {self.name}", "has no rule for this track")
            raise SpecError(problem)
        digest = drawn_bytes(f"{self.name}|{request.seed}|{request.key}")
        rng = np.random.default_rng(int.from_bytes(digest, "big"))
        return Reply(
            text=rule(request.subject, rng),
            usage=Usage(prompt_tokens=0, completion_tokens=0),
            cost_usd=0.0,
            provider_model=self.name,
            attempts=0,
        )

    async def aclose(self) -> None:
        """Nothing is held open."""
