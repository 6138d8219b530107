"""Several servers of one model: the load is even, the dead are left out, nothing is lost."""

from __future__ import annotations

import asyncio
import time
from collections import Counter
from contextlib import ExitStack

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.config.models import ModelConfig
from phyblock.errors import RetryableError, UnavailableError, UnreachableError
from phyblock.models import Breakers, Model, Reply, RetryPolicy
from phyblock.models.breaker import FAILURES_TO_OPEN
from phyblock.models.limits import Clock
from phyblock.models.replicas import Replica, Replicas
from phyblock.models.transport import Call
from tests.models.factory import QUICK, ask, make_model, make_request, run, with_fields
from tests.models.routes import KEY_VARIABLE, ROUTES
from tests.servers.chassis import Faults, Running, kill, start
from tests.servers.openai_chat import OpenAIChat

REFUSED = UnreachableError("connection refused")


@pytest.fixture(autouse=True)
def _key(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(KEY_VARIABLE, "sk-not-a-real-key-1234")


class Silent:
    """A transport that is never asked."""

    async def send(self, _: Call) -> Reply:
        raise AssertionError

    async def aclose(self) -> None:
        pass


def at(*urls: str, route: str = "direct", **fields: object) -> ModelConfig:
    """The model of a route at all these addresses."""
    config = ROUTES[route].config(urls[0], **fields)
    path = ROUTES[route].path
    bases = tuple(url + path for url in urls)
    return with_fields(config, api_base=bases)


async def answers_of(model: Model, *names: str) -> list[object]:
    asked = (model.ask(make_request(name)) for name in names)
    return list(await asyncio.gather(*asked, return_exceptions=True))


def names(count: int) -> list[str]:
    return [f"{n:03}" for n in range(count)]


@settings(max_examples=60, deadline=None)
@given(
    st.integers(1, 6),
    st.lists(st.tuples(st.booleans(), st.integers(0, 50)), max_size=60),
    st.data(),
)
def test_whoever_is_asked_is_there_and_has_no_more_to_do_than_any_other_that_is(
    count: int, events: list[tuple[bool, int]], data: st.DataObject
) -> None:
    config = at(*(f"http://replica:{port}" for port in range(1, count + 1)))
    breakers = Breakers(RetryPolicy())
    replicas = Replicas(config, lambda _: Silent(), breakers)
    gone = data.draw(st.sets(st.integers(1, count)))
    for port in gone:
        for number in range(FAILURES_TO_OPEN):
            breakers.of(config.at(f"http://replica:{port}/v1")).failed(
                REFUSED, number, is_probe=False
            )
    holds: list[tuple[Replica, ExitStack]] = []
    under_way: Counter[str] = Counter()
    there = {f"http://replica:{port}" for port in range(1, count + 1) if port not in gone}
    for begins, number in events:
        if begins:
            replica = replicas.choose()
            assert (replica is None) == (not there)
            if replica is None:
                continue
            server = replica.breaker.server
            assert server in there
            assert under_way[server] == min(under_way[one] for one in there)
            under_way[server] += 1
            hold = ExitStack()
            hold.enter_context(replica.asked())
            holds.append((replica, hold))
        elif holds:
            replica, hold = holds.pop(number % len(holds))
            under_way[replica.breaker.server] -= 1
            hold.close()


def test_what_failed_at_one_server_is_sent_to_another() -> None:
    config = at("http://a:1", "http://b:1")
    replicas = Replicas(config, lambda _: Silent(), Breakers(RetryPolicy()))
    first = replicas.choose()
    second = replicas.choose(failed=first)
    assert first is not None
    assert second is not first
    with first.asked(), first.asked():
        assert replicas.choose(failed=second) is first
    alone = Replicas(at("http://a:1"), lambda _: Silent(), Breakers(RetryPolicy()))
    assert alone.choose(failed=alone.choose()) is not None


def test_four_servers_of_one_request_at_a_time_share_the_work() -> None:
    servers = [OpenAIChat(Faults(latency_s=0.02), width=1) for _ in range(4)]
    with ExitStack() as stack:
        urls = [stack.enter_context(Running(server)).url for server in servers]
        replies = ask(make_model(at(*urls, max_concurrency=8)), *map(make_request, names(80)))
    assert [type(reply) for reply in replies] == [Reply] * 80
    assert [server.most_at_once for server in servers] == [1] * 4
    assert sum(server.requests for server in servers) == 80
    assert all(15 <= server.requests <= 25 for server in servers), [s.requests for s in servers]


@pytest.mark.parametrize("route", ["direct", pytest.param("openai", marks=pytest.mark.slow)])
def test_servers_that_die_in_the_middle_lose_nothing(route: str) -> None:
    servers = [OpenAIChat(Faults(latency_s=0.01), width=1) for _ in range(4)]
    said: list[str] = []

    async def main() -> list[object]:
        started = [await start(server, 0) for server in servers]
        config = at(*(f"http://127.0.0.1:{port}" for _, port in started), route=route)
        policy = RetryPolicy(base_s=0.01, max_wait_s=0.05)
        model = make_model(config, policy=policy, breakers=Breakers(policy, said.append))
        asking = asyncio.create_task(answers_of(model, *names(120)))
        while sum(server.ended["ok"] for server in servers) < 40:
            await asyncio.sleep(0.005)
        await kill(*(runner for runner, _ in started[1:]))
        answers = await asking
        await model.aclose()
        await started[0][0].cleanup()
        return answers

    answers = run(main)
    assert [type(answer) for answer in answers] == [Reply] * 120
    # No sample was sent again but those that were under way at a server that died.
    asked: Counter[str] = sum((server.by_sample for server in servers), Counter())
    assert len(asked) == 120
    # What one loses may come to the next before that dies: 32 / 4 + 32 / 3 + 32 / 2.
    assert sum(asked.values()) - 120 <= 35
    assert sum(asked.values()) <= sum(a.attempts for a in answers if isinstance(a, Reply))
    gone = {text.partition(" cannot")[0] for text in said if "cannot be reached" in text}
    assert len(gone) == 3


def test_all_servers_die_and_one_comes_back() -> None:
    servers = [OpenAIChat(Faults(latency_s=0.01)) for _ in range(3)]

    async def main() -> list[object]:
        started = [await start(server, 0) for server in servers]
        config = at(*(f"http://127.0.0.1:{port}" for _, port in started), max_concurrency=8)
        model = make_model(config, policy=RetryPolicy(base_s=0.01, max_wait_s=0.05))
        asking = asyncio.create_task(answers_of(model, *names(80)))
        while sum(server.ended["ok"] for server in servers) < 20:
            await asyncio.sleep(0.005)
        await kill(*(runner for runner, _ in started))
        await asyncio.sleep(0.3)
        assert not asking.done()
        back, _ = await start(servers[2], started[2][1])
        answers = await asking
        await model.aclose()
        await back.cleanup()
        return answers

    assert [type(answer) for answer in run(main)] == [Reply] * 80


def test_servers_that_are_all_gone_for_good_stop_the_model() -> None:
    config = at("http://127.0.0.1:9", "http://127.0.0.1:10", max_concurrency=4)
    answers = ask(make_model(config, policy=QUICK), *map(make_request, names(30)))
    assert {type(answer) for answer in answers} == {UnavailableError}
    assert "all 2 servers" in str(answers[0])


def test_a_server_that_refuses_everything_is_left_out_and_the_last_one_stops_the_model() -> None:
    said: list[str] = []
    wrong, right = OpenAIChat(Faults(mode="404")), OpenAIChat()
    policy = RetryPolicy()
    with Running(wrong) as first, Running(right) as second:
        config = at(first.url, second.url, max_concurrency=4)
        model = make_model(config, breakers=Breakers(policy, said.append))
        replies = ask(model, *map(make_request, names(30)))
        assert [type(reply) for reply in replies] == [Reply] * 30
        assert right.ended == {"ok": 30}
        assert wrong.requests <= 4
        (text,) = said
        assert text.startswith(f"{first.url} is left out of m: ")
        right.faults = Faults(mode="404")
        stopped = ask(make_model(config), *map(make_request, names(30)))
    assert {type(answer) for answer in stopped} == {UnavailableError}
    assert wrong.requests + right.ended["404"] <= 3 * 4


def hurried(policy: RetryPolicy) -> RetryPolicy:
    """The policy by a clock that runs a hundred times as fast."""
    clock = Clock(lambda: 100 * time.monotonic(), lambda wait_s: asyncio.sleep(wait_s / 100))
    return RetryPolicy(policy.attempts, base_s=1.0, max_wait_s=5.0, clock=clock)


BAD_FILES = [
    ("", "", "lists no address"),
    ("# none\n\n", "", "lists no address"),
    ("http://a:1/v1\nlocalhost\n", ":2", "is not the address of a server"),
    ("http://a:1/v1\n\nhttp://a:1/v1\n", ":3", "stands twice"),
    ("http://a:1/v1\nhttp://b", ":2", "may be half written"),
    ("http://me:secret@a:1/v1\n", ":1", "holds a user name or a password"),
    ("http://a:1/v1?key=secret\n", ":1", "holds a query"),
]


def test_a_failure_counts_as_an_attempt_wherever_it_happened() -> None:
    with ExitStack() as stack:
        servers = [OpenAIChat(Faults(mode="500")) for _ in range(3)]
        urls = [stack.enter_context(Running(server)).url for server in servers]
        (answer,) = ask(make_model(at(*urls), policy=QUICK), make_request())
    assert isinstance(answer, RetryableError)
    assert sum(server.requests for server in servers) == QUICK.attempts
    assert all(server.requests >= 2 for server in servers)


@pytest.mark.parametrize("page", ["html", "cut", "empty"])
def test_who_never_gives_a_reply_that_can_be_read_is_asked_no_more(page: str) -> None:
    said: list[str] = []
    breakers = Breakers(QUICK, said.append)
    wrong, right = OpenAIChat(Faults(mode=page)), OpenAIChat()
    few = QUICK.max_connection_failures + 10
    with Running(wrong) as first, Running(right) as second:
        alone = ask(make_model(at(first.url, max_concurrency=3)), *map(make_request, names(30)))
        assert wrong.requests <= few
        beside = at(first.url, second.url, max_concurrency=4)
        answers = ask(make_model(beside, breakers=breakers), *map(make_request, names(60)))
        assert wrong.requests <= 2 * few
        # One that has given a reply is there, whatever follows.
        wrong.faults = Faults()
        model = make_model(at(first.url))

        async def main() -> list[object]:
            first_of_all = await answers_of(model, "first")
            wrong.faults = Faults(mode=page)
            answers = first_of_all + await answers_of(model, *names(4))
            await model.aclose()
            return answers

        later = run(main)
    assert {type(answer) for answer in alone} <= {RetryableError, UnavailableError}
    assert f"{first.url} never gave a reply that can be read, " in str(alone[-1])
    assert [type(answer) for answer in answers] == [Reply] * 60
    assert said[0].startswith(f"{first.url} gives no reply that can be read, trying now and then")
    assert [type(answer) for answer in later] == [Reply, *[RetryableError] * 4]
