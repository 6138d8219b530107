"""What a run would take: calls, tokens and dollars by model; nothing is called or rendered."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

from phyblock.models import Estimate as CallEstimate
from phyblock.models import (
    Price,
    ReplyCache,
    Request,
    Usage,
    cost_usd,
    most_usd,
    price_of,
    reply_key,
)
from phyblock.models import estimate as estimate_call
from phyblock.resources import reply_cache_file
from phyblock.run.models import PlannedModel
from phyblock.run.plan import RunPlan, sample_id
from phyblock.run.reading import read_records
from phyblock.run.records import is_final
from phyblock.run.store import holds_run

__all__ = ["Estimate", "estimate"]


@dataclass
class Estimate:
    """What one model would take; dollars are None where the price is not known.

    `done` samples have a record in the folder, `cached` ones a reply in the cache, `calls` are
    left to make (none for recordings and baselines, which answer here).
    """

    model: str
    kind: str
    samples: int
    price: Price | None
    done: int = 0
    cached: int = 0
    calls: int = 0
    prompt_tokens: int = 0
    completion_tokens: int = 0
    most_completion_tokens: int = 0

    @property
    def cost_usd(self) -> float | None:
        """Dollars of the calls, at the price of today."""
        return cost_usd(self.price, Usage(self.prompt_tokens, self.completion_tokens))

    @property
    def most_usd(self) -> float | None:
        """Dollars if every reply were as long as it can be and no call had to be repeated."""
        if self.price is None:
            return None
        tokens = (self.prompt_tokens, self.completion_tokens, self.most_completion_tokens)
        return most_usd(self.price, CallEstimate(*tokens))


def estimate(plan: RunPlan, folder: Path, *, use_cache: bool) -> list[Estimate]:
    """Estimates in the order of the plan's models; StoreError for the folder of another run."""
    earlier = read_records(folder) if holds_run(folder, plan.manifest) else {}
    settled = {sample for sample, record in earlier.items() if is_final(record)}
    path = reply_cache_file()
    with ReplyCache(path) if use_cache and path.exists() else nullcontext() as cache:
        rows = [
            Estimate(m.name, m.config.kind, plan.samples_per_model, price_of(m.config))
            for m in plan.models
        ]
        for task in plan.dataset.tasks:
            outline, real = plan.track.outline(task)
            for model, row in zip(plan.models, rows, strict=True):
                _add(row, plan, model, outline, settled, cache if real else None)
    return rows


def _add(
    row: Estimate,
    plan: RunPlan,
    model: PlannedModel,
    outline: Request,
    settled: set[str],
    cache: ReplyCache | None,
) -> None:
    """Count one scene of one model, all its seeds."""
    config = model.config
    request = replace(outline, params=config.params)
    expected = estimate_call(config, request) if config.kind == "litellm" else None
    for seed in plan.suite.seeds:
        if sample_id(plan.track.name, model.name, request.key, seed) in settled:
            row.done += 1
        elif expected is None:
            continue
        elif cache is not None and reply_key(config, replace(request, seed=seed)) in cache:
            row.cached += 1
        else:
            row.calls += 1
            row.prompt_tokens += expected.prompt_tokens
            row.completion_tokens += expected.completion_tokens
            row.most_completion_tokens += expected.most_completion_tokens
