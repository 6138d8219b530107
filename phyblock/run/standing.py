"""How far a run is: of every sample what decides whether to ask again, and what it adds up to."""

from __future__ import annotations

from dataclasses import dataclass, field

from phyblock.records.record import BatchLine, Record, Turn
from phyblock.scoring.counts import Counts

__all__ = ["Standing", "Summary"]

_HEADLINE = "aov"


@dataclass(frozen=True, slots=True)
class Summary:
    """What running figures need of a record; `counts` are of the headline matcher and setting.

    `paid_usd` is None where a price is not known, `cached` None where there is no reply.
    """

    model: str
    outcome: str
    is_answered: bool
    is_final: bool
    is_judged: bool
    counts: Counts | None
    cached: bool | None
    tokens: int
    paid_usd: float | None

    @classmethod
    def of(cls, record: Record) -> Summary:
        """Sum up a record."""
        headline = next((s for s in record.scores if s.criterion == _HEADLINE), None)
        reply = record.reply
        return cls(
            record.model,
            record.outcome,
            record.is_answered,
            record.is_final,
            record.is_judged,
            None if headline is None else Counts(headline.tp, headline.fp, headline.fn),
            None if reply is None else reply.cached,
            0 if reply is None else reply.tokens,
            record.paid_usd,
        )


@dataclass
class Standing:
    """The newest record of every sample that counts, summed up, and what the run cost so far.

    `batches` are all lines about batches, oldest first. `limit_usd` is what the cost limit counted,
    of every line, also of those that later ones replaced.
    """

    samples: dict[str, Summary] = field(default_factory=dict)
    limit_usd: float = 0.0
    batches: list[BatchLine] = field(default_factory=list)

    def add(self, record: Record) -> None:
        """Take in a record as it was read, oldest first."""
        self.samples[record.sample] = Summary.of(record)
        self.limit_usd += record.limit_usd

    def add_turn(self, turn: Turn) -> None:
        """Take in an answered turn of an episode."""
        self.limit_usd += turn.reply.limit_usd
