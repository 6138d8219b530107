"""Each way in which a call can end, through both transports and all protocols, on a real wire."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from phyblock.errors import RefusedError, RetryableError, SampleError, UnavailableError
from phyblock.models import ModelEvent, Reply
from phyblock.models.client import shown
from tests.models.factory import QUICK, ask, make_model, make_request
from tests.models.routes import KEY, ROUTES
from tests.servers.chassis import Faults, LocalServer, Running

OPENAI = ("direct", "openai", "vllm")
ENDS: dict[str, tuple[type, int, tuple[str, ...]]] = {
    **dict.fromkeys(
        ("429", "500", "reset", "cut", "html", "empty"),
        (RetryableError, QUICK.attempts, tuple(ROUTES)),
    ),
    **dict.fromkeys(("401", "403", "404"), (UnavailableError, 1, tuple(ROUTES))),
    "400": (SampleError, 3, tuple(ROUTES)),
    "policy": (RefusedError, 3, (*OPENAI, "anthropic")),
    "quota": (UnavailableError, 1, OPENAI),
    **dict.fromkeys(("ok", "length", "filtered"), (Reply, 3, tuple(ROUTES))),
}
"""By mode: the outcome, requests of three questions (of one that is retried), and the routes."""
CELLS = [(route, mode) for mode, (_, _, routes) in ENDS.items() for route in routes]


def answers_of(
    route: str, faults: Faults, *seeds: int, policy: Any = QUICK, **fields: Any
) -> tuple[list[Any], LocalServer, list[ModelEvent]]:
    """Ask a new model one question with each seed, one after another."""
    server, events = ROUTES[route].server(faults), list[ModelEvent]()
    with Running(server) as running:
        config = ROUTES[route].config(running.url, max_concurrency=1, **fields)
        model = make_model(config, events=events, policy=policy)
        answers = ask(model, *(make_request("001", seed) for seed in seeds))
    return answers, server, events


@pytest.mark.parametrize(("route", "mode"), CELLS)
def test_a_call_ends_as_the_server_ends_it(route: str, mode: str) -> None:
    kind, requests, _ = ENDS[mode]
    seeds = (1,) if kind is RetryableError else (1, 2, 3)
    answers, server, events = answers_of(route, Faults(mode=mode), *seeds, seed="never")
    assert {type(answer) for answer in answers} == {kind}, answers
    assert server.requests == requests
    retried = requests - 1 if kind is RetryableError else 0
    assert [event.kind for event in events] == ["retry"] * retried
    if mode.startswith("4") and kind is UnavailableError:
        assert {answer.status for answer in answers} == {int(mode)}
    if kind is Reply:
        finish = {"ok": "stop", "filtered": "refusal"}.get(mode, mode)
        text = server.seen[0].reply_text if mode == "ok" else ""
        read = [(answer.finish, answer.text, answer.usage.prompt_tokens) for answer in answers]
        assert read == [(finish, text, 1000)] * 3
        assert mode != "ok" or {answer.reasoning for answer in answers} == {"Let me see."}
        assert {(answer.attempts, answer.seed_sent) for answer in answers} == {(1, False)}
        assert {seen.seed for seen in server.seen} == {None}


@pytest.mark.parametrize("route", ROUTES)
@pytest.mark.parametrize("wish", ["7", "Wed, 21 Oct 2099 07:28:00 GMT"])
def test_retry_after_is_read_as_seconds_and_as_a_date(route: str, wish: str) -> None:
    (answer,), _, _ = answers_of(route, Faults(mode="429", retry_after=wish), 1)
    assert isinstance(answer, RetryableError)
    assert (answer.retry_after_s or 0) >= 7


@pytest.mark.parametrize("route", [*OPENAI, "gemini"])
def test_a_refused_seed_is_an_error_that_says_what_to_set(route: str) -> None:
    (answer,), _, _ = answers_of(route, Faults(mode="seed"), 1)
    assert isinstance(answer, SampleError)
    assert "set seed: never" in str(answer)
    (answer,), _, _ = answers_of(route, Faults(mode="seed"), 1, seed="never")
    assert (answer.seed_sent, answer.attempts) == (False, 1)


def test_where_no_seed_exists_none_is_sent_unless_it_must_be() -> None:
    answers, server, _ = answers_of("anthropic", Faults(), 1, 2)
    assert [answer.seed_sent for answer in answers] == [False, False]
    (answer,), _, _ = answers_of("anthropic", Faults(), 1, seed="always")
    assert isinstance(answer, UnavailableError)
    assert server.requests == 2


@pytest.mark.parametrize("route", ROUTES)
def test_a_server_that_never_answers_is_a_timeout(route: str) -> None:
    policy = replace(QUICK, attempts=3)
    (answer,), server, _ = answers_of(route, Faults(mode="slow"), 1, timeout_s=0.2, policy=policy)
    assert isinstance(answer, RetryableError)
    assert answer.status is None
    assert server.requests == policy.attempts


def test_keys_leave_an_error_before_it_is_cut() -> None:
    for length in range(440, 520):
        text = shown(f"{'x' * length}{KEY} and more", (KEY,))
        assert len(text) <= 500
        assert KEY[:4] not in text
