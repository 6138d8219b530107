"""How many requests a server gets at once where nobody has said it: found out by how it answers."""

from __future__ import annotations

from dataclasses import dataclass

from phyblock.models.pace import Mark

__all__ = ["AdaptivePace"]

_START = 4
_LEAST_ROUND = 8
"""Fewest answers that latency is judged by, while it first grows; later twice as many."""
_TOLERANCE = 2.0
"""Latency holds up to so many times what it was at a low width."""
_KEPT = 0.7
"""What is left of the width where it is cut, as in CUBIC (RFC 9438); of long latency, less."""
_LEAST_KEPT = 0.5
_ROUNDS_HELD = 8
"""Rounds at the width that was too much before, until more is tried."""
_FOLLOWED = 0.25
"""How much of the way the reference goes to a lower latency with each round."""
_LATE_SHARE = 0.05
"""Share of requests, two at least, that may not be answered in time before the width is cut."""


@dataclass
class _Round:
    """Answers to requests that began at one width, and how many requests were too late."""

    answers: int = 0
    busy: int = 0
    late: int = 0
    total_s: float = 0.0

    @property
    def latency_s(self) -> float:
        return self.total_s / self.answers

    @property
    def is_used(self) -> bool:
        """Whether the width was used: where it was not, latency says nothing of more."""
        return 2 * self.busy >= self.answers


class AdaptivePace:
    """Looks for the width of one server, between 1 and `cap`, by rounds of answers.

    It starts low and doubles with each round while latency holds (slow start). Latency beyond the
    tolerance cuts it by as much (the gradient of Netflix's concurrency-limits), a refusal or more
    than a few late answers to 0.7 of what it was. From there it goes half of the way back with each
    round (binary increase: Xu, Harfoush and Rhee, "Binary increase congestion control", 2004),
    stays there, and after a while tries more, by steps that double.

    Where cuts for latency brought no relief, requests take longer by themselves, as harder
    questions do: what they take now becomes the reference, and it starts to double again.
    """

    def __init__(self, cap: int) -> None:
        self._cap = float(cap)
        self._exact = min(float(_START), self._cap)
        self._changes = 0
        self._cuts = 0
        self._round = _Round()
        self._reference_s: float | None = None
        # Width and latency before the first of several cuts for latency, one after the other.
        self._slow_from: tuple[float, float] | None = None
        # The most that was not too much; none while it doubles.
        self._ceiling: float | None = None
        self._rounds_left = 0
        self._step = 1.0

    @property
    def width(self) -> int:
        """How many requests may be under way at the server."""
        return int(self._exact)

    def begin(self, under_way: int) -> Mark:
        """Mark a request that begins."""
        is_busy = 2 * under_way >= self.width
        return Mark(self._exact, self._changes, self._cuts, is_busy)

    def answered(self, mark: Mark, latency_s: float) -> None:
        """Count an answer that was asked for at this width; judge by a round of them."""
        if mark.changes != self._changes:
            return
        now = self._round
        now.answers += 1
        now.busy += mark.is_busy
        now.total_s += latency_s
        if self._ceiling is None:
            needed = max(_LEAST_ROUND, self.width // 2)
        else:
            needed = max(2 * _LEAST_ROUND, self.width)
        if now.answers >= needed:
            self._round = _Round()
            self._judge(now)

    def refused(self, mark: Mark) -> bool:
        """Cut the width."""
        if mark.cuts != self._cuts:
            return False
        # It may have grown since, as where it takes a time limit to find out.
        self._cut(min(mark.width, self._exact), _KEPT)
        self._slow_from = None
        return True

    def late(self, mark: Mark) -> bool:
        """Cut the width where it is not the only one."""
        if mark.cuts != self._cuts:
            return False
        now = self._round
        now.late += 1
        is_one_of_few = now.late < 2 or now.late < _LATE_SHARE * (now.answers + now.late)
        return not is_one_of_few and self.refused(mark)

    def _judge(self, now: _Round) -> None:
        latency_s = now.latency_s
        if self._brought_no_relief(latency_s):
            self._slow_from = self._ceiling = None
            self._reference_s = latency_s
        reference_s = self._reference_s
        if reference_s is None:
            reference_s = latency_s
        elif latency_s < reference_s:
            reference_s += _FOLLOWED * (latency_s - reference_s)
        self._reference_s = reference_s
        held_s = _TOLERANCE * reference_s
        if latency_s > held_s:
            self._slow_from = self._slow_from or (self._exact, latency_s)
            self._cut(self._exact, min(_KEPT, max(_LEAST_KEPT, held_s / latency_s)))
            return
        self._slow_from = None
        if now.is_used and self._exact < self._cap:
            self._grow()

    def _brought_no_relief(self, latency_s: float) -> bool:
        """Whether latency fell by less than half as much as the width, on a scale of ratios.

        At a width of 1 there is nothing of ours that could make it long.
        """
        if self._slow_from is None:
            return False
        width, before_s = self._slow_from
        kept = self._exact / width
        if self._exact > 1.0 and kept > _LEAST_KEPT:
            return False
        self._slow_from = None
        return self._exact == 1.0 or latency_s > before_s * kept**0.5

    def _cut(self, width: float, kept: float) -> None:
        self._ceiling = max(1.0, width - 1.0)
        self._rounds_left = _ROUNDS_HELD
        self._step = 1.0
        self._cuts += 1
        self._set(width * kept)

    def _grow(self) -> None:
        if self._ceiling is None:
            self._set(2 * self._exact)
        elif self._exact < self._ceiling:
            half = (self._ceiling - self._exact) / 2
            self._set(min(self._ceiling, self._exact + max(1.0, half)))
        elif self._rounds_left:
            self._rounds_left -= 1
        else:
            self._set(self._exact + self._step)
            self._step *= 2

    def _set(self, width: float) -> None:
        self._exact = min(self._cap, max(1.0, width))
        self._changes += 1
        self._round = _Round()
