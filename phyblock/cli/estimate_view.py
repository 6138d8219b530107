"""The table of `--dry-run`."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console

from phyblock.cli.console import print_view
from phyblock.report import NO_VALUE, Column, TextTable
from phyblock.run.estimate import Estimate
from phyblock.run.plan import RunPlan
from phyblock.tracks import kind_of

__all__ = ["show_estimate"]

_HEADINGS = (
    *("model", "kind", "samples", "done", "cached", "calls"),
    *("tokens in", "tokens out", "cost", "at most"),
)
_TEXTS = ("model", "kind")


def show_estimate(console: Console, plan: RunPlan, rows: Sequence[Estimate]) -> None:
    """Print what each model would take, and the sum."""
    items = [_counted(len(track.items), kind_of(track.name).item) for track in plan.tracks]
    caption = (
        f"{plan.suite.name}: {', '.join(items)} of {plan.dataset.name}, "
        f"{_counted(len(plan.suite.seeds), 'seed')}{_ways(plan)}, "
        f"{_counted(len(plan.models), 'model')}"
    )
    cells = tuple(
        (
            row.model,
            row.kind,
            f"{row.samples:,}",
            f"{row.done:,}",
            f"{row.cached:,}",
            f"{row.calls:,}" if row.kind == "litellm" else NO_VALUE,
            f"{row.prompt_tokens:,}",
            f"{row.completion_tokens:,}",
            _dollars(row.cost_usd) if row.calls else NO_VALUE,
            _dollars(row.most_usd) if row.calls else NO_VALUE,
        )
        for row in rows
    )
    columns = tuple(Column(name, is_text=name in _TEXTS) for name in _HEADINGS)
    print_view(console, TextTable(caption, columns, cells))
    calls = sum(row.calls for row in rows)
    known = sum(row.cost_usd or 0.0 for row in rows)
    unknown = [row.model for row in rows if row.calls and row.cost_usd is None]
    priced = len(unknown) < sum(row.calls > 0 for row in rows) or not unknown
    costs = [f"about {_dollars(known)}"] if priced else []
    if unknown:
        costs.append(
            f"unknown cost of {_counted(len(unknown), 'model')} (give a price in models.yaml)"
        )
    text = f"{_counted(calls, 'call')}, {' and '.join(costs)}."
    console.print(text, soft_wrap=True, markup=False)
    if calls:
        console.print(
            "Tokens are estimates: 4 characters a token, pictures by their providers' rules, "
            "replies of usual length; at most: each as long as it can be.",
            style="dim",
            soft_wrap=True,
        )


def _ways(plan: RunPlan) -> str:
    """How many ways of asking there are, where there are several."""
    n = len(plan.variants)
    return f", {n:,} ways of asking" if n > 1 else ""


def _counted(number: int, word: str) -> str:
    return f"{number:,} {word}{'' if number == 1 else 's'}"


def _dollars(cost_usd: float | None) -> str:
    if cost_usd is None:
        return "unknown"
    return f"${cost_usd:,.4f}" if 0 < cost_usd < 0.01 else f"${cost_usd:,.2f}"
