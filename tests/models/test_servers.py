"""The servers of a model: the load is even, outages lose nothing."""

import asyncio
from collections import Counter
from contextlib import ExitStack
from dataclasses import dataclass, field

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.errors import ModelError, RetryableError, UnavailableError
from phyblock.models.costs import Budget, ModelBudget
from phyblock.models.model import (
    MOST_CONNECTION_FAILURES,
    ChatModel,
    Limits,
    RetryPolicy,
    Server,
    Servers,
)
from phyblock.records.record import Reply
from tests.models.factory import ROUTES, answers, ask, make_model, make_request, with_fields
from tests.models.test_limits import FakeTime
from tests.servers.chassis import Faults, Running
from tests.servers.openai_chat import OpenAIChat

REFUSED = RetryableError("connection refused", sent="no")


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

    async def aclose(self):
        pass


def ask_through(client, *, samples, width, was_heard=False):
    """Ask as a run does, `width` samples at once, a stopped model no more."""
    found = []

    async def main():
        policy = RetryPolicy(clock=client.time.clock)
        server = Server("http://gone:1", client, was_heard=was_heard)
        servers = Servers((server,), policy, lambda _: None)
        config = ROUTES["direct"].config("http://gone:1", max_concurrency=width)
        limits = Limits(config, asyncio.Semaphore(width), servers)
        parts = {"servers": servers, "limits": limits, "budget": ModelBudget(Budget())}
        model = ChatModel(config=config, policy=policy, report=lambda _: None, **parts)
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
    assert "http://gone:1 could not be reached for" in str(answers[0])
    assert str(REFUSED) in str(answers[0])
    assert client.failed <= width * MOST_CONNECTION_FAILURES
    assert 18 <= client.time.now_s < 300


@settings(max_examples=20)
@given(st.floats(30, 60), st.integers(2, 12))
def test_a_server_that_has_answered_is_tried_for_as_long_as_the_policy_says(begins_s, width):
    client = Outage(begins_s, float("inf"), 5.0)
    answers = ask_through(client, samples=500, width=width)
    replies = [answer for answer in answers if isinstance(answer, Reply)]
    assert len(replies) == client.answered > 0
    assert "http://gone:1 could not be reached for 3" in str(answers[-1])
    assert begins_s + 290 <= client.time.now_s < begins_s + 420


def servers_of(count, policy=None):
    made = tuple(Server(f"http://replica:{n}", None) for n in range(count))
    return Servers(made, policy or RetryPolicy(), lambda _: None)


@settings(max_examples=60)
@given(
    st.integers(1, 6),
    st.lists(st.tuples(st.booleans(), st.integers(0, 50)), max_size=60),
    st.data(),
)
def test_whoever_is_asked_is_there_and_has_no_more_to_do_than_any_other_that_is(
    count, events, data
):
    servers = servers_of(count, RetryPolicy(clock=FakeTime().clock))
    gone = data.draw(st.sets(st.integers(0, count - 1), max_size=count - 1))
    for number in (*gone, *gone):
        servers.failed(servers.all[number], REFUSED, servers.policy.clock.now())
    there = [server for number, server in enumerate(servers.all) if number not in gone]
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
    servers = servers_of(1, RetryPolicy(clock=time.clock))
    error = RetryableError("x", status=status, sent="answered" if status else "maybe")
    for _ in range(50):
        time.now_s += servers.cooling_s() + 20
        servers.failed(servers.all[0], error, time.now_s)
        assert 0.0 <= servers.cooling_s() < 1.0
        assert (servers.cooling_s() > 0) == (status in (429, 529))


@given(st.none() | st.floats(0, 1000), st.integers(0, 20))
def test_the_next_try_waits_as_long_as_the_server_asks(asked_s, tries):
    time = FakeTime()
    policy = RetryPolicy(clock=time.clock, retry_for_s=1e9)
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
    servers = servers_of(2, RetryPolicy(clock=time.clock))
    first, second = servers.all
    servers.failed(first, RetryableError("slow down", status=status, retry_after_s=wait_s), 0.0)
    assert servers.cooling_s() == 0.0
    with servers.chosen() as server:
        assert server is second
    longer = RetryableError("slow down", status=status, retry_after_s=wait_s + 20)
    servers.failed(second, longer, 0.0)
    servers.failed(second, RetryableError("slow down", status=status), 0.0)
    assert servers.cooling_s() == pytest.approx(wait_s)


def at(*urls, route="direct", **fields):
    """The model of a route at all these addresses."""
    config = ROUTES[route].config(urls[0], **fields)
    return with_fields(config, api_base=tuple(url + ROUTES[route].path for url in urls))


def requests_of(count):
    return [make_request(f"{n:03}") for n in range(count)]


@pytest.mark.parametrize("route", ["direct", pytest.param("openai", marks=pytest.mark.slow)])
def test_servers_that_die_in_the_middle_lose_nothing(route):
    servers = [OpenAIChat(Faults(latency_s=0.01), width=1) for _ in range(4)]

    async def main(running):
        config = at(*(one.url for one in running), route=route)
        model = make_model(config, policy=RetryPolicy(base_s=0.01, max_wait_s=0.05))
        asking = asyncio.create_task(answers(model, *requests_of(120)))
        while sum(server.ended["ok"] for server in servers) < 40:
            await asyncio.sleep(0.005)
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
    assert sum(asked.values()) - 120 <= 120
    assert sum(asked.values()) <= sum(answer.attempts for answer in found)


def test_a_server_that_refuses_everything_is_left_out_and_the_last_one_stops_the_model():
    events = []
    wrong, right = OpenAIChat(Faults(mode="404")), OpenAIChat()
    with Running(wrong) as first, Running(right) as second:
        config = at(first.url, second.url, max_concurrency=4)
        replies = ask(make_model(config, events=events), *requests_of(30))
        assert [type(reply) for reply in replies] == [Reply] * 30
        assert right.ended == {"ok": 30}
        assert wrong.requests <= 4
        (text,) = (event.message for event in events if event.kind == "notice")
        assert text.startswith(f"{first.url} is not used any more: ")
        right.faults = Faults(mode="404")
        stopped = ask(make_model(config), *requests_of(30))
    assert {type(answer) for answer in stopped} == {UnavailableError}
    assert wrong.requests + right.ended["404"] <= 3 * 4
