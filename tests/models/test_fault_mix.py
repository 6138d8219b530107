"""Many picture samples against servers that fail as the issue says: all finish, none is doubled."""

from __future__ import annotations

from collections import Counter
from contextlib import ExitStack
from dataclasses import replace

import pytest

from phyblock.models import Reply, RetryPolicy
from tests.models.factory import QUICK, ask, make_model, make_request, picture, with_fields
from tests.models.routes import KEY_VARIABLE, ROUTES
from tests.servers.chassis import FAULTS, ISSUE_MIX, Running

SHOWN = {"openai", "direct"}


@pytest.fixture(autouse=True)
def _key(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(KEY_VARIABLE, "sk-not-a-real-key-1234")


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
