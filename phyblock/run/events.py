"""What happens in a run, told to whoever watches; the run itself prints nothing."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from phyblock.records.record import Record
from phyblock.run.standing import Summary
from phyblock.text import counted

__all__ = [
    "ModelNotice",
    "ModelStopped",
    "RunEvent",
    "RunNotice",
    "RunStarted",
    "SampleDone",
    "Stopping",
    "Watcher",
]


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
class ModelNotice:
    """A model's call is repeated after `wait_s`, or something else a user may want to see; `text`
    says why in a few words, `status` is what the server answered, if it did.
    """

    model: str
    kind: str
    text: str
    wait_s: float = 0.0
    status: int | None = None


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
        """What a person who stopped it is told: what it waits for, and how to give that up."""
        if not self.in_flight:
            return f"Stopping: {self.reason}."
        calls = f"{counted(self.in_flight, 'call')} under way"
        return f"Stopping: {self.reason}; waiting for {calls} (Ctrl-C again to give them up)."


RunEvent = RunStarted | SampleDone | ModelNotice | RunNotice | ModelStopped | Stopping
Watcher = Callable[[RunEvent], None]
