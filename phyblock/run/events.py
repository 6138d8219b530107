"""Events of a run, for callbacks; the run itself prints nothing."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from phyblock.models import ModelEvent
from phyblock.records.record import BatchLine, Call, Record, Reply
from phyblock.scoring.counts import Counts
from phyblock.text import counted


@dataclass(frozen=True)
class RunStarted:
    """Samples in all, and the final records already on disk summed up, by model."""

    expected: Mapping[str, int]
    earlier: Mapping[str, tuple[Summary, ...]]


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
    """The run takes no new samples: interrupted, or its cost limit is reached."""

    reason: str
    in_flight: int

    @property
    def text(self) -> str:
        """Message to a person who stopped it: what it waits for, and how to give that up."""
        if not self.in_flight:
            return f"Stopping: {self.reason}."
        calls = f"{counted(self.in_flight, 'call')} under way"
        return f"Stopping: {self.reason}; waiting for {calls} (Ctrl-C again to give them up)."


RunEvent = RunStarted | SampleDone | ModelEvent | RunNotice | ModelStopped | Stopping
Watcher = Callable[[RunEvent], None]


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

    `batches` are all lines about batches, oldest first; `calls` is how many calls were made,
    `replies` are those that no final record holds, by key, and `unanswered` the calls whose end is
    not known, by number: each may have been billed.
    """

    samples: dict[str, Summary] = field(default_factory=dict)
    batches: list[BatchLine] = field(default_factory=list)
    calls: int = 0
    replies: dict[str, Reply] = field(default_factory=dict)
    unanswered: dict[int, Call] = field(default_factory=dict)
    _calls_usd: defaultdict[str, float] = field(default_factory=lambda: defaultdict(float))
    _records_usd: dict[str, float] = field(default_factory=dict)

    def add(self, record: Record) -> None:
        """Take in a record as it was read, oldest first."""
        self.samples[record.sample] = Summary.of(record)
        if record.limit_usd:
            earlier_usd = self._records_usd.get(record.sample, 0.0)
            self._records_usd[record.sample] = earlier_usd + record.limit_usd

    def add_call(self, call: Call) -> None:
        """Take in a line about a call, oldest first, when all records are."""
        self.calls = max(self.calls, call.call + 1)
        # The cost of one that went out alone is told here, that of one in a batch by its record.
        self._records_usd.pop(call.sample, None)
        if not call.ended:
            self.unanswered[call.call] = call
            return
        self.unanswered.pop(call.call, None)
        self._calls_usd[call.model] += call.billed_usd or 0.0
        sample = self.samples.get(call.sample)
        if call.reply is not None and not (sample and sample.is_final):
            self.replies[call.key] = call.reply

    @property
    def limit_usd(self) -> dict[str, float]:
        """Return the cost that a limit counts, by model [US dollars]: unknown ends in full."""
        usd = dict(self._calls_usd)
        told = [(call.model, call.most_usd or 0.0) for call in self.unanswered.values()]
        told += [(self.samples[sample].model, cost) for sample, cost in self._records_usd.items()]
        for model, cost in told:
            usd[model] = usd.get(model, 0.0) + cost
        return usd

    @property
    def unanswered_text(self) -> str:
        """Return a sentence on calls whose end is not known, or ""."""
        if not self.unanswered:
            return ""
        usd = [call.most_usd for call in self.unanswered.values()]
        known = [cost for cost in usd if cost is not None]
        most = f" (${sum(known):,.4f} at most)" if len(known) == len(usd) else ""
        return f"{counted(len(usd), 'call')} may have been billed without a reply{most}"
