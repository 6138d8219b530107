"""Limits, retries and cancellations: when a request is sent, how often, and when no more."""

import asyncio
import heapq
import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.config.models import ModelConfig
from phyblock.errors import (
    ModelError,
    RefusedError,
    RetryableError,
    SampleError,
    StoreError,
    UnavailableError,
)
from phyblock.models.cache import ReplyCache, reply_key
from phyblock.models.client import HttpClient
from phyblock.models.costs import Budget
from phyblock.models.model import Clock, Limits, RetryPolicy, Server, Servers
from phyblock.records.record import Reply
from tests.models.factory import ROUTES, ask, make_model, make_request
from tests.servers.chassis import Faults, Running
from tests.workspace import in_a_loop


class FakeTime:
    """Time that stands still while anything can run, then jumps to the next that still sleeps."""

    def __init__(self):
        self.now_s = 0.0
        self._sleepers: list[tuple[float, int, asyncio.Future[None]]] = []
        self._numbers = itertools.count()

    @property
    def clock(self):
        return Clock(lambda: self.now_s, self.sleep)

    async def sleep(self, seconds):
        wake = asyncio.get_running_loop().create_future()
        heapq.heappush(self._sleepers, (self.now_s + seconds, next(self._numbers), wake))
        await wake

    async def run_until_done(self, *tasks):
        ready = asyncio.get_running_loop()._ready
        while not all(task.done() for task in tasks):
            await asyncio.sleep(0)
            while ready:
                await asyncio.sleep(0)
            while self._sleepers:
                wakes_s, _, wake = heapq.heappop(self._sleepers)
                if not wake.done():
                    self.now_s = wakes_s
                    wake.set_result(None)
                    break
        for task in tasks:
            task.result()


def limits_of(most, overall, clock=None, **fields):
    """The limits of a model at one server."""
    config = ModelConfig(name="m", id="openai/m", max_concurrency=most, **fields)
    policy = RetryPolicy(clock=clock or Clock())
    return Limits(config, overall, Servers((Server("http://one:1", None),), policy, print))


calls = st.lists(
    st.tuples(st.floats(0, 200), st.floats(0, 90), st.integers(0, 300), st.integers(0, 300)),
    max_size=40,
)


@given(calls, st.integers(1, 10), st.integers(20, 500), st.integers(1, 8))
@in_a_loop
async def test_requests_and_tokens_of_a_minute_keep_to_their_limits(arrivals, rpm, tpm, width):
    """A request waits until those before it have had their time: 60 s / rpm each, and for every
    token that it took, or may still take, 60 s / tpm. All are sent, the largest as well.
    """
    starts, ends = [], []
    inside = 0
    time = FakeTime()
    limits = limits_of(width, asyncio.Semaphore(width), time.clock, rpm=rpm, tpm=tpm)

    async def call(at_s, takes_s, most, unused):
        nonlocal inside
        await time.sleep(at_s)
        async with limits.slot(most):
            starts.append((time.now_s, most))
            inside += 1
            assert inside <= width
            await time.sleep(takes_s)
            inside -= 1
            limits.release(min(most, unused))
            ends.append((time.now_s, min(most, unused)))

    await time.run_until_done(*(asyncio.create_task(call(*one)) for one in arrivals))
    assert len(starts) == len(arrivals)
    for first, (from_s, _) in enumerate(starts):
        for last, (to_s, _) in enumerate(starts[first:], first):
            lasted_s = to_s - from_s + 1e-6  # but for rounding
            assert (last - first) * 60 <= lasted_s * rpm
            unused = sum(tokens for end_s, tokens in ends if from_s <= end_s <= to_s)
            taken = sum(tokens for _, tokens in starts[first:last]) - unused
            assert taken * 60 <= lasted_s * tpm


@in_a_loop
async def test_a_model_waiting_for_its_minute_holds_no_place_that_another_could_use():
    time = FakeTime()
    overall = asyncio.Semaphore(1)
    slow = limits_of(5, overall, time.clock, rpm=1)
    quick = limits_of(5, overall, time.clock)
    finished_s = 0.0

    async def call(limits):
        nonlocal finished_s
        async with limits.slot():
            await time.sleep(1)
        if limits is quick:
            finished_s = time.now_s

    tasks = [asyncio.create_task(call(limits)) for limits in (slow, slow, slow, quick, quick)]
    await time.run_until_done(*tasks)
    assert finished_s < 60


@given(st.lists(st.tuples(st.integers(0, 5), st.booleans()), max_size=30), st.integers(1, 4))
@in_a_loop
async def test_limits_survive_those_that_give_up(plans, width):
    """However many hold or wait and are cancelled, all places are free in the end."""
    overall = asyncio.Semaphore(width)
    limits = limits_of(width + 1, overall)
    inside = 0

    async def hold(steps):
        nonlocal inside
        async with limits.slot():
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


class Script:
    """Raises the given errors one by one, each after `takes_s`, then answers; sleeps are jumps."""

    def __init__(self, *errors, takes_s=0.0):
        self.errors = list(errors)
        self.takes_s = takes_s
        self.now_s = 0.0
        self.failed_at: list[float] = []
        self.calls = 0
        self.waits: list[float] = []

    async def send(self):
        self.calls += 1
        self.now_s += self.takes_s
        if self.errors:
            self.failed_at.append(self.now_s)
            raise self.errors.pop(0)
        return "answer"

    async def sleep(self, seconds):
        self.waits.append(seconds)
        self.now_s += seconds

    def run(self, **policy):
        rules = RetryPolicy(clock=Clock(lambda: self.now_s, self.sleep), **policy)

        async def main():
            return await rules.retrying("m", lambda _: None)(self.send)

        return asyncio.run(main())


FINAL = [SampleError("bad"), RefusedError("no"), UnavailableError("gone"), StoreError([])]
FINAL += [ModelError("x"), ZeroDivisionError(), asyncio.CancelledError()]


@pytest.mark.parametrize("error", FINAL)
def test_nothing_but_a_retryable_error_is_sent_again(error):
    script = Script(error)
    with pytest.raises(type(error)):
        script.run()
    assert script.calls == 1
    assert script.waits == []


statuses = st.sampled_from([None, 408, 429, 500, 502, 503])


@given(
    st.lists(statuses, min_size=1, max_size=8),
    st.integers(1, 12),
    st.floats(0, 600),
    st.floats(0, 400),
)
def test_a_request_is_given_up_when_both_number_and_time_are_over(
    found, attempts, retry_for_s, takes_s
):
    errors = (RetryableError("x", status=status) for status in found * 400)
    script = Script(*errors, takes_s=takes_s)
    with pytest.raises(RetryableError):
        script.run(attempts=attempts, retry_for_s=retry_for_s, base_s=2.0)
    lasted = [now_s - script.failed_at[0] for now_s in script.failed_at]
    is_over = [n >= attempts and s >= retry_for_s for n, s in enumerate(lasted, 1)]
    assert is_over[-1]
    assert not any(is_over[:-1])


@pytest.mark.parametrize("status", [200, 201, 204])
def test_answers_that_were_paid_for_and_cannot_be_read_are_bounded_by_number_alone(status):
    script = Script(*(RetryableError("malformed", status=status) for _ in range(20)))
    with pytest.raises(RetryableError, match="malformed"):
        script.run(attempts=3)
    assert script.calls == 3


@given(st.lists(st.none() | st.floats(0, 500), min_size=1, max_size=7))
def test_waits_keep_to_retry_after_and_to_their_bounds(wishes):
    script = Script(*(RetryableError("429", status=429, retry_after_s=wish) for wish in wishes))
    assert script.run() == "answer"
    assert len(script.waits) == len(wishes)
    for number, (wish, wait) in enumerate(zip(wishes, script.waits, strict=True)):
        floor = min(wish or 0.0, 120.0)
        assert floor <= wait <= floor + min(60.0, 0.5 * 2**number)


@pytest.mark.parametrize("route", ["direct", "openai"])
@pytest.mark.parametrize("cancels", [1, 2])
def test_a_request_under_way_is_answered_and_a_second_cancellation_gives_it_up(
    tmp_path, route, cancels
):
    server = ROUTES[route].server(Faults(latency_s=0.2))
    budget = Budget(100.0)

    async def main(url):
        config = ROUTES[route].config(url, price={"input": 1, "output": 1})
        with ReplyCache(tmp_path / "c.sqlite") as cache:
            model = make_model(config, cache=cache, budget=budget)
            asked = asyncio.create_task(model.ask(make_request()))
            while not server.requests:
                await asyncio.sleep(0.001)
            for _ in range(cancels):
                asked.cancel()
                await asyncio.sleep(0.01)
            (answer,) = await asyncio.gather(asked, return_exceptions=True)
            await model.aclose()
            return answer, cache.get(reply_key(config, make_request())) is not None

    with Running(server) as running:
        answer, is_kept = asyncio.run(main(running.url))
    assert server.requests == 1
    if cancels == 1:
        assert isinstance(answer, Reply), answer
        assert is_kept
        assert budget.spent_usd == answer.billed_usd == answer.cost_usd
    else:
        assert isinstance(answer, asyncio.CancelledError)
        assert budget.spent_usd > 0, "it may be billed"
    assert budget.holds == 0


@pytest.mark.parametrize("where", ["slot", "minute", "tokens", "budget", "retry", "rest"])
def test_whatever_is_waited_for_a_cancellation_ends_the_wait_and_nothing_is_sent(where):
    mode = {"retry": "429", "rest": "429"}.get(where, "slow")
    server = ROUTES["direct"].server(Faults(mode=mode, retry_after="100"))
    limits = {"slot": {"max_concurrency": 1}, "minute": {"rpm": 1}, "tokens": {"tpm": 1}}

    async def main(url):
        price = {"input": 0, "output": 1e6}
        config = ROUTES["direct"].config(url, price=price, seed="never", **limits.get(where, {}))
        budget = Budget(200.0) if where == "budget" else None
        model = make_model(config, budget=budget, policy=RetryPolicy())
        asked = [asyncio.create_task(model.ask(make_request("000")))]
        while not (server.requests if where != "retry" else server.ended["429"]):
            await asyncio.sleep(0.001)
        await asyncio.sleep(0.05)
        if where != "retry":
            asked.append(asyncio.create_task(model.ask(make_request("001"))))
            await asyncio.sleep(0.05)
        asked[-1].cancel()
        (answer,) = await asyncio.gather(asked[-1], return_exceptions=True)
        for _ in range(2):
            asked[0].cancel()
            await asyncio.sleep(0.01)
        await asyncio.gather(*asked, return_exceptions=True)
        await model.aclose()
        return answer

    with Running(server) as running:
        answer = asyncio.run(main(running.url))
    assert isinstance(answer, asyncio.CancelledError), answer
    assert server.requests == 1


def test_a_bug_of_ours_is_neither_sent_again_nor_charged(monkeypatch):
    calls = 0

    async def broken(*_, **__):
        nonlocal calls
        calls += 1
        raise KeyError("choices")

    monkeypatch.setattr(HttpClient, "send", broken)
    for route in ROUTES.values():
        calls, budget = 0, Budget(100.0)
        config = route.config("http://127.0.0.1:9", price={"input": 1, "output": 1}, seed="never")
        with pytest.raises(KeyError):
            ask(make_model(config, budget=budget), make_request())
        assert (calls, budget.spent_usd) == (1, 0.0)
