"""The table of `--dry-run`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rich.console import Console

from phyblock.cli.console import print_view
from phyblock.models import Price
from phyblock.report import NO_VALUE, Column, TextTable
from phyblock.run.estimate import Estimate
from phyblock.run.plan import RunPlan
from phyblock.text import counted
from phyblock.tracks import kind_of

__all__ = ["show_estimate"]

_HEADINGS = (
    *("model", "kind", "samples", "done", "cached", "calls"),
    *("tokens in", "tokens out", "cost", "at most"),
)
_TEXTS = ("model", "kind")


def show_estimate(console: Console, plan: RunPlan, rows: Sequence[Estimate]) -> None:
    """Print what each model would take, and the sum."""
    items = [counted(len(track.items), kind_of(track.name).item) for track in plan.tracks]
    caption = (
        f"{plan.suite.name}: {', '.join(items)} of {plan.dataset.name}, "
        f"{counted(len(plan.suite.seeds), 'seed')}{_ways(plan)}{_shots(plan)}, "
        f"{counted(len(plan.models), 'model')}"
    )
    cells = tuple(
        (
            row.model,
            "batch" if row.batch else row.kind,
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
    left = [row for row in rows if row.calls]
    for text in (_sum(left), *_prices(left)):
        console.print(text, soft_wrap=True, markup=False)
    for row in rows:
        if row.waiting:
            asked = f"{counted(row.waiting, 'call')} of {row.model} went out in batches before."
            console.print(asked, soft_wrap=True, markup=False)
    if any(row.batch for row in left):
        text = "batch: answers come within a day, at the price of batches; no call is sent twice."
        console.print(text, style="dim", soft_wrap=True)
    if left:
        console.print(
            f"Tokens are estimates: texts by their words, pictures by their providers' rules, "
            f"{_replies(left)}; at most: each as long as it can be.",
            style="dim",
            soft_wrap=True,
        )


def _sum(rows: Sequence[Estimate]) -> str:
    known = [row for row in rows if row.cost_usd is not None]
    costs = []
    if known or not rows:
        prompts, replies = (
            _dollars(sum(usd or 0.0 for usd in part))
            for part in ([row.prompt_usd for row in known], [row.reply_usd for row in known])
        )
        whole = _dollars(sum(row.cost_usd or 0.0 for row in known))
        parts = f" (prompts {prompts}, replies {replies})" if known else ""
        costs = [f"about {whole}{parts}"]
    if unknown := len(rows) - len(known):
        costs.append(f"unknown cost of {counted(unknown, 'model')} (give a price in models.yaml)")
    return f"{counted(sum(row.calls for row in rows), 'call')}, {' and '.join(costs)}."


def _prices(rows: Sequence[Estimate]) -> Iterator[str]:
    """Where prices are from, and which will be others within days."""
    by_source: dict[str, list[str]] = {}
    for row in rows:
        if row.tariff is not None and row.tariff.source:
            by_source.setdefault(row.tariff.source, []).append(row.model)
    if by_source:
        sources = [f"{source} ({', '.join(models)})" for source, models in by_source.items()]
        yield f"Prices of {rows[0].day}: {'; '.join(sources)}."
    for row in rows:
        coming = row.next_tariff
        if coming is not None and row.tariff is not None:
            now, then = (_a_million(tariff.at(0)) for tariff in (row.tariff, coming))
            yield f"From {coming.since} on {row.model} costs {then} in place of {now}."


def _a_million(price: Price) -> str:
    return f"${price.input_usd:g} in and ${price.output_usd:g} out per million tokens"


def _replies(rows: Sequence[Estimate]) -> str:
    """How long replies are taken to be."""
    measured, usual = [], False
    for row in rows:
        for kind, lengths in row.lengths.items():
            if not lengths.has_calls:
                continue
            if lengths.mean is None:
                usual = True
                continue
            asked = f" in {kind}" if len(row.lengths) > 1 else ""
            mean = f"{lengths.mean:,.0f} tokens (the mean of {lengths.replies:,})"
            measured.append(f"of {row.model}{asked} {mean}")
    return f"replies {', '.join((*measured, *['of usual length'] * usual))}"


def _ways(plan: RunPlan) -> str:
    """How many ways of asking there are, where there are several."""
    n = len(plan.variants)
    return f", {n:,} ways of asking" if n > 1 else ""


def _shots(plan: RunPlan) -> str:
    """How many worked examples stand before a question, where there are any."""
    wanted = [plan.suite.at(variant).examples for variant in plan.variants]
    numbers = sorted({n if isinstance(n, int) else len(n) for n in wanted})
    if numbers == [0]:
        return ""
    *fewer, most = numbers
    words = " or ".join((*map(str, fewer), counted(most, "worked example")))
    return f", {words} before each question"


def _dollars(cost_usd: float | None) -> str:
    if cost_usd is None:
        return "unknown"
    return f"${cost_usd:,.4f}" if 0 < cost_usd < 0.01 else f"${cost_usd:,.2f}"
