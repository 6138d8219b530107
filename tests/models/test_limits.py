"""Laws of the limits, under a clock of our own."""

from __future__ import annotations

import asyncio
import heapq
import itertools

from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.models.limits import WINDOW_S, Clock, Limits
from tests.models.factory import run


class FakeTime:
    """Time that stands still while anything can run, then jumps to the next that still sleeps."""

    def __init__(self) -> None:
        self.now_s = 0.0
        self._sleepers: list[tuple[float, int, asyncio.Future[None]]] = []
        self._numbers = itertools.count()

    @property
    def clock(self) -> Clock:
        return Clock(lambda: self.now_s, self.sleep)

    async def sleep(self, seconds: float) -> None:
        wake: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        heapq.heappush(self._sleepers, (self.now_s + seconds, next(self._numbers), wake))
        await wake

    async def run_until_done(self, *tasks: asyncio.Task[None]) -> None:
        while not all(task.done() for task in tasks):
            for _ in range(30):
                await asyncio.sleep(0)
            while self._sleepers:
                wakes_s, _, wake = heapq.heappop(self._sleepers)
                if not wake.done():
                    self.now_s = wakes_s
                    wake.set_result(None)
                    break
        for task in tasks:
            task.result()


def busiest_window(starts: list[tuple[float, int]]) -> tuple[int, int]:
    """Most requests, and most tokens, in any half-open window of a minute."""
    windows = [[n for t, n in starts if start <= t < start + WINDOW_S] for start, _ in starts]
    return max(map(len, windows), default=0), max(map(sum, windows), default=0)


calls = st.lists(
    st.tuples(
        st.floats(0, 200, allow_nan=False), st.integers(1, 100), st.floats(0, 90, allow_nan=False)
    ),
    max_size=40,
)


@settings(max_examples=100, deadline=None)
@given(calls, st.integers(1, 10), st.integers(100, 500), st.integers(1, 8))
def test_no_window_of_a_minute_has_more_starts_or_tokens_than_allowed(
    arrivals: list[tuple[float, int, float]], rpm: int, tpm: int, width: int
) -> None:
    starts: list[tuple[float, int]] = []
    inside = 0

    async def main() -> None:
        time = FakeTime()
        limits = Limits(width, asyncio.Semaphore(width), rpm, tpm, clock=time.clock)

        async def call(at_s: float, tokens: int, takes_s: float) -> None:
            nonlocal inside
            await time.sleep(at_s)
            async with limits.slot(tokens) as started:
                starts.append((time.now_s, tokens))
                inside += 1
                assert inside <= width
                await time.sleep(takes_s)
                inside -= 1
                limits.settle(started, tokens)

        await time.run_until_done(*(asyncio.create_task(call(*one)) for one in arrivals))

    run(main)
    assert len(starts) == len(arrivals)
    requests, tokens = busiest_window(starts)
    assert requests <= rpm
    assert tokens <= tpm


def starts_of(tpm: int, *calls: tuple[int, int]) -> list[float]:
    """When calls start that were estimated at the first number of tokens and took the second."""

    async def main() -> list[float]:
        time = FakeTime()
        limits = Limits(9, asyncio.Semaphore(9), tpm=tpm, clock=time.clock)
        starts: list[float] = []

        async def call(expected: int, taken: int) -> None:
            async with limits.slot(expected) as started:
                starts.append(time.now_s)
                limits.settle(started, taken)

        for expected, taken in calls:
            await time.run_until_done(asyncio.create_task(call(expected, taken)))
        return starts

    return run(main)


def test_tokens_really_taken_replace_the_estimate() -> None:
    assert starts_of(100, (90, 10), (20, 20), (80, 80)) == [0, 0, WINDOW_S]
    assert starts_of(100, (10, 90), (20, 20)) == [0, WINDOW_S]


def test_a_request_larger_than_the_limit_waits_for_an_empty_window_only() -> None:
    assert starts_of(100, (500, 500), (1, 1), (500, 500)) == [0, WINDOW_S, 2 * WINDOW_S]


def test_a_model_waiting_for_its_minute_holds_no_place_that_another_could_use() -> None:
    async def main() -> float:
        time = FakeTime()
        overall = asyncio.Semaphore(1)
        slow = Limits(5, overall, rpm=1, clock=time.clock)
        quick = Limits(5, overall, clock=time.clock)
        finished_s = 0.0

        async def call(limits: Limits) -> None:
            nonlocal finished_s
            async with limits.slot(0):
                await time.sleep(1)
            if limits is quick:
                finished_s = time.now_s

        tasks = [asyncio.create_task(call(limits)) for limits in (slow, slow, slow, quick, quick)]
        await time.run_until_done(*tasks)
        return finished_s

    assert run(main) < WINDOW_S


@settings(max_examples=100, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 5), st.booleans()), max_size=30), st.integers(1, 4))
def test_limits_survive_those_that_give_up(plans: list[tuple[int, bool]], width: int) -> None:
    """However many hold or wait and are cancelled, all places are free in the end."""

    async def main() -> None:
        overall = asyncio.Semaphore(width)
        limits = Limits(width + 1, overall)
        inside = 0

        async def hold(steps: int) -> None:
            nonlocal inside
            async with limits.slot(0):
                inside += 1
                assert inside <= width
                try:
                    for _ in range(steps):
                        await asyncio.sleep(0)
                finally:
                    inside -= 1

        tasks = []
        for steps, cancel in plans:
            task = asyncio.create_task(hold(steps))
            tasks.append(task)
            await asyncio.sleep(0)
            if cancel:
                task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        for _ in range(width):
            await asyncio.wait_for(overall.acquire(), 1)

    run(main)
