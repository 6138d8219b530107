"""Each way in which a call can fail, through both transports and all protocols, on a real wire."""

from __future__ import annotations

import asyncio
import json
import traceback
from dataclasses import replace

import pytest
from aiohttp import web

from phyblock.config.models import ModelConfig
from phyblock.errors import RefusedError, RetryableError, SampleError, UnavailableError
from phyblock.models import ModelEvent, Reply
from phyblock.models.client import Answer, error_of, read_json, shown
from tests.models.factory import QUICK, ask, make_model, make_request, run
from tests.models.routes import KEY_VARIABLE, ROUTES
from tests.servers.chassis import Faults, LocalServer, Running, Seen
from tests.servers.openai_chat import OpenAIChat

KEY = "sk-not-a-real-key-1234"
RETRIED = ("429", "500", "reset", "cut", "html", "empty")


@pytest.fixture(autouse=True)
def _key(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(KEY_VARIABLE, KEY)


@pytest.fixture(params=ROUTES)
def route(request: pytest.FixtureRequest) -> str:
    name: str = request.param
    return name


def serve(route: str, faults: Faults) -> tuple[Running, LocalServer]:
    server = ROUTES[route].server(faults)
    return Running(server), server


def config(route: str, url: str, **fields: object) -> ModelConfig:
    return ROUTES[route].config(url, **fields)


@pytest.mark.parametrize("mode", RETRIED)
def test_a_failure_that_may_pass_is_sent_once_an_attempt(route: str, mode: str) -> None:
    running, server = serve(route, Faults(mode=mode))
    events: list[ModelEvent] = []
    with running:
        model = make_model(config(route, running.url, seed="never"), events=events)
        (answer,) = ask(model, make_request())
    assert isinstance(answer, RetryableError), answer
    assert server.requests == QUICK.attempts
    assert [event.kind for event in events].count("retry") == QUICK.attempts - 1


@pytest.mark.parametrize("mode", ["401", "403", "404"])
def test_a_model_that_cannot_answer_is_asked_once(route: str, mode: str) -> None:
    running, server = serve(route, Faults(mode=mode))
    events: list[ModelEvent] = []
    with running:
        model = make_model(
            config(route, running.url, seed="never", max_concurrency=1), events=events
        )
        answers = ask(model, *(make_request(f"{n:03}") for n in range(5)))
    assert all(isinstance(answer, UnavailableError) for answer in answers), answers
    assert all(answer.status == int(mode) for answer in answers)  # type: ignore[union-attr]
    assert server.requests == 1
    assert [event.kind for event in events] == ["unavailable"]


def test_a_bad_request_fails_alone_and_is_not_repeated(route: str) -> None:
    running, server = serve(route, Faults(mode="400"))
    with running:
        model = make_model(config(route, running.url))
        answers = ask(model, make_request("001"), make_request("002"))
    assert [type(answer) for answer in answers] == [SampleError, SampleError]
    assert server.requests == 2


@pytest.mark.parametrize("route", ["direct", "openai", "vllm", "anthropic"])
def test_a_content_policy_is_a_refusal_of_the_sample(route: str) -> None:
    running, server = serve(route, Faults(mode="policy"))
    with running:
        (answer,) = ask(make_model(config(route, running.url)), make_request())
    assert isinstance(answer, RefusedError), answer
    assert server.requests == 1


@pytest.mark.parametrize("route", ["direct", "openai", "vllm"])
def test_an_exhausted_account_stops_the_model_though_it_says_429(route: str) -> None:
    running, server = serve(route, Faults(mode="quota"))
    with running:
        (answer,) = ask(make_model(config(route, running.url)), make_request())
    assert isinstance(answer, UnavailableError), answer
    assert server.requests == 1


@pytest.mark.parametrize(
    ("mode", "finish", "has_text"),
    [("ok", "stop", True), ("length", "length", False), ("filtered", "refusal", False)],
)
def test_the_end_of_a_reply_is_read(route: str, mode: str, finish: str, has_text: bool) -> None:
    running, server = serve(route, Faults(mode=mode))
    with running:
        (answer,) = ask(make_model(config(route, running.url)), make_request())
    assert isinstance(answer, Reply), answer
    assert answer.finish == finish
    assert answer.text == (server.seen[0].reply_text if has_text else "")
    assert answer.usage.prompt_tokens == 1000
    assert answer.attempts == server.requests == 1


def test_thoughts_stand_apart_from_the_text(route: str) -> None:
    running, _ = serve(route, Faults())
    with running:
        (answer,) = ask(make_model(config(route, running.url)), make_request())
    assert isinstance(answer, Reply)
    assert answer.reasoning == "Let me see."


@pytest.mark.parametrize("wish", ["7", "Wed, 21 Oct 2099 07:28:00 GMT"])
def test_retry_after_is_read_as_seconds_and_as_a_date(route: str, wish: str) -> None:
    running, _ = serve(route, Faults(mode="429", retry_after=wish))
    with running:
        (answer,) = ask(make_model(config(route, running.url)), make_request())
    assert isinstance(answer, RetryableError)
    assert answer.retry_after_s is not None
    assert answer.retry_after_s >= 7


@pytest.mark.parametrize("route", ["direct", "openai", "vllm", "gemini"])
def test_a_refused_seed_is_left_out_from_then_on_and_said(route: str) -> None:
    running, server = serve(route, Faults(mode="seed"))
    events: list[ModelEvent] = []
    with running:
        model = make_model(config(route, running.url, max_concurrency=1), events=events)
        answers = ask(model, *(make_request("001", seed) for seed in (1, 2, 3)))
    assert [answer.seed_sent for answer in answers] == [False] * 3  # type: ignore[union-attr]
    assert [answer.attempts for answer in answers] == [2, 1, 1]  # type: ignore[union-attr]
    assert [seen.seed for seen in server.seen] == [1, None, None, None]
    assert [event.kind for event in events] == ["seed_unsupported"]


class Echoing(OpenAIChat):
    """Refuses a request by repeating it, as FastAPI servers do."""

    def _refuse(self, seen: Seen, ending: str) -> web.Response:
        error = {"type": ending, "loc": ["body", "messages", 1], "input": seen.raw}
        return web.json_response({"detail": [error]}, status=422)


@pytest.mark.parametrize("route", ["direct", "openai", "vllm"])
def test_an_error_that_repeats_the_request_is_no_refusal_of_seeds(route: str) -> None:
    server = Echoing(Faults(mode="400"))
    events: list[ModelEvent] = []
    with Running(server) as running:
        model = make_model(config(route, running.url, max_concurrency=1), events=events)

        async def main() -> list[object]:
            bad = await asyncio.gather(model.ask(make_request("001", 1)), return_exceptions=True)
            server.faults = Faults()
            good = [await model.ask(make_request(key, 2)) for key in ("001", "002")]
            await model.aclose()
            return [*bad, *good]

        refused, *replies = run(main)
    assert isinstance(refused, SampleError), refused
    assert [reply.seed_sent for reply in replies] == [True, True]  # type: ignore[attr-defined]
    assert [seen.seed for seen in server.seen] == [1, None, 2, 2]
    assert events == []


def test_where_no_seed_exists_none_is_spent_on_finding_out() -> None:
    running, server = serve("anthropic", Faults())
    events: list[ModelEvent] = []
    with running:
        model = make_model(config("anthropic", running.url), events=events)
        answers = ask(model, make_request("001", 1), make_request("001", 2))
    assert [answer.seed_sent for answer in answers] == [False, False]  # type: ignore[union-attr]
    assert server.requests == 2
    assert [event.kind for event in events] == ["seed_unsupported"]


@pytest.mark.parametrize("route", ["direct", "anthropic"])
def test_a_seed_that_must_be_sent_makes_a_refusal_an_error(route: str) -> None:
    running, _ = serve(route, Faults(mode="seed"))
    with running:
        model = make_model(config(route, running.url, seed="always"))
        (answer,) = ask(model, make_request())
    assert isinstance(answer, UnavailableError)
    assert "seed" in str(answer)


def test_a_seed_that_may_not_be_sent_is_not(route: str) -> None:
    running, server = serve(route, Faults())
    with running:
        model = make_model(config(route, running.url, seed="never"))
        (answer,) = ask(model, make_request("001", 7))
    assert isinstance(answer, Reply)
    assert not answer.seed_sent
    assert server.seen[0].seed is None


def test_a_server_that_never_answers_is_a_timeout(route: str) -> None:
    running, server = serve(route, Faults(mode="slow"))
    policy = replace(QUICK, attempts=3)
    with running:
        model = make_model(config(route, running.url, timeout_s=0.2), policy=policy)
        (answer,) = ask(model, make_request())
    assert isinstance(answer, RetryableError)
    assert answer.status is None
    assert server.requests == policy.attempts


@pytest.mark.parametrize("mode", ["echo-key", "ok"])
def test_a_key_arrives_but_stands_in_no_text(route: str, mode: str) -> None:
    running, server = serve(route, Faults(mode=mode))
    events: list[ModelEvent] = []
    with running:
        (answer,) = ask(make_model(config(route, running.url), events=events), make_request())
    assert server.seen[0].key == KEY
    assert KEY not in repr(answer) + repr(events) + str(answer)
    if isinstance(answer, UnavailableError):
        assert "[key]" in str(answer) or "REDACTED" in str(answer)
        told = traceback.format_exception(type(answer), answer, answer.__traceback__)
        assert KEY not in "".join(told)


@pytest.mark.parametrize(
    "words",
    [
        "Server is pinned to '/models/a'; requested 'b'.",
        "Unexpected fields in the request: {'top_k'}",
    ],
)
def test_a_server_that_would_say_it_to_every_request_is_asked_no_more(words: str) -> None:
    """As `transformers serve` says it: its other requests would fare no better."""
    answer = Answer(400, {}, json.dumps({"detail": words}).encode())
    assert isinstance(error_of(answer), UnavailableError)


@pytest.mark.parametrize("code", [429, "429", 502, "529"])
def test_what_passes_and_is_told_with_a_success_is_what_its_code_says(code: object) -> None:
    """A limit that is reached, and faults behind a gateway: none is a reply that was paid for."""
    body = json.dumps({"error": {"message": "slow down", "code": code}}).encode()
    with pytest.raises(RetryableError, match="slow down") as told:
        read_json(Answer(200, {"Retry-After": "7"}, body))
    assert (told.value.status, told.value.retry_after_s) == (int(str(code)), 7)


def test_keys_leave_an_error_before_it_is_cut() -> None:
    for length in range(440, 520):
        text = shown(f"{'x' * length}{KEY} and more", (KEY,))
        assert len(text) <= 500
        assert KEY[:4] not in text
