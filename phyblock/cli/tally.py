"""Running figures of each model while a run goes on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from phyblock.report import NO_VALUE
from phyblock.run.events import Summary
from phyblock.scoring.counts import Counts
from phyblock.tables.outcomes import FAILURES

__all__ = ["Tally", "failure_text"]


@dataclass
class Tally:
    """What a model's records add up to; `counts` are of the headline matcher and setting.

    `fresh` samples were written by this command, `answered` ones of these by the model. One that is
    `stopped` expects no more than is done.
    """

    expected: int
    done: int = 0
    fresh: int = 0
    answered: int = 0
    is_stopped: bool = False
    counts: Counts = field(default_factory=Counts)
    tokens: int = 0
    cost_usd: float = 0.0
    unpriced: int = 0
    retries: int = 0
    cached: int = 0
    failures: dict[str, int] = field(default_factory=dict)
    notice: str = ""

    def add(self, sample: Summary, *, fresh: bool) -> None:
        """Count one sample."""
        self.done += 1
        self.fresh += fresh
        self.answered += fresh and sample.is_answered
        outcome = sample.outcome
        if outcome in FAILURES:
            self.failures[outcome] = self.failures.get(outcome, 0) + 1
        if sample.counts is not None:
            self.counts += sample.counts
        if sample.cached is None:
            return
        self.cached += sample.cached
        self.tokens += sample.tokens
        self.unpriced += sample.paid_usd is None
        self.cost_usd += sample.paid_usd or 0.0

    @property
    def total(self) -> int:
        """Samples that this run can still come to."""
        return self.done if self.is_stopped else self.expected

    def left_s(self, elapsed_s: float) -> float | None:
        """How long what is left takes at the rate of answers so far [s]; None without any."""
        left = self.total - self.done
        if not left:
            return 0.0
        return left * elapsed_s / self.answered if self.answered else None

    @property
    def cost_text(self) -> str:
        """Dollars the run spent on this model, or that the price is not known."""
        if self.unpriced and self.unpriced == self.done:
            return "unknown"
        return f"${self.cost_usd:.2f}" + (" + unknown" if self.unpriced else "")

    @property
    def f1_text(self) -> str:
        """Running micro-F1 in percent, or a dash."""
        return NO_VALUE if self.counts.f1 is None else f"{100 * self.counts.f1:.1f}"

    @property
    def failure_text(self) -> str:
        """Failures by outcome, or a dash."""
        return failure_text(self.failures) or NO_VALUE


def failure_text(counts: Mapping[str, int]) -> str:
    """Failures by outcome in words: `2 api error, 1 truncated`."""
    return ", ".join(f"{n} {name.replace('_', ' ')}" for name, n in sorted(counts.items()))
