"""`phyblock models`: what is shown of each model."""

from __future__ import annotations

from tests.workspace import Workspace


def test_prices_are_shown_for_short_prompts_and_for_the_longest(workspace: Workspace) -> None:
    tiers = [{"above": n, "input": n / 1000, "output": 30} for n in (1000, 3000)]
    price = {"input": 0.5, "output": 30, "tiers": tiers}
    workspace.write_yaml("models.yaml", {
        "tiered": {"id": "openai/tiered", "price": price},
        "flat": {"id": "openai/flat", "price": {"input": 0.5, "output": 30}},
    })  # fmt: skip
    told = workspace.phyblock("models", env={"COLUMNS": "140"})
    rows = {line.split()[0]: line.split() for line in told.out.splitlines() if line.strip()}
    assert rows["tiered"][-4:] == ["0.5", "..", "3", "30"]
    assert rows["flat"][-2:] == ["0.5", "30"]
    assert "a .. b: a for short prompts, b for the longest" in told.out


def test_models_that_end_soon_or_are_gone_are_listed(workspace: Workspace) -> None:
    models = {
        "ending": "openai/o3-2025-04-16",
        "gone": "openai/gpt-3-vision",
        "current": "openai/gpt-5",
        "own": {"id": "hosted_vllm/x", "api_base": "http://localhost:1/v1"},
    }
    workspace.write_yaml("models.yaml", models)
    told = workspace.phyblock("models", "list", "--retiring")
    rows = {line.split()[0]: line.split()[2:] for line in told.out.splitlines() if "/" in line}
    assert rows == {"ending": ["2026-12-11"], "gone": ["not", "listed"]}
    assert workspace.phyblock("models", "--retiring").out == told.out
    assert workspace.phyblock("models", "list").out == workspace.phyblock("models").out
