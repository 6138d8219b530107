"""`phyblock models`: what is shown of each model, and the one call that `check` makes."""

from __future__ import annotations

import pytest

from tests.servers.chassis import Running
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import Workspace


def test_prices_are_shown_for_short_prompts_and_for_the_longest(workspace: Workspace) -> None:
    tiers = [{"above": n, "input": n / 1000, "output": 30} for n in (1000, 3000)]
    price = {"input": 0.5, "output": 30, "tiers": tiers}
    workspace.write_yaml("models.yaml", {
        "tiered": {"id": "openai/tiered", "price": price},
        "flat": {"id": "openai/flat", "price": {"input": 0.5, "output": 30}},
    })  # fmt: skip
    listed = workspace.phyblock("models", env={"COLUMNS": "80"})
    rows = {line.split()[0]: line.split() for line in listed.out.splitlines() if line.strip()}
    assert rows["tiered"][-4:] == ["0.5", "..", "3,", "30"]
    assert rows["flat"][-2:] == ["0.5,", "30"]
    assert max(map(len, listed.out.splitlines())) <= 80


def test_the_day_on_which_a_model_ends_is_shown(workspace: Workspace) -> None:
    models = {
        "ending": "openai/o3-2025-04-16",
        "current": "openai/gpt-5",
        "own": {"id": "hosted_vllm/x", "api_base": "http://localhost:1/v1"},
    }
    workspace.write_yaml("models.yaml", models)
    listed = workspace.phyblock("models")
    rows = {line.split()[0]: line for line in listed.out.splitlines() if "/" in line}
    assert {name for name, line in rows.items() if "2026-12-11" in line} == {"ending"}


def test_a_call_that_may_cost_is_made_only_where_somebody_agrees(workspace: Workspace) -> None:
    with Running(OpenAIChat()) as running:
        workspace.write_models(running.url, "dear", price={"input": 1.0, "output": 1.0})
        refused = workspace.phyblock("models", "check", "dear", env={"CI": "1"})
        assert (refused.code, running.server.requests) == (2, 0)
        assert "would cost money, and there is no terminal to ask on" in refused.err
        assert workspace.phyblock("models", "check", "dear", "--yes").code == 0
        assert running.server.requests == 1
        workspace.write_models(running.url, "free", price={"input": 0.0, "output": 0.0})
        assert workspace.phyblock("models", "check", "free").code == 0
        assert running.server.requests == 2


@pytest.mark.parametrize("names", ["", ",", "oracle,,random"])
def test_an_empty_name_does_not_mean_all_models(workspace: Workspace, names: str) -> None:
    workspace.write_suite(models=["oracle", "random"])
    done = workspace.run("--models", names)
    assert done.code == 2
    assert "holds an empty name" in done.err
    assert not workspace.out.exists()
