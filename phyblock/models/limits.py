"""Limits on what is under way at once and on what is started in a minute; asyncio, one loop.

`Gate` bounds concurrency and can be narrowed and widened; `MinuteWindow` holds requests and tokens
a minute; `ModelLimiter` puts both and the gate shared by all models together. How wide the gate is
to be, `pace` says.
"""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections import deque
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import dataclass

__all__ = ["Clock", "Gate", "MinuteWindow", "ModelLimiter", "Slot", "Start"]

WINDOW_S = 60.0


@dataclass(frozen=True)
class Clock:
    """Time as the limits see it; tests give their own."""

    now: Callable[[], float] = time.monotonic
    sleep: Callable[[float], Awaitable[None]] = asyncio.sleep


class Gate:
    """At most `width` holders at once; waiters enter in the order in which they came."""

    def __init__(self, width: int) -> None:
        if width < 1:
            raise ValueError(f"a gate needs a width of at least 1, not {width}")
        self._width = width
        self._inside = 0
        self._waiting: deque[asyncio.Future[None]] = deque()

    @property
    def width(self) -> int:
        """How many may hold the gate at once."""
        return self._width

    @width.setter
    def width(self, width: int) -> None:
        self._width = max(1, width)
        self._let_in()

    @property
    def inside(self) -> int:
        """How many hold it now; above `width` for a while after it was narrowed."""
        return self._inside

    async def enter(self) -> None:
        """Wait for a place and take it."""
        if self._inside < self._width and not self._waiting:
            self._inside += 1
            return
        place = asyncio.get_running_loop().create_future()
        self._waiting.append(place)
        try:
            await place
        except asyncio.CancelledError:
            if place.done() and not place.cancelled():
                self.leave()
            raise

    def leave(self) -> None:
        """Give the place back."""
        self._inside -= 1
        self._let_in()

    def _let_in(self) -> None:
        while self._waiting and self._inside < self._width:
            place = self._waiting.popleft()
            if not place.done():
                self._inside += 1
                place.set_result(None)


@dataclass
class Start:
    """A request that was started: when [s], and how many tokens it counts for."""

    at_s: float
    tokens: int


class MinuteWindow:
    """Requests and tokens in any window of 60 s, exactly: the starts of the last 60 s are kept.

    A request larger than `tpm` by itself is let through when the window is empty, or it could
    never start.
    """

    def __init__(self, rpm: int | None, tpm: int | None, now: Callable[[], float]) -> None:
        self._rpm = rpm
        self._tpm = tpm
        self._now = now
        self._starts: deque[Start] = deque()
        self._tokens = 0

    def wait_s(self, tokens: int) -> float:
        """Seconds until a request of so many tokens may start; 0 when it may now."""
        now = self._now()
        self._forget(now)
        index = max(self._first_to_leave_for_rpm(), self._first_to_leave_for_tpm(tokens))
        return self._starts[index - 1].at_s + WINDOW_S - now if index else 0.0

    def start(self, tokens: int) -> Start:
        """Count a request that starts now."""
        started = Start(self._now(), tokens)
        self._starts.append(started)
        self._tokens += tokens
        return started

    def settle(self, started: Start, tokens: int) -> None:
        """Put the tokens that a request really took in the place of the estimate."""
        if started.at_s > self._now() - WINDOW_S:
            self._tokens += tokens - started.tokens
            started.tokens = tokens

    def _forget(self, now: float) -> None:
        while self._starts and self._starts[0].at_s <= now - WINDOW_S:
            self._tokens -= self._starts.popleft().tokens

    def _first_to_leave_for_rpm(self) -> int:
        """How many of the oldest starts must leave the window before one more fits."""
        return 0 if self._rpm is None else max(0, len(self._starts) - self._rpm + 1)

    def _first_to_leave_for_tpm(self, tokens: int) -> int:
        if self._tpm is None:
            return 0
        held, count = self._tokens, 0
        for started in self._starts:
            if held + tokens <= self._tpm:
                break
            held -= started.tokens
            count += 1
        return count


class ModelLimiter:
    """All limits of one model; `width` may be changed at any time."""

    def __init__(
        self,
        width: int,
        overall: Gate,
        rpm: int | None = None,
        tpm: int | None = None,
        clock: Clock | None = None,
    ) -> None:
        self._clock = clock or Clock()
        self._gate = Gate(width)
        self._overall = overall
        self._window = MinuteWindow(rpm, tpm, self._clock.now)
        self._admission = asyncio.Lock()

    @property
    def width(self) -> int:
        """How many requests to the model may be under way now."""
        return self._gate.width

    @width.setter
    def width(self, width: int) -> None:
        self._gate.width = width

    @contextlib.asynccontextmanager
    async def slot(self, tokens: int) -> AsyncIterator[Slot]:
        """Hold a place of the model and of the whole run; `tokens` is the estimate for tpm."""
        await self._gate.enter()
        try:
            started = await self._admit(tokens)
            try:
                yield Slot(self._window, started)
            finally:
                self._overall.leave()
        finally:
            self._gate.leave()

    async def _admit(self, tokens: int) -> Start:
        """Wait for the minute's limits, then for a place in the run, and start.

        Under a lock, so that nothing fills the window between the wait and the start, and so that
        a model waiting for its minute holds no place that another could use.
        """
        async with self._admission:
            while (wait_s := self._window.wait_s(tokens)) > 0:
                await self._clock.sleep(wait_s)
            await self._overall.enter()
            return self._window.start(tokens)


@dataclass(frozen=True)
class Slot:
    """A place held for one request."""

    window: MinuteWindow
    started: Start

    def settle(self, tokens: int | None) -> None:
        """The request was answered, taking so many tokens (None: the provider did not say)."""
        if tokens is not None:
            self.window.settle(self.started, tokens)
