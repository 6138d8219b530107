"""Limits, retries and cancellations: when a request is sent, how often, and when no more; the
servers of a model: the load is even, outages lose nothing.
"""

import asyncio
import heapq
import itertools
from collections import Counter
from contextlib import ExitStack
from dataclasses import dataclass, field
from unittest import mock

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock import errors
from phyblock.errors import ModelError, RetryableError, UnavailableError
from phyblock.models.cache import ReplyCache, reply_key
from phyblock.models.client import HttpClient
from phyblock.models.costs import Budget, ModelBudget
from phyblock.models.model import ChatModel, Limits, RetryPolicy, Server, Servers
from phyblock.records.record import Reply
from tests.models.factory import ROUTES, answers, ask, make_model, make_request, requests_of
from tests.servers.chassis import Faults, Running
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import in_a_loop, until

tokens = st.integers(0, 300)
calls = st.tuples(st.floats(0, 200), st.floats(0, 90), tokens, tokens)
FINAL = [
    *(kind("no") for kind in (errors.SampleError, errors.RefusedError, UnavailableError)),
    *(errors.StoreError([]), ModelError("x"), ZeroDivisionError(), asyncio.CancelledError()),
]
statuses = st.sampled_from([None, 200, 201, 204, 408, 429, 500, 502, 503])
seconds = st.floats(0, 600)
REFUSED = RetryableError("connection refused", sent="no")
steps = st.tuples(st.booleans(), st.integers(0, 50))


class FakeTime:
    """Time that stands still while anything can run, then jumps to the next that still sleeps."""

    def __init__(self):
        self.now_s = 0.0
        self._sleepers: list[tuple[float, int, asyncio.Future[None]]] = []
        self._numbers = itertools.count()

    def policy(self, **fields):
        return RetryPolicy(now=lambda: self.now_s, sleep=self.sleep, **fields)

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


def servers_of(count, policy, client=None):
    made = (Server(f"http://replica:{n}", client) for n in range(1, count + 1))
    return Servers(tuple(made), policy, lambda _: None)


def limits_of(most, overall, time=None, **fields):
    config = ROUTES["direct"].config("http://replica:1", max_concurrency=most, **fields)
    return Limits(config, overall, servers_of(1, (time or FakeTime()).policy()))


@given(st.lists(calls, max_size=40), st.integers(1, 10), st.integers(20, 500), st.integers(1, 8))
@in_a_loop
async def test_requests_and_tokens_of_a_minute_keep_to_their_limits(arrivals, rpm, tpm, width):
    """A request waits until those before it have had their time: 60 s / rpm each, and for every
    token that it took, or may still take, 60 s / tpm. All are sent, the largest as well.
    """
    starts, ends = [], []
    inside = 0
    time = FakeTime()
    limits = limits_of(width, asyncio.Semaphore(width), time, rpm=rpm, tpm=tpm)

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
    time, overall, ended_s = FakeTime(), asyncio.Semaphore(1), {}
    slow, quick = limits_of(5, overall, time, rpm=1), limits_of(5, overall, time)

    async def call(limits):
        async with limits.slot():
            await time.sleep(1)
        ended_s[limits] = time.now_s

    tasks = [asyncio.create_task(call(limits)) for limits in (slow, slow, slow, quick, quick)]
    await time.run_until_done(*tasks)
    assert ended_s[quick] < 60


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


class Script(FakeTime):
    """Raises the given errors one by one, each after `takes_s`, then answers; sleeps are jumps."""

    def __init__(self, *found, takes_s=0.0):
        super().__init__()
        self.errors, self.takes_s = list(found), takes_s
        self.sent_s, self.waits = [], []

    async def send(self):
        self.now_s += self.takes_s
        self.sent_s.append(self.now_s)
        if self.errors:
            raise self.errors.pop(0)
        return "answer"

    async def sleep(self, seconds):
        self.waits.append(seconds)
        self.now_s += seconds

    def run(self, **policy):
        async def main():
            return await self.policy(**policy).retrying("m", lambda _: None)(self.send)

        return asyncio.run(main())


@pytest.mark.parametrize("error", FINAL)
def test_nothing_but_a_retryable_error_is_sent_again(error):
    script = Script(error)
    with pytest.raises(type(error)):
        script.run()
    assert (len(script.sent_s), script.waits) == (1, [])


@given(st.lists(statuses, min_size=1, max_size=8), st.integers(1, 12), seconds, seconds)
def test_a_request_is_given_up_when_number_and_time_are_over(found, attempts, retry_for_s, takes_s):
    """Answers that were paid for and cannot be read are bounded by their number alone."""
    failures = [RetryableError("x", status=status) for status in found * 400]
    script = Script(*failures, takes_s=takes_s)
    with pytest.raises(RetryableError):
        script.run(attempts=attempts, retry_for_s=retry_for_s, base_s=2.0)
    is_over = []
    for number, (sent_s, failure) in enumerate(zip(script.sent_s, failures, strict=False), 1):
        was_paid = failure.status in (200, 201, 204)
        has_lasted = was_paid or sent_s - script.sent_s[0] >= retry_for_s
        is_over.append(number >= attempts and has_lasted)
    assert is_over.index(True) == len(is_over) - 1


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
def test_a_request_under_way_is_given_up_at_a_second_cancellation(tmp_path, route, cancels):
    server = ROUTES[route].server(Faults(latency_s=0.2))
    budget = Budget(100.0)

    async def main(url):
        config = ROUTES[route].config(url, price={"input": 1, "output": 1})
        with ReplyCache(tmp_path / "c.sqlite") as cache:
            model = make_model(config, cache=cache, budget=budget)
            asked = asyncio.create_task(model.ask(make_request()))
            await asyncio.to_thread(until, lambda: server.requests)
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
        assert (type(answer), is_kept) == (Reply, True), answer
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
        await asyncio.to_thread(until, lambda: server.requests)
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


def test_a_bug_of_ours_is_neither_sent_again_nor_charged():
    for route in ROUTES.values():
        budget = Budget(100.0)
        config = route.config("http://127.0.0.1:9", price={"input": 1, "output": 1}, seed="never")
        with (
            mock.patch.object(HttpClient, "send", side_effect=KeyError("choices")) as send,
            pytest.raises(KeyError),
        ):
            ask(make_model(config, budget=budget), make_request())
        assert (send.call_count, budget.spent_usd) == (1, 0.0)


# The servers of a model.


@dataclass
class Outage:
    """A client whose server is away from `begins_s` until `ends_s`; calls take `takes_s`."""

    begins_s: float
    ends_s: float
    takes_s: float
    time: FakeTime = field(default_factory=FakeTime)
    failed: int = 0
    answered: int = 0

    def is_away(self):
        return self.begins_s <= self.time.now_s < self.ends_s

    async def complete(self, _):
        was_away = self.is_away()
        if not was_away:
            await self.time.sleep(self.takes_s)
        if was_away or self.is_away():
            self.failed += 1
            raise RetryableError(str(REFUSED), sent="lost")
        self.answered += 1
        return Reply(text="Step1: Move block with index 1")


def ask_through(client, *, samples, width, was_heard=False):
    """Ask as a run does, `width` samples at once, a stopped model no more."""
    found = []

    async def main():
        config = ROUTES["direct"].config("http://replica:1", max_concurrency=width)
        policy, report = client.time.policy(), lambda _: None
        servers = servers_of(1, policy, client)
        servers.all[0].was_heard = was_heard
        limits = Limits(config, asyncio.Semaphore(width), servers)
        parts = {"servers": servers, "limits": limits, "budget": ModelBudget(Budget())}
        model = ChatModel(config=config, policy=policy, report=report, **parts)
        queue = requests_of(samples)

        async def work():
            while queue:
                request = queue.pop(0)
                try:
                    found.append(await model.ask(request))
                except ModelError as error:
                    found.append(error)
                    if isinstance(error, UnavailableError):
                        queue.clear()

        await client.time.run_until_done(*(asyncio.create_task(work()) for _ in range(width)))

    asyncio.run(main())
    return found


@settings(max_examples=40)
@given(st.floats(0, 30), st.floats(1, 280), st.floats(0.1, 20), st.integers(1, 12))
def test_an_outage_loses_nothing(begins_s, lasts_s, takes_s, width):
    client = Outage(begins_s, begins_s + lasts_s, takes_s)
    answers = ask_through(client, samples=40, width=width, was_heard=True)
    assert [type(answer) for answer in answers] == [Reply] * 40
    assert client.answered == 40
    # All that are under way, each twice, then single ones at growing distances.
    assert client.failed <= 2 * width + 35


@pytest.mark.parametrize("width", [2, 8, 32])
def test_a_wrong_address_stops_the_model_after_few_attempts_and_leaves_its_samples(width):
    client = Outage(0.0, float("inf"), 1.0)
    answers = ask_through(client, samples=500, width=width)
    assert {type(answer) for answer in answers} == {UnavailableError}
    assert len(answers) == width
    assert "http://replica:1 could not be reached for" in str(answers[0])
    assert str(REFUSED) in str(answers[0])
    assert client.failed <= 10 * width
    assert 18 <= client.time.now_s < 300


@settings(max_examples=20)
@given(st.floats(30, 60), st.integers(2, 12))
def test_a_server_that_has_answered_is_tried_for_as_long_as_the_policy_says(begins_s, width):
    client = Outage(begins_s, float("inf"), 5.0)
    answers = ask_through(client, samples=500, width=width)
    replies = [answer for answer in answers if isinstance(answer, Reply)]
    assert len(replies) == client.answered > 0
    assert "http://replica:1 could not be reached for 3" in str(answers[-1])
    assert begins_s + 290 <= client.time.now_s < begins_s + 420


@settings(max_examples=60)
@given(st.lists(st.booleans(), max_size=5), st.lists(steps, max_size=60))
def test_whoever_is_asked_is_there_and_has_no_more_to_do_than_others(others, events):
    servers = servers_of(1 + len(others), FakeTime().policy())
    there = [one for one, is_there in zip(servers.all, [True, *others], strict=True) if is_there]
    for server in 2 * [one for one in servers.all if one not in there]:
        servers.failed(server, REFUSED, 0.0)
    assert servers.cooling_s() == 0.0
    held = []
    for begins, number in events:
        if begins:
            least = min(one.under_way for one in there)
            held.append(servers.chosen())
            server = held[-1].__enter__()
            assert server in there
            assert server.under_way == least + 1
        elif held:
            held.pop(number % len(held)).__exit__(None, None, None)


@pytest.mark.parametrize("status", [400, 500, None, 429, 529])
def test_a_server_that_answers_or_is_late_is_never_given_up(status):
    """It rests only where it is asked too much."""
    time = FakeTime()
    servers = servers_of(1, time.policy())
    error = RetryableError("x", status=status, sent="answered" if status else "maybe")
    for _ in range(50):
        time.now_s += servers.cooling_s() + 20
        servers.failed(servers.all[0], error, time.now_s)
        assert 0.0 <= servers.cooling_s() < 1.0
        assert (servers.cooling_s() > 0) == (status in (429, 529))


@given(st.none() | st.floats(0, 1000), st.integers(0, 20))
def test_the_next_try_waits_as_long_as_the_server_asks(asked_s, tries):
    time = FakeTime()
    policy = time.policy(retry_for_s=1e9)
    servers = servers_of(1, policy)
    error = RetryableError("overloaded", status=503, retry_after_s=asked_s)
    least_s = min(asked_s or 0.0, policy.max_retry_after_s)
    for number in range(tries):
        servers.failed(servers.all[0], error, time.now_s)
        wait_s = servers.cooling_s()
        assert wait_s == pytest.approx(max(least_s, policy.base_s * number))
        if wait_s:
            # What was sent before shows nothing new.
            servers.failed(servers.all[0], error, time.now_s)
            assert servers.all[0].failures == number + 1
        time.now_s += wait_s
        assert servers.cooling_s() == 0.0
    with servers.chosen():
        assert (servers.cooling_s() > 0) == (tries > 1), "a server that is away gets one request"
    assert servers.cooling_s() == 0.0


@given(st.sampled_from([429, 529]), st.floats(0.5, 100))
def test_after_a_429_nobody_asks_before_the_server_wants(status, wait_s):
    time = FakeTime()
    servers = servers_of(2, time.policy())
    first, second = servers.all
    servers.failed(first, RetryableError("slow down", status=status, retry_after_s=wait_s), 0.0)
    assert servers.cooling_s() == 0.0
    with servers.chosen() as server:
        assert server is second
    longer = RetryableError("slow down", status=status, retry_after_s=wait_s + 20)
    servers.failed(second, longer, 0.0)
    servers.failed(second, RetryableError("slow down", status=status), 0.0)
    assert servers.cooling_s() == pytest.approx(wait_s)


@pytest.mark.parametrize("route", ["direct", pytest.param("openai", marks=pytest.mark.slow)])
def test_servers_that_die_in_the_middle_lose_nothing(route):
    servers = [OpenAIChat(Faults(latency_s=0.01), width=1) for _ in range(4)]

    async def main(running):
        config = ROUTES[route].config(*(one.url for one in running))
        model = make_model(config, policy=RetryPolicy(base_s=0.01, max_wait_s=0.05))
        asking = asyncio.create_task(answers(model, *requests_of(120)))
        await asyncio.to_thread(until, lambda: sum(server.ended["ok"] for server in servers) >= 40)
        for one in running[1:]:
            one.die()
        return await asking

    with ExitStack() as stack:
        found = asyncio.run(main([stack.enter_context(Running(server)) for server in servers]))
    assert [type(answer) for answer in found] == [Reply] * 120
    # No sample was sent again but those that were under way at a server that died.
    asked = sum((server.by_sample for server in servers), Counter())
    assert len(asked) == 120
    # What one loses may come to the next before that dies.
    assert asked.total() <= min(240, sum(answer.attempts for answer in found))


def test_a_server_that_refuses_everything_is_left_out_and_the_last_one_stops_the_model():
    events = []
    wrong, right = OpenAIChat(Faults(mode="404")), OpenAIChat()
    with Running(wrong) as first, Running(right) as second:
        config = ROUTES["direct"].config(first.url, second.url, max_concurrency=4)
        replies = ask(make_model(config, events=events), *requests_of(30))
        assert {type(reply) for reply in replies} == {Reply}
        assert right.ended == {"ok": 30}
        assert wrong.requests <= 4
        (text,) = (event.message for event in events if event.kind == "notice")
        assert text.startswith(f"{first.url} is not used any more: ")
        right.faults = Faults(mode="404")
        stopped = ask(make_model(config), *requests_of(30))
    assert {type(answer) for answer in stopped} == {UnavailableError}
    assert wrong.requests + right.ended["404"] <= 3 * 4
