"""A server that cannot be reached: few attempts in all, and everything goes on when it is back."""

from __future__ import annotations

import asyncio
import socket

import pytest
from aiohttp import web
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.config.models import ModelConfig
from phyblock.errors import (
    ModelError,
    RetryableError,
    SampleError,
    Sent,
    UnavailableError,
    UnreachableError,
)
from phyblock.models import Breakers, Gate, Halt, HaltedError, Reply, RetryPolicy
from phyblock.models.breaker import FAILURES_TO_OPEN, Breaker, server_of
from phyblock.models.chat import ChatModel, ChatParts
from phyblock.models.limits import ModelLimiter
from phyblock.models.replicas import Replicas
from phyblock.models.transport import Call
from tests.models.factory import ask, make_model, make_request, run
from tests.models.routes import KEY_VARIABLE, ROUTES
from tests.models.test_limits import FakeTime
from tests.servers.chassis import Faults, Running, Seen, start
from tests.servers.openai_chat import OpenAIChat

REFUSED = UnreachableError("connection refused")
LOST = RetryableError("connection refused", sent="lost")
PAGE = RetryableError("HTTP 200: malformed reply", status=200)


class Outage:
    """A transport whose server is away from `begins_s` until `ends_s`; calls take `takes_s`."""

    def __init__(
        self,
        time: FakeTime,
        begins_s: float,
        ends_s: float,
        takes_s: float,
        error: RetryableError = LOST,
    ) -> None:
        self.time = time
        self.error = error
        self.begins_s, self.ends_s, self.takes_s = begins_s, ends_s, takes_s
        self.failed = self.answered = 0

    def is_away(self) -> bool:
        return self.begins_s <= self.time.now_s < self.ends_s

    async def send(self, _: Call) -> Reply:
        was_away = self.is_away()
        if not was_away:
            await self.time.sleep(self.takes_s)
        if was_away or self.is_away():
            self.failed += 1
            raise RetryableError(str(self.error), status=self.error.status, sent=self.error.sent)
        self.answered += 1
        return Reply(text="Step1: Move block with index 1")

    async def aclose(self) -> None:
        pass


def chat(
    time: FakeTime, transport: Outage, breakers: Breakers, width: int, halt: Halt
) -> ChatModel:
    config = ModelConfig(name="m", id="openai/m", api_base="http://gone:1/v1")
    parts = ChatParts(
        replicas=Replicas(config, lambda _: transport, breakers),
        limiter=ModelLimiter(width, Gate(width), clock=time.clock),
        cache=None,
        budget=None,
        prices=None,
        policy=RetryPolicy(clock=time.clock),
        secrets=(),
        observer=lambda _: None,
        halt=halt,
    )
    return ChatModel(config, parts)


def at_a_breaker(time: FakeTime, policy: RetryPolicy) -> tuple[Breaker, Replicas]:
    """A breaker, and the one server behind it."""
    config = ModelConfig(name="m", id="openai/m", api_base="http://gone:1/v1")
    breakers = Breakers(policy)
    replicas = Replicas(config, lambda _: Outage(time, 0.0, 0.0, 0.0), breakers)
    return breakers.of(config), replicas


def ask_through(
    transport: Outage, time: FakeTime, *, samples: int, width: int, most_failures: int = 20
) -> tuple[list[Reply | ModelError], list[str]]:
    """Ask as the executor does, `width` samples at once, a stopped model no more."""
    answers: list[Reply | ModelError] = []
    said: list[str] = []

    async def main() -> None:
        policy = RetryPolicy(clock=time.clock, max_connection_failures=most_failures)
        breakers = Breakers(policy, said.append)
        model = chat(time, transport, breakers, width, Halt())
        queue = [make_request(f"{n:03}") for n in range(samples)]

        async def work() -> None:
            while queue:
                request = queue.pop(0)
                try:
                    answers.append(await model.ask(request))
                except UnavailableError as error:
                    queue.clear()
                    answers.append(error)
                except ModelError as error:
                    answers.append(error)

        await time.run_until_done(*(asyncio.create_task(work()) for _ in range(width)))

    run(main)
    return answers, said


@settings(max_examples=40, deadline=None)
@given(
    st.floats(0, 30, allow_nan=False),
    st.floats(1, 280, allow_nan=False),
    st.floats(0.1, 20, allow_nan=False),
    st.integers(1, 12),
)
def test_an_outage_loses_nothing_and_costs_few_attempts(
    begins_s: float, lasts_s: float, takes_s: float, width: int
) -> None:
    time = FakeTime()
    transport = Outage(time, begins_s, begins_s + lasts_s, takes_s)
    # The outage may begin before the first answer: that is waited for here, too.
    answers, _ = ask_through(transport, time, samples=40, width=width, most_failures=10**6)
    assert [type(answer) for answer in answers] == [Reply] * 40
    assert transport.answered == 40
    # Those under way, those that open the breaker, and probes at growing distances.
    assert transport.failed <= 2 * width + FAILURES_TO_OPEN + 30


@settings(max_examples=20, deadline=None)
@given(st.floats(1, 100, allow_nan=False), st.floats(0.1, 20, allow_nan=False), st.integers(2, 64))
def test_pages_that_a_proxy_shows_while_the_model_is_loaded_lose_nothing(
    lasts_s: float, takes_s: float, width: int
) -> None:
    time = FakeTime()
    transport = Outage(time, 0.0, lasts_s, takes_s, PAGE)
    answers, _ = ask_through(transport, time, samples=80, width=width)
    assert [type(answer) for answer in answers] == [Reply] * 80
    assert transport.failed <= 2 * width + FAILURES_TO_OPEN + 30


@pytest.mark.parametrize("width", [2, 8, 32])
@pytest.mark.parametrize(
    ("error", "fault", "never"),
    [
        (LOST, "cannot be reached", "never answered"),
        (PAGE, "gives no reply that can be read", "never gave a reply that can be read"),
    ],
)
def test_a_wrong_address_stops_the_model_after_few_attempts_and_leaves_its_samples(
    width: int, error: RetryableError, fault: str, never: str
) -> None:
    time = FakeTime()
    transport = Outage(time, 0.0, float("inf"), 1.0, error)
    answers, said = ask_through(transport, time, samples=500, width=width)
    assert {type(answer) for answer in answers} == {UnavailableError}
    assert len(answers) == width
    assert f"http://gone:1 {never}, 20 times in a row: {error}" in str(answers[0])
    assert transport.failed <= width + FAILURES_TO_OPEN + 30
    first, *later = said
    assert first.startswith(f"http://gone:1 {fault}, trying now and then: {error}")
    assert 100 <= time.now_s < 200
    # A log is never silent for long, and says that it gets worse.
    assert time.now_s / 20 <= len(later) <= time.now_s / 10
    assert all(f"still {fault}: tried " in text for text in later)


@settings(max_examples=20, deadline=None)
@given(st.floats(30, 60, allow_nan=False), st.integers(1, 12))
def test_a_server_that_has_answered_is_tried_for_as_long_as_the_policy_says(
    begins_s: float, width: int
) -> None:
    time = FakeTime()
    transport = Outage(time, begins_s, float("inf"), 5.0)
    answers, _ = ask_through(transport, time, samples=500, width=width)
    replies = [answer for answer in answers if isinstance(answer, Reply)]
    assert len(replies) == transport.answered > 0
    assert "http://gone:1 could not be reached for 3" in str(answers[-1])
    assert begins_s + 290 <= time.now_s < begins_s + 420


@given(st.none() | st.floats(0, 1000), st.integers(0, 20))
def test_the_next_probe_waits_as_long_as_the_server_asks(
    asked_s: float | None, probes: int
) -> None:
    async def main() -> None:
        time = FakeTime()
        policy = RetryPolicy(clock=time.clock)
        breaker, replicas = at_a_breaker(time, policy)
        error = RetryableError("overloaded", status=503, retry_after_s=asked_s)
        for number in range(FAILURES_TO_OPEN):
            breaker.failed(error, number, is_probe=False)

        async def probe_again_and_again() -> None:
            for _ in range(probes + 1):
                failed_s = time.now_s
                try:
                    async with replicas.passing() as probed:
                        least_s = min(asked_s or 0.0, policy.max_retry_after_s)
                        waited_s = time.now_s - failed_s
                        assert least_s - 1e-6 <= waited_s <= max(15.0, least_s) + 1e-6
                        breaker.failed(error, "probe", is_probe=probed is not None)
                except UnavailableError:
                    return

        task = asyncio.create_task(probe_again_and_again())
        await time.run_until_done(task)
        await task

    run(main)


def test_all_go_on_at_once_when_a_probe_succeeds() -> None:
    time = FakeTime()
    transport = Outage(time, 0.0, 100.0, 1.0)
    answers, said = ask_through(transport, time, samples=16, width=16)
    assert len(answers) == 16
    assert time.now_s < 100 + 15 + 3 * 1.0
    *while_away, back = said[1:]
    assert all("still cannot be reached" in text for text in while_away)
    assert back.partition(" after")[0] == "http://gone:1 answers again"


def test_what_a_server_says_itself_never_opens_it() -> None:
    breaker = Breaker("s", RetryPolicy())
    for status in (429, 500, 529, 200, 400):
        for number in range(50):
            error = RetryableError("x", status=status)
            breaker.failed(error, number, is_probe=False)
    breaker.failed(SampleError("no key"), 1, is_probe=False)
    assert not breaker.is_open


def test_what_is_not_answered_in_time_never_opens_it() -> None:
    breaker = Breaker("s", RetryPolicy())
    for number in range(50):
        breaker.failed(RetryableError("too slow", sent="maybe"), number, is_probe=False)
    assert not breaker.is_open


def test_a_probe_that_is_taken_but_not_answered_in_time_closes_it() -> None:
    breaker = Breaker("s", RetryPolicy())
    for number in range(FAILURES_TO_OPEN):
        breaker.failed(REFUSED, number, is_probe=False)
    breaker.failed(RetryableError("too slow", sent="maybe"), "sent before", is_probe=False)
    assert breaker.is_open
    breaker.failed(RetryableError("too slow", sent="maybe"), "probe", is_probe=True)
    assert not breaker.is_open


class SlowAtHead(OpenAIChat):
    """Never answers about the scenes whose names begin with "slow"."""

    async def _end(self, seen: Seen, ending: str, request: web.Request) -> web.StreamResponse:
        is_slow = any(isinstance(part, str) and "Scene slow" in part for part in seen.parts)
        return await super()._end(seen, "slow" if is_slow else ending, request)


@pytest.mark.parametrize("route", ["direct", "openai"])
def test_slow_requests_at_the_head_end_alone_and_the_rest_goes_on(
    monkeypatch: pytest.MonkeyPatch, route: str
) -> None:
    monkeypatch.setenv(KEY_VARIABLE, "sk-not-a-real-key-1234")
    names = [f"slow {n}" for n in range(8)] + [f"{n:03}" for n in range(12)]
    with Running(SlowAtHead()) as running:
        fields = {"timeout_s": 0.5, "max_concurrency": 8}
        policy = RetryPolicy(2, 0.0, base_s=0.001, max_wait_s=0.002)
        config = ROUTES[route].config(running.url, **fields)
        answers = ask(make_model(config, policy=policy), *map(make_request, names))
    assert [type(answer) for answer in answers] == [RetryableError] * 8 + [Reply] * 12


def test_a_connection_that_is_not_made_in_time_was_not_sent() -> None:
    with socket.socket() as full:
        full.bind(("127.0.0.1", 0))
        full.listen(0)
        others = [socket.socket() for _ in range(4)]
        for other in others:
            other.setblocking(False)
            other.connect_ex(full.getsockname())
        url = f"http://127.0.0.1:{full.getsockname()[1]}/v1"
        config = ModelConfig(name="m", id="openai/m", api_base=url, timeout_s=0.3)
        (answer,) = ask(make_model(config, policy=RetryPolicy(1, 0.0)), make_request())
        for other in others:
            other.close()
    assert isinstance(answer, UnreachableError), answer
    assert "no connection to 127.0.0.1" in str(answer)


@pytest.mark.parametrize(
    ("status", "sent"),
    [(None, "no"), (None, "lost"), (502, None), (503, None), (504, None)],
)
def test_failures_of_one_request_alone_are_no_outage(status: int | None, sent: Sent | None) -> None:
    breaker = Breaker("s", RetryPolicy())
    error = RetryableError("x", status=status, sent=sent)
    for _ in range(50):
        breaker.failed(error, "poison", is_probe=False)
    assert not breaker.is_open
    breaker.failed(error, "another", is_probe=False)
    assert breaker.is_open


def test_an_answer_between_failures_keeps_it_closed() -> None:
    breaker = Breaker("s", RetryPolicy())
    for number in range(50):
        for nth in range(FAILURES_TO_OPEN - 1):
            breaker.failed(REFUSED, (number, nth), is_probe=False)
        breaker.heard()
    assert not breaker.is_open


def test_one_request_at_a_time_probes() -> None:
    async def main() -> None:
        time = FakeTime()
        breaker, replicas = at_a_breaker(time, RetryPolicy(clock=time.clock))
        for number in range(FAILURES_TO_OPEN):
            breaker.failed(REFUSED, number, is_probe=False)
        inside = 0

        async def request(number: int) -> None:
            nonlocal inside
            async with replicas.passing() as probed:
                if probed is not None:
                    inside += 1
                    assert inside == 1
                    await time.sleep(3.0)
                    inside -= 1
                    if time.now_s < 60:
                        breaker.failed(REFUSED, number, is_probe=True)
                    else:
                        breaker.heard()

        await time.run_until_done(*(asyncio.create_task(request(n)) for n in range(10)))
        assert not breaker.is_open

    run(main)


def test_a_late_answer_wakes_the_one_that_waits_to_probe() -> None:
    async def main() -> None:
        time = FakeTime()
        policy = RetryPolicy(base_s=1000.0, max_wait_s=1000.0, clock=time.clock)
        breaker, replicas = at_a_breaker(time, policy)
        for number in range(FAILURES_TO_OPEN):
            breaker.failed(REFUSED, number, is_probe=False)

        async def request() -> None:
            async with replicas.passing() as probed:
                assert probed is None

        waiting = [asyncio.create_task(request()) for _ in range(3)]
        for _ in range(10):
            await asyncio.sleep(0)
        breaker.heard()
        await asyncio.gather(*waiting)
        assert time.now_s == 0.0

    run(main)


def test_a_wait_at_the_breaker_is_given_up_when_the_run_ends() -> None:
    async def main() -> list[object]:
        time = FakeTime()
        halt = Halt()
        breakers = Breakers(RetryPolicy(clock=time.clock))
        transport = Outage(time, 0.0, float("inf"), 1.0)
        model = chat(time, transport, breakers, 8, halt)
        asked = [asyncio.create_task(model.ask(make_request(f"{n}"))) for n in range(8)]
        while halt.waiting < len(asked):
            await asyncio.sleep(0)
        halt.set()
        return list(await asyncio.gather(*asked, return_exceptions=True))

    assert {type(answer) for answer in run(main)} == {HaltedError}


def test_models_of_one_server_share_its_breaker() -> None:
    breakers = Breakers(RetryPolicy())
    bases = ["http://a:1/v1", "http://A:1/other", "http://a:1", "http://b:1", None]
    found = [breakers.of(ModelConfig(name="m", id="openai/m", api_base=base)) for base in bases]
    assert found[0] is found[1] is found[2]
    assert len({id(breaker) for breaker in found}) == 3


@pytest.mark.parametrize(
    ("api_base", "server"),
    [
        ("https://Host:8000/v1", "https://host:8000"),
        ("http://[::1]:8000/v1/", "http://[::1]:8000"),
        ("http://host", "http://host"),
        (None, "openai"),
    ],
)
def test_a_server_is_named_by_scheme_host_and_port(api_base: str | None, server: str) -> None:
    assert server_of(ModelConfig(name="m", id="openai/m", api_base=api_base)) == server


@pytest.mark.parametrize("route", ["direct", "openai"])
def test_a_server_that_restarts_loses_nothing_over_a_real_wire(
    monkeypatch: pytest.MonkeyPatch, route: str
) -> None:
    monkeypatch.setenv(KEY_VARIABLE, "sk-not-a-real-key-1234")
    server = ROUTES[route].server(Faults(latency_s=0.02))
    policy = RetryPolicy(base_s=0.01, max_wait_s=0.05)

    async def main() -> list[object]:
        runner, port = await start(server, 0)
        config = ROUTES[route].config(f"http://127.0.0.1:{port}", max_concurrency=8)
        model = make_model(config, policy=policy)
        asked = [asyncio.create_task(model.ask(make_request(f"{n:03}"))) for n in range(60)]
        while server.ended["ok"] < 20:
            await asyncio.sleep(0.005)
        await runner.cleanup()
        # Each sample would use up its eight attempts in this time.
        await asyncio.sleep(0.5)
        runner, _ = await start(server, port)
        answers = await asyncio.gather(*asked, return_exceptions=True)
        await model.aclose()
        await runner.cleanup()
        return list(answers)

    assert [type(answer) for answer in run(main)] == [Reply] * 60


@pytest.mark.parametrize("route", ["direct", "openai"])
def test_a_dead_server_costs_few_attempts_over_a_real_wire(
    monkeypatch: pytest.MonkeyPatch, route: str
) -> None:
    monkeypatch.setenv(KEY_VARIABLE, "sk-not-a-real-key-1234")
    config = ROUTES[route].config("http://127.0.0.1:9", max_concurrency=4)
    policy = RetryPolicy(retry_for_s=0.0, base_s=0.001, max_wait_s=0.002)
    events: list[object] = []

    async def main() -> list[object]:
        model = make_model(config, events=events, policy=policy)  # type: ignore[arg-type]
        asked = (model.ask(make_request(f"{n:03}")) for n in range(50))
        answers = await asyncio.gather(*asked, return_exceptions=True)
        await model.aclose()
        return list(answers)

    answers = run(main)
    assert {type(answer) for answer in answers} == {UnavailableError}
    assert "http://127.0.0.1:9 could not be reached" in str(answers[0])
    # Those that open it are told one by one; what follows is told of the server.
    assert len(events) <= 4 + FAILURES_TO_OPEN
