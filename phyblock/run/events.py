"""Events of a run, for callbacks; the run itself prints nothing."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from phyblock.models import ModelEvent
from phyblock.records.record import Record
from phyblock.scoring.counts import Counts
from phyblock.text import counted

_HEADLINE = "aov"


@dataclass(frozen=True, slots=True)
class Summary:
    """The part of a record that running figures need; `counts` are of the headline matcher and
    setting.

    `paid_usd` is None where a price is not known, `cached` None where there is no reply.
    """

    model: str
    outcome: str
    is_answered: bool
    is_final: bool
    is_judged: bool
    counts: Counts | None
    cached: bool | None
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
            record.paid_usd,
        )


@dataclass(frozen=True)
class RunStarted:
    """Samples in all, and the final records already on disk summed up, by model."""

    expected: Mapping[str, int]
    earlier: Mapping[str, Sequence[Summary]]


@dataclass(frozen=True)
class SampleDone:
    """A record was written."""

    record: Record


@dataclass(frozen=True)
class RunNotice:
    """Something that concerns no single model: a server that is gone, a cache set aside."""

    text: str


@dataclass(frozen=True)
class ModelStopped:
    """A model is asked no more: it is not available."""

    model: str
    reason: str


@dataclass(frozen=True)
class Stopping:
    """The run takes no new samples: it was interrupted, its cost limit is reached, or an error of
    our own ends it; `in_flight` calls are waited for.
    """

    cause: Literal["interrupted", "cost", "error"]
    reason: str
    in_flight: int = 0

    @property
    def text(self) -> str:
        """Message to a person who stopped it: what it waits for, and how to give that up."""
        if not self.in_flight:
            return f"Stopping: {self.reason}."
        calls = f"{counted(self.in_flight, 'call')} under way"
        return f"Stopping: {self.reason}; waiting for {calls} (Ctrl-C again to give them up)."


RunEvent = RunStarted | SampleDone | ModelEvent | RunNotice | ModelStopped | Stopping
Watcher = Callable[[RunEvent], None]
