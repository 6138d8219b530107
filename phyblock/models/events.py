"""What a model tells while it works, for a progress display."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

__all__ = ["EventKind", "ModelEvent", "Observer", "Tell", "ignore_event", "ignore_text"]

EventKind = Literal["retry", "slow_down", "seed_unsupported", "unavailable", "batch"]


@dataclass(frozen=True)
class ModelEvent:
    """Something a user may want to see.

    `retry`: a request failed, with `status` if the server gave one, and is sent again after
    `wait_s`; `slow_down`: a 429 brought the concurrency down to `limit`; `seed_unsupported`: from
    now on no seed is sent; `unavailable`: nothing more is sent; `batch`: one was sent, is waited
    for or has ended. `message` is safe to show and store.
    """

    model: str
    kind: EventKind
    message: str
    wait_s: float = 0.0
    limit: int = 0
    status: int | None = None


Observer = Callable[[ModelEvent], None]

Tell = Callable[[str], None]
"""Told in plain words what concerns no single model: a server that is gone, a cache set aside."""


def ignore_event(event: ModelEvent) -> None:
    """The observer of those who do not care."""


def ignore_text(text: str) -> None:
    """The listener of those who do not care."""
