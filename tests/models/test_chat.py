"""A model as a whole: cache, limits and failures together, over a real wire."""

from __future__ import annotations

import subprocess
import sys
from collections import Counter
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import pytest

from phyblock.config.models import ModelConfig
from phyblock.errors import UnavailableError
from phyblock.models import (
    Reply,
    ReplyCache,
    RetryPolicy,
)
from tests.models.factory import (
    QUICK,
    ask,
    make_model,
    make_request,
    picture,
    reply_of,
    with_fields,
)
from tests.models.routes import KEY_VARIABLE, ROUTES
from tests.servers.chassis import FAULTS, ISSUE_MIX, Faults, Running

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


SHOWN = {"openai", "direct"}


def finish_all(
    route: str, samples: int, policy: RetryPolicy, size: int, *, replicas: int = 1
) -> None:
    servers = [ROUTES[route].server(replace(ISSUE_MIX, seed=seed)) for seed in range(replicas)]
    requests = [
        make_request(
            f"{n:04}",
            seed=n % 5,
            pictures=(picture(2 * n, size=size), picture(2 * n + 1, size=size)),
        )
        for n in range(samples)
    ]
    with ExitStack() as stack:
        urls = [stack.enter_context(Running(server)).url for server in servers]
        config = ROUTES[route].config(urls[0], max_concurrency=64, seed="never")
        bases = tuple(url + ROUTES[route].path for url in urls)
        config = with_fields(config, api_base=bases)
        answers = ask(make_model(config, policy=policy), *requests)
    replies = [answer for answer in answers if isinstance(answer, Reply)]
    assert len(replies) == samples, [a for a in answers if not isinstance(a, Reply)]
    ended: Counter[str] = sum((server.ended for server in servers), Counter())
    faults = sum(ended[name] for name in FAULTS)
    assert faults > 0.08 * samples
    assert ended["ok"] == samples
    assert sum(ended.values()) == samples + faults
    assert sum(reply.attempts for reply in replies) == sum(ended.values())
    answered = {seen.parts: seen.reply_text for server in servers for seen in server.seen}
    assert len(answered) == samples
    for request, reply in zip(requests, replies, strict=True):
        assert reply.text == answered[as_seen(request)]


def as_seen(request: object) -> tuple[object, ...]:
    """The parts as a server reports them: texts, and MIME type with hash of pictures."""
    parts = request.messages[1].parts  # type: ignore[attr-defined]
    return tuple(p if isinstance(p, str) else ("image/png", p.sha256) for p in parts)


@pytest.mark.parametrize("route", ROUTES)
def test_all_samples_finish_with_one_request_a_success_and_one_a_fault(route: str) -> None:
    finish_all(route, 300 if route in SHOWN else 120, QUICK, size=2_000)


def test_all_samples_finish_over_four_replicas() -> None:
    finish_all("direct", 300, QUICK, size=2_000, replicas=4)


ROOT = Path(__file__).parents[2]

CACHED = """
import asyncio, sys
from pathlib import Path
from phyblock.config.models import ModelConfig
from phyblock.models import Reply, ReplyCache
from phyblock.models import build_model, reply_key
from tests.models.factory import make_request
config = ModelConfig(name="m", id="anthropic/claude")
with ReplyCache(Path(sys.argv[1])) as cache:
    cache.put(reply_key(config, make_request()), config.id, Reply(text="kept"))
async def main():
    with ReplyCache(Path(sys.argv[1])) as cache:
        model = build_model(config, cache=cache)
        assert (await model.ask(make_request())).text == "kept"
        await model.aclose()
asyncio.run(main())
"""
IMPORTED = "\nprint([name for name in ('litellm', 'aiohttp', 'httpx') if name in sys.modules])"


def python(code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-W", "error", "-c", code, *arguments]
    environment = {"PYTHONPATH": str(ROOT), "PATH": ""}
    return subprocess.run(
        command, capture_output=True, text=True, check=True, cwd=ROOT, env=environment
    )


@pytest.mark.parametrize("code", ["import sys, phyblock.models", CACHED])
def test_no_client_is_imported_before_a_call_is_sent(tmp_path: Path, code: str) -> None:
    assert python(code + IMPORTED, str(tmp_path / "c.sqlite")).stdout == "[]\n"
