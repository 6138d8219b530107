"""What happens in a run, told to whoever watches; the run itself prints nothing."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from phyblock.records import Record
from phyblock.run.standing import Summary

__all__ = [
    "ModelNotice",
    "ModelStopped",
    "RunEvent",
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
    """A model's call is repeated or its concurrency changed; `text` says so in a few words."""

    model: str
    kind: str
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


RunEvent = RunStarted | SampleDone | ModelNotice | ModelStopped | Stopping
Watcher = Callable[[RunEvent], None]
