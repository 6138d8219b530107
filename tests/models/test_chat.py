"""A model as a whole: cache, limits and failures together, over a real wire."""

from __future__ import annotations

import sqlite3
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


def test_seeds_are_kept_apart_also_where_the_provider_takes_none(tmp_path: Path) -> None:
    server = ROUTES["direct"].server(Faults(mode="seed"))
    requests = [make_request("001", seed) for seed in range(5)]
    with Running(server) as running, ReplyCache(tmp_path / "c.sqlite") as cache:
        config = ROUTES["direct"].config(running.url, max_concurrency=1)
        ask(make_model(config, cache=cache), *requests)
        assert cache.stats().replies == 5
        again = ask(make_model(config, cache=cache), *requests)
    assert server.ended == {"seed": 1, "ok": 5}
    assert [reply.seed_sent for reply in again] == [False] * 5  # type: ignore[union-attr]


def refuse_after(path: Path, replies: int) -> None:
    """Make a cache that takes so many replies and not one more."""
    ReplyCache(path).close()
    db = sqlite3.connect(path)
    db.execute(
        f"CREATE TRIGGER full BEFORE INSERT ON replies WHEN (SELECT count(*) FROM replies) >= "
        f"{replies} BEGIN SELECT RAISE(ABORT, 'the disk is full'); END"
    )
    db.close()


def test_a_cache_that_takes_no_more_is_said_once_and_every_reply_comes(tmp_path: Path) -> None:
    refuse_after(tmp_path / "c.sqlite", 3)
    said: list[str] = []
    server = ROUTES["direct"].server(Faults(latency_s=0.01))
    requests = [make_request(f"{n:03}") for n in range(20)]
    with Running(server) as running:
        config = ROUTES["direct"].config(running.url, max_concurrency=4)
        with ReplyCache(tmp_path / "c.sqlite", said.append) as cache:
            answers = ask(make_model(config, cache=cache), *requests)
    assert {type(answer) for answer in answers} == {Reply}
    assert server.ended == {"ok": 20}
    (text,) = said
    assert "the disk is full" in text
    assert str(tmp_path / "c.sqlite") in text


def test_a_dead_model_still_gives_what_is_cached(tmp_path: Path) -> None:
    server = ROUTES["direct"].server()
    with Running(server) as running, ReplyCache(tmp_path / "c.sqlite") as cache:
        config = ROUTES["direct"].config(running.url, max_concurrency=1)
        reply_of(make_model(config, cache=cache), make_request("001"))
        server.faults = Faults(mode="401")
        answers = ask(make_model(config, cache=cache), *(make_request(k) for k in ("002", "001")))
    assert isinstance(answers[0], UnavailableError)
    assert isinstance(answers[1], Reply)


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
