"""max_cost_usd: reached, never passed, and raised to go on."""

from __future__ import annotations

import json
import re
from typing import Any

import pytest

from tests.servers.chassis import Faults, Running, Seen
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import Workspace

PRICE = {"input": 10.0, "output": 100.0}
CALL_USD = 1000 * PRICE["input"] / 1e6 + 40 * PRICE["output"] / 1e6
"""The server counts 1,000 tokens in and 40 out for every call."""
MOST_USD = 0.505
"""Room for 35 calls, and for no 36th, be it as estimated at first or as the run learns to."""
TWICE = {"max_attempts": 2, "retry_for_s": 0.0}
"""Limits of a run that gives up soon, however little time it took."""


class Silent(OpenAIChat):
    """Does not say how many tokens it counted."""

    def reply(self, seen: Seen, ending: str) -> dict[str, Any]:
        return {**super().reply(seen, ending), "usage": None}


def spent(workspace: Workspace) -> float:
    return sum(record["reply"]["cost_usd"] for record in workspace.records())


def test_the_limit_is_not_passed_and_a_higher_one_goes_on(workspace: Workspace) -> None:
    with Running(OpenAIChat()) as running:
        server = running.server
        workspace.write_models(running.url, "alpha", price=PRICE, max_tokens=100)
        workspace.write_suite(models=["alpha"], seeds=list(range(12)))
        first = workspace.run("--set", f"limits.max_cost_usd={MOST_USD}")
        assert (first.code, first.err) == (1, "")
        assert f"max_cost_usd {MOST_USD} is reached" in first.out
        assert "give the same command again" in first.out
        assert spent(workspace) == pytest.approx(CALL_USD * server.requests)
        # It stops no earlier than it must: another two calls at their dearest would pass it.
        assert MOST_USD - 2 * (CALL_USD + 100 * PRICE["output"] / 1e6) < spent(workspace)
        assert spent(workspace) <= MOST_USD

        asked = server.requests
        same = workspace.run("--set", f"limits.max_cost_usd={MOST_USD}")
        assert same.code == 1
        assert server.requests == asked

        more = workspace.run("--set", "limits.max_cost_usd=5")
        assert (more.code, more.err) == (0, "")
        assert "All 60 samples are done" in more.out
        assert server.requests == 60


class Counting(OpenAIChat):
    """Counts as many tokens as it likes."""

    def __init__(self, prompt: int, completion: int) -> None:
        super().__init__()
        self.usage = {"prompt_tokens": prompt, "completion_tokens": completion}

    def reply(self, seen: Seen, ending: str) -> dict[str, Any]:
        return {**super().reply(seen, ending), "usage": self.usage}


@pytest.mark.parametrize(("prompt", "completion"), [(40_000, 40), (1000, 2500)])
def test_a_server_that_counts_more_than_is_expected_does_not_pass_the_limit_at_once(
    workspace: Workspace, prompt: int, completion: int
) -> None:
    usd = (prompt * PRICE["input"] + completion * PRICE["output"]) / 1e6
    with Running(Counting(prompt, completion)) as running:
        workspace.write_models(running.url, "alpha", price=PRICE, max_tokens=100)
        workspace.write_suite(models=["alpha"], seeds=list(range(12)))
        done = workspace.run("--set", f"limits.max_cost_usd={5 * usd}")
    assert done.code == 1
    assert f"the next call can cost {usd:.1f}"[:-2] in done.out
    assert 1 < running.server.requests <= 5
    assert spent(workspace) <= 5 * usd


def test_a_model_is_asked_no_more_when_its_own_limit_is_reached(workspace: Workspace) -> None:
    with Running(OpenAIChat()) as running:
        workspace.write_yaml("models.yaml", {
            name: {"id": f"openai/{name}", "api_base": f"{running.url}/v1", "price": PRICE,
                   "max_tokens": 100, "max_cost_usd": limit}
            for name, limit in (("alpha", 3.2 * CALL_USD), ("beta", None))
        })  # fmt: skip
        workspace.write_suite(models=["alpha", "beta"])
        done = workspace.run("--yes")
        assert (done.code, "alpha was stopped: its max_cost_usd" in done.out) == (1, True)
        asked = running.server.requests
        assert 6 <= asked <= 8
        workspace.run("--yes")
        assert running.server.requests == asked
    assert sum(record["model"] == "beta" for record in workspace.records()) == 5


def test_nothing_is_asked_where_not_even_one_call_fits(workspace: Workspace) -> None:
    with Running(OpenAIChat()) as running:
        workspace.write_models(running.url, "alpha", price=PRICE)
        workspace.write_suite(models=["alpha", "random"])
        done = workspace.run("--set", "limits.max_cost_usd=0")
        assert done.code == 1
        assert "max_cost_usd 0 is reached" in done.out
        assert running.server.requests == 0


def test_a_dry_run_says_what_it_would_cost_and_asks_nothing(workspace: Workspace) -> None:
    with Running(OpenAIChat()) as running:
        workspace.write_models(running.url, "alpha", price=PRICE, max_tokens=9000)
        workspace.write_suite(models=["alpha", "random"], seeds=[0, 1])
        before = workspace.files()
        done = workspace.run("--dry-run")
        assert done.code == 0
        assert "10 calls, about $" in done.out
        usual, most = re.findall(r"\$([\d.]+)", done.out)[:2]
        assert 10 * 4000 * PRICE["output"] / 1e6 < float(usual) < 5
        assert 10 * 9000 * PRICE["output"] / 1e6 < float(most) < 10
        assert running.server.requests == 0
        assert workspace.files() == before

        assert workspace.run("--yes").code == 0
        after = workspace.run("--dry-run")
        assert "0 calls, about $0.00" in after.out


@pytest.mark.parametrize(
    "server",
    [Silent(), OpenAIChat(Faults(mode="html")), OpenAIChat(Faults(mode="reset"))],
    ids=["no usage", "no reply", "no answer"],
)
def test_what_an_earlier_run_may_have_paid_counts_in_the_next(
    workspace: Workspace, server: OpenAIChat
) -> None:
    dearest_reply_usd = 1000 * PRICE["output"] / 1e6
    with Running(server) as running:
        workspace.write_models(running.url, "alpha", price=PRICE, max_tokens=1000)
        workspace.write_suite(models=["alpha"], seeds=list(range(4)), limits=TWICE)
        codes = [workspace.run("--set", "limits.max_cost_usd=1").code for _ in range(3)]
    assert codes == [1, 1, 1]
    assert 2 <= server.requests <= 1 / dearest_reply_usd
    lines = (workspace.out / "calls.jsonl").read_text().splitlines()
    billed_usd = sum(json.loads(line).get("billed_usd") or 0.0 for line in lines)
    assert server.requests * dearest_reply_usd < billed_usd <= 1


def test_an_attempt_that_was_billed_counts_though_the_next_does_not_fit(
    workspace: Workspace,
) -> None:
    with Running(OpenAIChat(Faults(mode="html"))) as running:
        server = running.server
        workspace.write_models(running.url, "alpha", price=PRICE, max_tokens=1000)
        workspace.write_suite(models=["alpha"], limits={"max_concurrency": 1})
        for _ in range(2):
            assert workspace.run("--set", "limits.max_cost_usd=0.15").code == 1
    assert server.requests == 1


def test_a_run_without_a_limit_counts_once_there_is_one(workspace: Workspace) -> None:
    with Running(OpenAIChat(Faults(server_error=0.5))) as running:
        workspace.write_models(running.url, "alpha", price=PRICE, max_tokens=100)
        workspace.write_suite(
            models=["alpha"], seeds=[0, 1, 2, 3], limits={**TWICE, "max_attempts": 1}
        )
        assert workspace.run("--yes").code == 1
        asked, answered = running.server.requests, running.server.ended["ok"]
        assert 0 < answered < asked == 20
        same = workspace.run("--set", f"limits.max_cost_usd={answered * CALL_USD}")
        assert same.code == 1
        assert running.server.requests == asked
