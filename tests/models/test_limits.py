"""Laws of the limits, under a clock of our own."""

from __future__ import annotations

import asyncio
import heapq
import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.models.limits import WINDOW_S, Clock, Gate, MinuteWindow, ModelLimiter
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
            for _ in range(50):
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
        limiter = ModelLimiter(width, Gate(width), rpm, tpm, time.clock)

        async def call(at_s: float, tokens: int, takes_s: float) -> None:
            nonlocal inside
            await time.sleep(at_s)
            async with limiter.slot(tokens) as slot:
                starts.append((time.now_s, tokens))
                inside += 1
                assert inside <= width
                await time.sleep(takes_s)
                inside -= 1
                slot.settle(tokens)

        await time.run_until_done(*(asyncio.create_task(call(*one)) for one in arrivals))

    run(main)
    assert len(starts) == len(arrivals)
    requests, tokens = busiest_window(starts)
    assert requests <= rpm
    assert tokens <= tpm


def test_a_full_minute_is_used() -> None:
    async def main() -> list[float]:
        time = FakeTime()
        limiter = ModelLimiter(10, Gate(10), rpm=3, clock=time.clock)
        starts: list[float] = []

        async def call() -> None:
            async with limiter.slot(1):
                starts.append(time.now_s)

        await time.run_until_done(*(asyncio.create_task(call()) for _ in range(7)))
        return starts

    assert run(main) == [0, 0, 0, 60, 60, 60, 120]


def test_tokens_really_taken_replace_the_estimate() -> None:
    time = FakeTime()
    window = MinuteWindow(None, 100, lambda: time.now_s)
    started = window.start(90)
    assert window.wait_s(20) == WINDOW_S
    window.settle(started, 10)
    assert window.wait_s(20) == 0
    assert window.wait_s(91) == WINDOW_S
    time.now_s = WINDOW_S
    assert window.wait_s(91) == 0


def test_a_request_larger_than_the_limit_waits_for_an_empty_window_only() -> None:
    time = FakeTime()
    window = MinuteWindow(None, 100, lambda: time.now_s)
    assert window.wait_s(500) == 0
    window.start(1)
    assert window.wait_s(500) == WINDOW_S


def test_all_models_together_keep_to_the_overall_limit() -> None:
    async def main() -> int:
        time = FakeTime()
        overall = Gate(3)
        limiters = [ModelLimiter(5, overall, clock=time.clock) for _ in range(4)]
        most = 0

        async def call(limiter: ModelLimiter) -> None:
            nonlocal most
            async with limiter.slot(0):
                most = max(most, overall.inside)
                await time.sleep(1)

        tasks = [asyncio.create_task(call(limiter)) for limiter in limiters * 5]
        await time.run_until_done(*tasks)
        assert time.now_s == pytest.approx(7)
        return most

    assert run(main) == 3


def test_a_model_waiting_for_its_minute_holds_no_place_that_another_could_use() -> None:
    async def main() -> float:
        time = FakeTime()
        overall = Gate(1)
        slow = ModelLimiter(5, overall, rpm=1, clock=time.clock)
        quick = ModelLimiter(5, overall, clock=time.clock)
        finished_s = 0.0

        async def call(limiter: ModelLimiter) -> None:
            nonlocal finished_s
            async with limiter.slot(0):
                await time.sleep(1)
            if limiter is quick:
                finished_s = time.now_s

        tasks = [asyncio.create_task(call(limiter)) for limiter in (slow, slow, slow, quick, quick)]
        await time.run_until_done(*tasks)
        return finished_s

    assert run(main) < WINDOW_S


@settings(max_examples=100, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 5), st.booleans()), max_size=30), st.integers(1, 4))
def test_a_gate_survives_waiters_that_give_up(plans: list[tuple[int, bool]], width: int) -> None:
    """However many holders or waiters are cancelled, all places are free in the end."""

    async def main() -> None:
        gate = Gate(width)

        async def hold(steps: int) -> None:
            await gate.enter()
            try:
                assert gate.inside <= width
                for _ in range(steps):
                    await asyncio.sleep(0)
            finally:
                gate.leave()

        tasks = []
        for steps, cancel in plans:
            task = asyncio.create_task(hold(steps))
            tasks.append(task)
            await asyncio.sleep(0)
            if cancel:
                task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        assert gate.inside == 0
        for _ in range(width):
            await asyncio.wait_for(gate.enter(), 1)

    run(main)


def test_a_place_given_to_a_waiter_that_was_cancelled_meanwhile_is_not_lost() -> None:
    async def main() -> None:
        gate = Gate(1)
        await gate.enter()
        waiter = asyncio.create_task(gate.enter())
        await asyncio.sleep(0)
        gate.leave()
        waiter.cancel()
        await asyncio.gather(waiter, return_exceptions=True)
        assert waiter.cancelled()
        assert gate.inside == 0

    run(main)


def test_a_gate_needs_a_width() -> None:
    with pytest.raises(ValueError, match="width of at least 1"):
        Gate(0)
