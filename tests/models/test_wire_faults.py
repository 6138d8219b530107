"""Every named fault of a server, through both transports and all protocols: what comes of it."""

from __future__ import annotations

import asyncio
import socket

import pytest

from phyblock.errors import (
    ModelError,
    RetryableError,
    SampleError,
    UnavailableError,
    UnreachableError,
)
from phyblock.models import Reply, RetryPolicy
from tests.models.factory import ask, make_model, make_request
from tests.models.routes import KEY, ROUTES, Route
from tests.servers.chassis import Faults, LocalServer, Running
from tests.servers.faults import WIRE_FAULTS
from tests.servers.openai_chat import OpenAIChat

ENDINGS = {
    "reply": Reply,
    "retryable": RetryableError,
    "unavailable": UnavailableError,
    "sample": SampleError,
}
ONCE = RetryPolicy(1, 0.0)
REDIRECTED = {
    **ROUTES,
    "xai": Route(OpenAIChat, "xai/m", "/v1", "litellm"),
    "openrouter": Route(OpenAIChat, "openrouter/m", "/v1", "litellm"),
}
AS_LITELLM_READS = {
    **dict.fromkeys((name, "usage-true") for name in ("openai", "vllm", "anthropic", "gemini")),
    **dict.fromkeys(("anthropic", mode) for mode in ("usage-huge", "usage-fraction")),
}
"""Counts that are none and that litellm takes for some: what it makes of them is what is known."""
SERVERS_WORDS = {
    name for name in WIRE_FAULTS if name.startswith(("200-code", "200-message", "200-error-s"))
}
Answers = dict[str, Reply | ModelError]


@pytest.fixture(autouse=True)
def _environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NO_PROXY", "*")


def answers_to(route: Route, server: LocalServer, url: str, faults: list[str]) -> Answers:
    """Return a model's error for each fault, met one after another; each costs one request."""

    async def one(mode: str) -> Reply | ModelError:
        server.faults = Faults(mode=mode)
        fields = {"seed": "never", "timeout_s": 0.7 if mode == "drip" else 20.0}
        model = make_model(route.config(url, most_body_bytes=2**20, **fields), policy=ONCE)
        try:
            reply = await model.ask(make_request())
        except ModelError as error:
            return error
        finally:
            await model.aclose()
        assert reply is not None
        return reply

    async def all_of_them() -> Answers:
        return {mode: await one(mode) for mode in faults}

    return asyncio.run(all_of_them())


@pytest.mark.parametrize("name", ROUTES)
def test_every_fault_ends_as_it_must_after_one_request(name: str) -> None:
    route = ROUTES[name]
    server = route.server()
    with Running(server) as running:
        answers = answers_to(route, server, running.url, list(WIRE_FAULTS))
    for mode, answer in answers.items():
        assert isinstance(answer, ENDINGS[WIRE_FAULTS[mode].ending]), (mode, answer)
        assert server.ended[mode] == 1, mode
        told = str(answer) + repr(answer)
        assert KEY not in told, mode
        assert KEY[:8] not in told, mode
        if mode in SERVERS_WORDS and name != "anthropic":
            assert "Upstream is down" in told or "No auth credentials" in told, (mode, told)
    check_usage(name, answers)
    check_texts(answers)


def check_usage(route: str, answers: Answers) -> None:
    """Impossible counts are not known; a good usage is."""
    for mode, answer in answers.items():
        if mode.startswith("usage-") and (route, mode) not in AS_LITELLM_READS:
            assert isinstance(answer, Reply)
            counts = (answer.usage.prompt_tokens, answer.usage.completion_tokens)
            assert (*counts, answer.usage.reasoning_tokens) == (None, None, None), mode
    whole = answers["gzip"]
    assert isinstance(whole, Reply)
    assert (whole.usage.prompt_tokens, whole.usage.completion_tokens) == (1000, 40)


def check_texts(answers: Answers) -> None:
    """Whatever is kept can be written, and holds no key."""
    surrogate, echo = answers["surrogate"], answers["echo-key-in-reply"]
    assert isinstance(surrogate, Reply)
    assert surrogate.text == "Step1: \ufffd index 1"
    assert isinstance(echo, Reply)
    assert "[key]" in echo.text
    assert "[key]" in echo.provider_model


@pytest.mark.parametrize("name", REDIRECTED)
def test_a_redirect_takes_nothing_anywhere(name: str) -> None:
    route = REDIRECTED[name]
    away = OpenAIChat()
    with Running(away) as elsewhere:
        there = elsewhere.url.replace("127.0.0.1", "localhost")
        server = route.server(elsewhere=there)
        with Running(server) as running:
            modes = [mode for mode in WIRE_FAULTS if mode.startswith("redirect")]
            answers = answers_to(route, server, running.url, modes)
    assert away.requests == 0
    for mode, answer in answers.items():
        assert isinstance(answer, UnavailableError), mode
        assert server.ended[mode] == 1, mode
        assert "is api_base the address" in str(answer)
        assert "h1dden" not in str(answer)
        if mode.endswith("away"):
            assert f"redirects to localhost:{elsewhere.port}," in str(answer)


@pytest.mark.parametrize("name", ["direct", "openai", "vllm", "anthropic"])
def test_a_name_that_is_not_known_is_not_called_a_lost_connection(name: str) -> None:
    config = ROUTES[name].config("http://no-such-host.invalid", seed="never")
    (answer,) = ask(make_model(config, policy=ONCE), make_request())
    assert isinstance(answer, UnreachableError), answer
    assert answer.status is None
    assert "DNS" in str(answer)
    assert "no-such-host.invalid" in str(answer)


@pytest.mark.parametrize("name", ["direct", "vllm"])
def test_a_closed_port_and_a_server_without_tls_are_named(name: str) -> None:
    with Running(OpenAIChat()) as running, socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        closed = f"http://127.0.0.1:{taken.getsockname()[1]}"
        for url in (closed, running.url.replace("http://", "https://")):
            config = ROUTES[name].config(url, seed="never")
            (answer,) = ask(make_model(config, policy=ONCE), make_request())
            assert isinstance(answer, UnreachableError), answer
            assert f"no connection to {url.partition('//')[2]}" in str(answer)


def test_a_connection_that_is_not_made_in_time_was_not_sent() -> None:
    with socket.socket() as full:
        full.bind(("127.0.0.1", 0))
        full.listen(0)
        others = [socket.socket() for _ in range(4)]
        for other in others:
            other.setblocking(False)
            other.connect_ex(full.getsockname())
        config = ROUTES["direct"].config(f"http://127.0.0.1:{full.getsockname()[1]}", timeout_s=0.6)
        (answer,) = ask(make_model(config, policy=ONCE), make_request())
        for other in others:
            other.close()
    assert isinstance(answer, UnreachableError), answer
    assert "no connection to 127.0.0.1" in str(answer)


def test_both_transports_say_the_same_of_what_a_server_said() -> None:
    modes = ["200-quota", "200-code-object", "200-error-string", "400-string", "401-string"]
    modes += ["429-bare", "503", "redirect-nowhere", "gzip-bomb", "reset-midway"]
    told = []
    for name in ("direct", "openai", "vllm", "gemini"):
        server = ROUTES[name].server()
        with Running(server) as running:
            answers = answers_to(ROUTES[name], server, running.url, modes)
        told.append({mode: str(answer) for mode, answer in answers.items()})
    assert told[1:] == [told[0]] * 3
