"""Limits on what is under way at once and on what is started in a minute; asyncio, one loop."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections import deque
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import dataclass

WINDOW_S = 60.0
_NAP_S = 1.0


@dataclass(frozen=True)
class Clock:
    """Time as limits, retries and servers see it; tests give their own."""

    now: Callable[[], float] = time.monotonic
    sleep: Callable[[float], Awaitable[None]] = asyncio.sleep


@dataclass
class Started:
    """A request that was started: when [s], and how many tokens it counts for."""

    at_s: float
    tokens: int


class Limits:
    """All limits of one model: requests under way, and requests and tokens in any 60 s.

    A request larger than `tpm` by itself is let through when nothing was started for a minute, or
    it could never start. `overall` is shared by all models of a run; `rest_s` says how long no
    server of the model is to be asked, as after a 429.
    """

    def __init__(
        self,
        most: int,
        overall: asyncio.Semaphore,
        rpm: int | None = None,
        tpm: int | None = None,
        *,
        rest_s: Callable[[], float] = lambda: 0.0,
        clock: Clock | None = None,
    ) -> None:
        self._under_way = asyncio.Semaphore(most)
        self._overall = overall
        self._rpm = rpm
        self._tpm = tpm
        self._rest_s = rest_s
        self._clock = clock or Clock()
        self._admission = asyncio.Lock()
        self._started: deque[Started] = deque()
        self._tokens = 0

    @contextlib.asynccontextmanager
    async def slot(self, tokens: int) -> AsyncIterator[Started]:
        """Hold a place of the model and of the whole run; `tokens` is the estimate for tpm.

        Requests are admitted one after the other; a model that waits for its minute holds no place
        that another could use.
        """
        async with self._under_way:
            async with self._admission:
                while (wait_s := max(self._rest_s(), self._window_s(tokens))) > 0:
                    # In naps, as a server that rests may be heard of earlier.
                    await self._clock.sleep(min(wait_s, _NAP_S))
                await self._overall.acquire()
                started = Started(self._clock.now(), tokens)
                self._started.append(started)
                self._tokens += tokens
            try:
                yield started
            finally:
                self._overall.release()

    def settle(self, started: Started, tokens: int) -> None:
        """Put the tokens that a request really took in the place of the estimate."""
        if started.at_s > self._clock.now() - WINDOW_S:
            self._tokens += tokens - started.tokens
            started.tokens = tokens

    def _window_s(self, tokens: int) -> float:
        """Return the seconds until a request of so many tokens may start."""
        now = self._clock.now()
        while self._started and self._started[0].at_s <= now - WINDOW_S:
            self._tokens -= self._started.popleft().tokens
        must_leave = 0 if self._rpm is None else max(0, len(self._started) - self._rpm + 1)
        if self._tpm is not None:
            held = self._tokens
            for count, started in enumerate(self._started):
                if held + tokens <= self._tpm:
                    break
                held -= started.tokens
                must_leave = max(must_leave, count + 1)
        return self._started[must_leave - 1].at_s + WINDOW_S - now if must_leave else 0.0
