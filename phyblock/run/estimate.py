"""What a run would take: calls, tokens and dollars by model; nothing is called or rendered."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

from phyblock.models import Estimate as CallEstimate
from phyblock.models import (
    ModelConfig,
    Price,
    ReplyCache,
    Request,
    Usage,
    cost_usd,
    known_keys,
    most_usd,
    price_of,
)
from phyblock.models import estimate as estimate_call
from phyblock.records.reading import run_records
from phyblock.resources import reply_cache_file
from phyblock.run.models import PlannedModel
from phyblock.run.plan import RunPlan
from phyblock.run.samples import Sample
from phyblock.run.store import holds_run
from phyblock.tracks import AnyTrack, Item, shown_item
from phyblock.variants import Variant

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
    def may_cost(self) -> bool:
        """Whether money may be spent: calls are left, and not known to be free."""
        return self.calls > 0 and (self.cost_usd is None or self.cost_usd > 0)

    @property
    def most_usd(self) -> float | None:
        """Dollars if every reply were as long as it can be and no call had to be repeated."""
        if self.price is None:
            return None
        tokens = (self.prompt_tokens, self.completion_tokens, self.most_completion_tokens)
        return most_usd(self.price, CallEstimate(*tokens))


def estimate(plan: RunPlan, folder: Path, *, use_cache: bool) -> list[Estimate]:
    """Estimates in the order of the plan's models; StoreError for the folder of another run."""
    settled = _settled(plan, folder) if holds_run(folder, plan.manifest) else set()
    path = reply_cache_file()
    with ReplyCache(path) if use_cache and path.exists() else nullcontext() as cache:
        rows = [
            Estimate(m.name, m.config.kind, plan.samples_per_model, price_of(m.config))
            for m in plan.models
        ]
        for tracks, variants in _alike(plan):
            for track in tracks:
                for item in track.items:
                    for seeds, outlines in _outlines(track, item, plan.suite.seeds):
                        for model, row in zip(plan.models, rows, strict=True):
                            samples = [
                                Sample(track, model.name, item, seed, variant)
                                for seed in seeds
                                for variant in variants
                            ]
                            _add(row, model, samples, outlines, settled, cache)
    return rows


def _alike(plan: RunPlan) -> Iterator[tuple[Sequence[AnyTrack], Sequence[Variant]]]:
    """The ways of asking that send the same, with their tracks."""
    shown: dict[Variant, list[Variant]] = {}
    for variant in plan.variants:
        shown.setdefault(variant.shown, []).append(variant)
    yield from ((plan.variants[first], alike) for first, alike in shown.items())


def _outlines(
    track: AnyTrack, item: Item, seeds: Sequence[int]
) -> Iterator[tuple[Sequence[int], Sequence[tuple[Request, bool]]]]:
    """The outlines of an item, with the seeds that show it so."""
    shown = {seed: shown_item(track, item, seed) for seed in seeds}
    if alike := [seed for seed in seeds if shown[seed] is item]:
        yield alike, list(track.outlines(item))
    for seed in seeds:
        if seed not in alike:
            yield [seed], list(track.outlines(shown[seed]))


def _settled(plan: RunPlan, folder: Path) -> set[str]:
    """Samples whose newest record is final."""
    newest = {
        record.sample: record.is_final
        for _, record in run_records(folder, plan.manifest, plan.sample_ids())
    }
    return {sample for sample, is_final in newest.items() if is_final}


def _add(
    row: Estimate,
    model: PlannedModel,
    samples: Sequence[Sample],
    outlines: Sequence[tuple[Request, bool]],
    settled: set[str],
    cache: ReplyCache | None,
) -> None:
    """Count one item of one model, with seeds that show it alike."""
    config = model.config
    expected = []
    if config.kind == "litellm":
        asked = [(replace(outline, params=config.params), real) for outline, real in outlines]
        expected = [(request, real, estimate_call(config, request)) for request, real in asked]
    for sample in samples:
        if sample.id in settled:
            row.done += 1
            continue
        for request, is_real, tokens in expected:
            sent = sample.asking(replace(request, seed=sample.seed))
            if is_real and cache is not None and _is_kept(cache, config, sent):
                row.cached += 1
            else:
                row.calls += 1
                row.prompt_tokens += tokens.prompt_tokens
                row.completion_tokens += tokens.completion_tokens
                row.most_completion_tokens += tokens.most_completion_tokens


def _is_kept(cache: ReplyCache, config: ModelConfig, request: Request) -> bool:
    return any(key in cache for key in known_keys(config, request))
