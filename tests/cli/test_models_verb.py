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
