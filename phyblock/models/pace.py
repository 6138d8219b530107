"""How many requests are under way at once, and what changes it: here a fixed number.

Whatever its kind, a pace gives way at once where a server says that it has too much to do, and
comes back in steps (additive increase, multiplicative decrease: Chiu and Jain, "Analysis of the
increase and decrease algorithms for congestion avoidance in computer networks", 1989).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from phyblock.errors import ModelError, RetryableError

__all__ = ["FixedPace", "Mark", "Pace", "is_late", "says_too_much"]

_TOO_MUCH = (429, 529)
"""Too many requests; overloaded, as Anthropic says it."""
_RECOVERY_ROUNDS = 8
"""Rounds of successes after which a model that was slowed down to nothing is at full width."""


def says_too_much(error: ModelError) -> bool:
    """Whether a server says that it has more to do than it can."""
    return error.status in _TOO_MUCH and isinstance(error, RetryableError)


def is_late(error: ModelError) -> bool:
    """Whether an answer did not come in time."""
    return error.sent == "maybe" and isinstance(error, RetryableError)


@dataclass(frozen=True)
class Mark:
    """What was true when a request began: the width, how often it had been changed and cut, and
    whether at least half of it was in use.
    """

    width: float
    changes: int
    cuts: int
    is_busy: bool


class Pace(Protocol):
    """How many requests may be under way; told of each when it begins and when it has ended.

    Requests that were under way when the width was cut do not cut it again: they say nothing of the
    new one.
    """

    @property
    def width(self) -> int:
        """How many requests may be under way, 1 at least."""

    def begin(self, under_way: int, /) -> Mark:
        """A request begins: one of so many that are under way now."""

    def answered(self, mark: Mark, latency_s: float, /) -> None:
        """It was answered."""

    def refused(self, mark: Mark, /) -> bool:
        """The server said that it was too much; whether the width was cut."""

    def late(self, mark: Mark, /) -> bool:
        """It was not answered in time; whether the width was cut."""


class FixedPace:
    """A number that is halved by a refusal, and grows back by an eighth a round of successes.

    A late answer says nothing: some requests are slow, and the number is the user's.
    """

    def __init__(self, width: int) -> None:
        self._most = float(width)
        self._exact = float(width)
        self._cuts = 0

    @property
    def width(self) -> int:
        """How many requests may be under way."""
        return int(self._exact)

    def begin(self, _: int, /) -> Mark:
        """Mark a request that begins."""
        return Mark(self._exact, 0, self._cuts, is_busy=True)

    def answered(self, _: Mark, __: float, /) -> None:
        """Widen a little."""
        grown = self._exact + self._most / _RECOVERY_ROUNDS / self.width
        self._exact = min(self._most, grown)

    def refused(self, mark: Mark) -> bool:
        """Halve the width."""
        if mark.cuts != self._cuts:
            return False
        self._cuts += 1
        self._exact = max(1.0, self.width / 2)
        return True

    def late(self, _: Mark, /) -> bool:
        """Change nothing."""
        return False
