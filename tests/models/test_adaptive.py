"""`max_concurrency: auto` against real servers that bear little at once."""

from __future__ import annotations

import itertools
from contextlib import ExitStack

import pytest

from phyblock.models import Gate, ModelConfig, ModelEvent, Reply, RetryPolicy
from tests.models.factory import ask, make_model, make_request
from tests.models.routes import KEY_VARIABLE, ROUTES
from tests.servers.chassis import Faults, LocalServer, Running
from tests.servers.openai_chat import OpenAIChat
from tests.servers.strained import STRAINS, StrainedChat

CAP = 24
BEARS = 4
POLICY = RetryPolicy(base_s=0.01, max_wait_s=0.05, max_retry_after_s=0.05)


@pytest.fixture(autouse=True)
def _key(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(KEY_VARIABLE, "sk-not-a-real-key-1234")


def ask_adaptively(
    servers: list[LocalServer], calls: int, *, cap: int = CAP, timeout_s: float = 20.0
) -> list[ModelEvent]:
    """Ask so much that each server could have all it takes; every call must be answered."""
    events: list[ModelEvent] = []
    with ExitStack() as stack:
        urls = [stack.enter_context(Running(server)).url for server in servers]
        bases = tuple(url + ROUTES["direct"].path for url in urls)
        config = ModelConfig(
            "m", "litellm", "hosted_vllm/m", api_bases=bases, api_key_env=KEY_VARIABLE,
            max_concurrency=cap, adapts=True, timeout_s=timeout_s,
        )  # fmt: skip
        model = make_model(config, overall=Gate(cap), policy=POLICY, events=events)
        requests = [make_request(f"{n:04}") for n in range(calls)]
        replies = ask(model, *requests)
    assert [type(reply) for reply in replies] == [Reply] * calls
    return events


def widths(events: list[ModelEvent]) -> list[int]:
    """How many were allowed at once, one change after the other."""
    return [event.limit for event in events if event.kind == "concurrency"]


@pytest.mark.parametrize("strain", STRAINS)
def test_a_server_gets_more_until_it_shows_that_it_is_too_much(strain: str) -> None:
    server = StrainedChat(strain, BEARS, latency_s=0.02)
    timeout_s = 1.0 if strain == "hangs" else 20.0
    events = ask_adaptively([server], 200, timeout_s=timeout_s)
    found = widths(events)
    assert 1 <= min(found) <= max(found) <= CAP
    assert max(found) >= BEARS
    assert any(later < earlier for earlier, later in itertools.pairwise(found))
    # Those that hang at the server are given up by the one that asks.
    assert strain == "hangs" or server.most_at_once <= max(found)
    told = [event for event in events if event.kind == "slow_down"]
    assert (told == []) == (strain == "slows")
    if strain == "refuses":
        assert {event.status for event in told} == {429}
        assert server.ended["429"] <= 40


def test_a_server_that_stays_quick_gets_all_that_is_allowed_and_no_more() -> None:
    server = OpenAIChat(Faults(latency_s=0.05))
    assert max(widths(ask_adaptively([server], 300, cap=16))) == 16
    assert server.most_at_once == 16


def test_each_server_of_a_list_has_a_width_of_its_own() -> None:
    quick, strained = OpenAIChat(Faults(latency_s=0.02)), StrainedChat("refuses", 2, 0.02)
    ask_adaptively([strained, quick], 400)
    assert strained.most_at_once <= 8
    assert quick.most_at_once > 8
    assert quick.ended["ok"] > 2 * strained.ended["ok"]
    assert max(quick.most_at_once, strained.most_at_once) <= CAP
