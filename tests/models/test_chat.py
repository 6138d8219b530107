"""A model as a whole: cache, limits and failures together, over a real wire."""

from __future__ import annotations

from pathlib import Path

import pytest
from pydantic import ValidationError

from phyblock.config.models import ModelConfig
from phyblock.errors import UnavailableError
from phyblock.models import (
    Reply,
    ReplyCache,
)
from tests.models.factory import ask, make_model, make_request, reply_of
from tests.models.routes import KEY_VARIABLE, ROUTES
from tests.servers.chassis import Faults, Running

KEY = "sk-not-a-real-key-1234"


@pytest.fixture(autouse=True)
def _key(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(KEY_VARIABLE, KEY)


def test_what_was_answered_is_not_asked_again(tmp_path: Path) -> None:
    server = ROUTES["direct"].server()
    requests = [make_request(f"{n:03}", seed) for n in range(5) for seed in (1, 2)]
    with Running(server) as running, ReplyCache(tmp_path / "c.sqlite") as cache:
        config = ROUTES["direct"].config(running.url)
        first = ask(make_model(config, cache=cache), *requests)
        assert server.requests == 10
        second = ask(make_model(config, cache=cache), *requests)
    assert server.requests == 10
    for new, kept in zip(first, second, strict=True):
        assert isinstance(new, Reply)
        assert isinstance(kept, Reply)
        assert (new.cached, kept.cached) == (False, True)
        assert (new.attempts, kept.attempts) == (1, 0)
        assert (new.text, new.usage, new.latency_s) == (kept.text, kept.usage, kept.latency_s)


@pytest.mark.parametrize("mode", ["length", "filtered", "blank", "400", "policy", "500", "html"])
def test_what_is_no_whole_reply_is_asked_again(tmp_path: Path, mode: str) -> None:
    server = ROUTES["direct"].server(Faults(mode=mode))
    with Running(server) as running, ReplyCache(tmp_path / "c.sqlite") as cache:
        config = ROUTES["direct"].config(running.url)
        ask(make_model(config, cache=cache), make_request())
        before = server.requests
        ask(make_model(config, cache=cache), make_request())
        assert server.requests == 2 * before
        assert cache.stats().replies == 0


def test_a_missing_key_sends_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(KEY_VARIABLE)
    for name, route in ROUTES.items():
        server = route.server()
        with Running(server) as running:
            (answer,) = ask(make_model(route.config(running.url)), make_request())
        assert isinstance(answer, UnavailableError), name
        assert KEY_VARIABLE in str(answer)
        assert server.requests == 0


def test_no_key_reaches_the_cache_even_when_a_server_repeats_it(tmp_path: Path) -> None:
    class Parrot(ROUTES["direct"].server):  # type: ignore[misc, name-defined]
        def reply(self, seen, ending):  # type: ignore[no-untyped-def]
            body = super().reply(seen, ending)
            body["choices"][0]["message"]["content"] += f" {seen.key}"
            body["choices"][0]["message"]["reasoning_content"] += f" {seen.key}"
            return body

    with Running(Parrot()) as running, ReplyCache(tmp_path / "c.sqlite") as cache:
        reply = reply_of(
            make_model(ROUTES["direct"].config(running.url), cache=cache), make_request()
        )
        assert cache.stats().replies == 1
    assert KEY not in repr(reply)
    assert KEY.encode() not in b"".join(file.read_bytes() for file in tmp_path.iterdir())


def test_a_providers_key_never_goes_to_another(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XAI_API_KEY", KEY)
    with pytest.raises(ValidationError, match="needs the address"):
        ModelConfig(name="m", id="xai/grok", transport="direct")


@pytest.mark.parametrize(
    ("model_id", "api_base", "transport", "is_direct"),
    [
        ("openai/m", "http://x/v1", "auto", True),
        ("hosted_vllm/m", "http://x/v1", "auto", True),
        ("lm_studio/m", "http://x/v1", "auto", True),
        ("openai/m", None, "auto", False),
        ("openai/o1", "http://x/v1", "auto", False),
        ("openai/gpt-5-mini", "http://x/v1", "auto", False),
        ("anthropic/c", "http://x", "auto", False),
        ("anthropic/c", "http://x", "direct", True),
        ("openai/m", "http://x/v1", "litellm", False),
    ],
)
def test_the_transport_is_chosen_by_rule(
    model_id: str, api_base: str | None, transport: str, is_direct: bool
) -> None:
    config = ModelConfig(name="m", id=model_id, api_base=api_base, transport=transport)  # type: ignore[arg-type]
    assert config.is_direct == is_direct
