"""What a run would take: calls, tokens and dollars by model; nothing is called or rendered."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from phyblock.models import ReplyCache, estimate_call, price_of, reply_key
from phyblock.resources import reply_cache_file
from phyblock.run.models import PlannedModel
from phyblock.run.plan import RunPlan, sample_id
from phyblock.run.records import is_final
from phyblock.run.store import MANIFEST, read_records

__all__ = ["Estimate", "estimate"]


@dataclass(frozen=True)
class Estimate:
    """What one model would take; `cost_usd` is None where the price is not known.

    `done` samples have a record in the folder, `cached` ones a reply in the cache, `calls` are
    left to make (none for recordings and baselines, which answer here).
    """

    model: str
    kind: str
    samples: int
    done: int
    cached: int
    calls: int
    prompt_tokens: int
    completion_tokens: int
    cost_usd: float | None


def estimate(plan: RunPlan, folder: Path, *, use_cache: bool) -> list[Estimate]:
    """Estimates in the order of the plan's models."""
    earlier = read_records(folder) if (folder / MANIFEST).exists() else {}
    path = reply_cache_file()
    if not use_cache or not path.exists():
        return [_estimate(plan, model, earlier, None) for model in plan.models]
    with ReplyCache(path) as cache:
        return [_estimate(plan, model, earlier, cache) for model in plan.models]


def _estimate(
    plan: RunPlan,
    model: PlannedModel,
    earlier: Mapping[str, Mapping[str, Any]],
    cache: ReplyCache | None,
) -> Estimate:
    config = model.config
    done = cached = calls = prompt = completion = 0
    for seed in plan.suite.seeds:
        for task in plan.dataset.tasks:
            record = earlier.get(sample_id(plan.track.name, model.name, task.scene.id, seed))
            if record is not None and is_final(record):
                done += 1
            elif config.kind == "litellm":
                request, real = plan.track.outline(task, seed, config.params)
                if cache is not None and real and reply_key(config, request) in cache:
                    cached += 1
                    continue
                calls += 1
                expected = estimate_call(config, request)
                prompt += expected.prompt_tokens
                completion += expected.completion_tokens
    price = price_of(config)
    cost = (
        None
        if price is None
        else (prompt * price.input_usd + completion * price.output_usd) / 1_000_000
    )
    return Estimate(
        model.name,
        config.kind,
        plan.samples_per_model,
        done,
        cached,
        calls,
        prompt,
        completion,
        cost,
    )
