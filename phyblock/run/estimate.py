"""Estimates of a run: calls, tokens and dollars by model; nothing is called or rendered."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

from phyblock.config.models import ModelConfig, Tariff
from phyblock.files import reply_cache_file
from phyblock.models.cache import ReplyCache, reply_key
from phyblock.models.costs import Estimate as CallEstimate
from phyblock.models.costs import estimate as estimate_call
from phyblock.models.costs import is_billed, is_free, most_usd, price_at, tariff_of
from phyblock.models.request import Request
from phyblock.records.files import BatchLines, run_records
from phyblock.run.plan import RunPlan, Sample
from phyblock.run.store import held_run


@dataclass
class Estimate:
    """The estimate of one model; dollars are None where no price is known.

    `done` samples have a record in the folder, `cached` ones a reply in the cache, `waiting` ones
    are in batches, `calls` are still to be made: none for recordings and baselines, which answer
    locally.
    """

    model: ModelConfig
    samples: int
    tariff: Tariff | None
    done: int = 0
    cached: int = 0
    waiting: int = 0
    calls: int = 0
    prompt_tokens: int = 0
    reply_tokens: int = 0
    _cost_usd: float = 0.0
    _most_usd: float = 0.0

    def add_call(self, expected: CallEstimate) -> None:
        """Count one call to be made, with a reply of typical length."""
        self.calls += 1
        prompt, reply = expected.prompt_tokens, expected.completion_tokens
        self.prompt_tokens += prompt
        self.reply_tokens += reply
        if self.tariff is not None:
            batched, most = self.model.batch, expected.most_completion_tokens
            price = price_at(self.tariff, batched=batched)
            self._cost_usd += (prompt * price.input + reply * price.output) / 1_000_000
            self._most_usd += most_usd(self.tariff, prompt, most, batched=batched)

    @property
    def cost_usd(self) -> float | None:
        """Dollars for the calls."""
        return None if self.tariff is None else self._cost_usd

    @property
    def most_usd(self) -> float | None:
        """Dollars if every reply had the maximum length and no call had to be repeated."""
        return None if self.tariff is None else self._most_usd

    @property
    def may_cost(self) -> bool:
        """True if there are calls to make that are not known to be free."""
        is_priced = self.tariff is None or not is_free(self.tariff)
        return self.calls > 0 and is_priced and is_billed(self.model)


def estimate(
    plan: RunPlan, folder: Path, *, use_cache: bool, retry_failed: bool = False
) -> list[Estimate]:
    """Return estimates in the order of the plan's models.

    With `retry_failed`, rejected requests count as calls. Raises StoreError for the folder of
    another run.
    """
    rows = {m.name: Estimate(m, plan.samples_per_model, tariff_of(m)) for m in plan.models}
    settled: dict[str, bool] = {}
    waiting: set[str] = set()
    if held_run(folder, plan.manifest) is not None:
        for _, record in run_records(folder, plan.manifest, plan.sample_ids()):
            settled[record.sample] = record.is_answered if retry_failed else record.is_final
        if lines := tuple(line for _, line in BatchLines(folder)):
            from phyblock.models.batch import under_way

            batches = [one for m in plan.models if m.batch for one in under_way(lines, m.name)]
            waiting = {key for one in batches for key in one.most_usd}
    path = reply_cache_file()
    with ReplyCache(path) if use_cache and path.exists() else nullcontext() as cache:
        for sample, outlines in _samples(plan):
            row = rows[sample.model]
            if settled.get(sample.id):
                row.done += 1
                continue
            for outline in outlines if row.model.kind == "litellm" else ():
                # A picture that is not known yet is empty.
                is_known = all(picture.data for picture in outline.images)
                asked = replace(outline, seed=sample.sent_seed, params=row.model.params)
                key = reply_key(row.model, asked) if is_known else ""
                if cache is not None and is_known and cache.get(key) is not None:
                    row.cached += 1
                elif key in waiting:
                    row.waiting += 1
                else:
                    row.add_call(estimate_call(row.model, asked))
    return list(rows.values())


def may_bill(
    plan: RunPlan, folder: Path, *, use_cache: bool, retry_failed: bool = False
) -> list[Estimate]:
    """Return the estimates of a plan if any of its models may cost money, else none."""
    if not any(is_billed(model) for model in plan.models):
        return []
    rows = estimate(plan, folder, use_cache=use_cache, retry_failed=retry_failed)
    return rows if any(row.may_cost for row in rows) else []


def _samples(plan: RunPlan) -> Iterator[tuple[Sample, Sequence[Request]]]:
    """Yield all samples with their requests as far as they are known before any reply.

    Requests that are presented identically are outlined once.
    """
    for shown_in, tracks in plan.variants.items():
        repeats = [variant for variant in plan.variants if variant.shown == shown_in]
        asked = [(track, item) for track in tracks for item in track.items]
        for track, item in asked if repeats else ():
            plain = None
            for seed in plan.suite.seeds:
                shown = track.shown(item, seed)
                if shown is item:
                    outlines = plain = plain or list(track.outlines(item))
                else:
                    outlines = list(track.outlines(shown))
                for variant, model in product(repeats, plan.models):
                    yield Sample(track, model.name, item, seed, variant), outlines
