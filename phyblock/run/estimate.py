"""Estimates of a run: calls, tokens and dollars by model; nothing is called or rendered."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path

from phyblock.config.models import ModelConfig, Tariff
from phyblock.config.suite import Variant
from phyblock.errors import Problem, SpecError
from phyblock.models import Estimate as CallEstimate
from phyblock.models import ReplyCache, Request, is_billed, reply_key, tariff_of, waiting_keys
from phyblock.models import estimate as estimate_call
from phyblock.models.costs import is_free, most_usd, price_at, price_source
from phyblock.records.files import BatchLines, run_records
from phyblock.resources import reply_cache_file
from phyblock.run.plan import RunPlan, Sample
from phyblock.run.store import held_run
from phyblock.tracks import AnyTrack, Item

_ENOUGH_REPLIES = 20
"""Replies whose mean length stands for those to come."""


@dataclass
class ReplyLengths:
    """Tokens of replies to questions of one kind: `replies` that are there already and tell them,
    `tokens` in all, and those to come.

    `coming` counts calls by the length of a usual reply, the longest possible, and dollars a token.
    """

    replies: int = 0
    tokens: int = 0
    coming: Counter[tuple[int, int, float]] = field(default_factory=Counter)

    @property
    def mean(self) -> float | None:
        """Tokens of a reply, where enough are there to tell; else a usual length is taken."""
        return self.tokens / self.replies if self.replies >= _ENOUGH_REPLIES else None

    def expected(self) -> tuple[float, float]:
        """Return tokens and dollars of the replies to come, none longer than it can be."""
        mean, all_tokens, all_usd = self.mean, 0.0, 0.0
        for (usual, most, usd), calls in self.coming.items():
            length = usual if mean is None else min(mean, most)
            all_tokens += length * calls
            all_usd += length * usd * calls
        return all_tokens, all_usd


@dataclass
class Estimate:
    """The estimate of one model; dollars are None where no price is known.

    `done` samples have a record in the folder, `cached` ones a reply in the cache, `waiting` ones
    went out in batches, `calls` are left to make (none for recordings and baselines, which answer
    here); with `batch` they go out in batches, at the price of these. `lengths` are those of
    replies by the kind of question, which is a track, and its way of asking where there are
    several.
    """

    model: str
    kind: str
    samples: int
    tariff: Tariff | None
    price_source: str = ""
    batch: bool = False
    done: int = 0
    cached: int = 0
    waiting: int = 0
    calls: int = 0
    prompt_tokens: int = 0
    lengths: defaultdict[str, ReplyLengths] = field(
        default_factory=lambda: defaultdict(ReplyLengths)
    )
    _prompt_usd: float = 0.0
    _most_usd: float = 0.0

    def add_call(self, expected: CallEstimate, kind: str) -> None:
        """Count one call that is left to make, of a kind of question."""
        self.calls += 1
        self.prompt_tokens += expected.prompt_tokens
        usual, most, reply_usd = expected.completion_tokens, expected.most_completion_tokens, 0.0
        if self.tariff is not None:
            prompt = expected.prompt_tokens
            price = price_at(self.tariff, prompt, batched=self.batch)
            reply_usd = price.output / 1_000_000
            self._prompt_usd += prompt * price.input / 1_000_000
            self._most_usd += most_usd(self.tariff, prompt, most, batched=self.batch)
        self.lengths[kind].coming[usual, most, reply_usd] += 1

    def add_reply(self, completion_tokens: int | None, kind: str) -> None:
        """Learn from a reply that is there, to a kind of question."""
        if completion_tokens is not None:
            self.lengths[kind].replies += 1
            self.lengths[kind].tokens += completion_tokens

    @property
    def completion_tokens(self) -> int:
        """Tokens of the replies to come."""
        return round(sum(lengths.expected()[0] for lengths in self.lengths.values()))

    @property
    def prompt_usd(self) -> float | None:
        """Dollars of the prompts alone."""
        return None if self.tariff is None else self._prompt_usd

    @property
    def reply_usd(self) -> float | None:
        """Dollars of the replies alone."""
        usd = sum(lengths.expected()[1] for lengths in self.lengths.values())
        return None if self.tariff is None else usd

    @property
    def cost_usd(self) -> float | None:
        """Dollars of the calls."""
        if self.prompt_usd is None or self.reply_usd is None:
            return None
        return self.prompt_usd + self.reply_usd

    @property
    def may_cost(self) -> bool:
        """True if money may be spent: calls are left, and not known to be free."""
        return self.calls > 0 and (self.tariff is None or not is_free(self.tariff))

    @property
    def most_usd(self) -> float | None:
        """Dollars if every reply were as long as it can be and no call had to be repeated."""
        return None if self.tariff is None else self._most_usd


def estimate(
    plan: RunPlan, folder: Path, *, use_cache: bool, retry_failed: bool = False
) -> list[Estimate]:
    """Estimates in the order of the plan's models; with `retry_failed` samples whose request was
    rejected are asked again.

    Raises StoreError for the folder of another run.
    """
    rows = {
        m.name: Estimate(
            m.name, m.kind, plan.samples_per_model, tariff_of(m), price_source(m), m.batch
        )
        for m in plan.models
    }
    settled: dict[str, bool] = {}
    waiting: dict[str, frozenset[str]] = {}
    if held_run(folder, plan.manifest) is not None:
        for _, record in run_records(folder, plan.manifest, plan.sample_ids()):
            settled[record.sample] = record.is_answered if retry_failed else record.is_final
            kind = _kind(record.track, record.way)
            for reply in record.replies:
                rows[record.model].add_reply(reply.usage.completion_tokens, kind)
        lines = tuple(line for _, line in BatchLines(folder))
        for model in plan.models:
            if model.batch:
                waiting[model.name] = waiting_keys(model, lines, folder)
    alike: dict[Variant, list[Variant]] = {}
    for variant in plan.variants:
        alike.setdefault(variant.shown, []).append(variant)
    path = reply_cache_file()
    with ReplyCache(path) if use_cache and path.exists() else nullcontext() as cache:
        for first, variants in alike.items():
            for track in plan.variants[first]:
                for item in track.items:
                    for seeds, outlines in _outlines(track, item, plan.suite.seeds):
                        for model in plan.models:
                            samples = [
                                sample
                                for seed in seeds
                                for variant in variants
                                if not settled.get(
                                    (sample := Sample(track, model.name, item, seed, variant)).id
                                )
                            ]
                            row = rows[model.name]
                            row.done += len(seeds) * len(variants) - len(samples)
                            held = waiting.get(model.name, frozenset())
                            _add(row, model, samples, outlines, cache, held)
    return list(rows.values())


def _outlines(
    track: AnyTrack, item: Item, seeds: Sequence[int]
) -> Iterator[tuple[Sequence[int], Sequence[tuple[Request, bool]]]]:
    """The outlines of an item, with the seeds that show it so."""
    shown = {seed: track.shown(item, seed) for seed in seeds}
    if alike := [seed for seed in seeds if shown[seed] is item]:
        yield alike, list(track.outlines(item))
    for seed in seeds:
        if seed not in alike:
            yield [seed], list(track.outlines(shown[seed]))


def _add(
    row: Estimate,
    config: ModelConfig,
    samples: Sequence[Sample],
    outlines: Sequence[tuple[Request, bool]],
    cache: ReplyCache | None,
    waiting: frozenset[str],
) -> None:
    """Count one item of one model, with seeds that show it alike."""
    expected = []
    if config.kind == "litellm":
        asked = [(replace(outline, params=config.params), real) for outline, real in outlines]
        expected = [(request, real, estimate_call(config, request)) for request, real in asked]
    for sample in samples:
        kind = _kind(sample.track.name, sample.variant)
        for request, is_real, tokens in expected:
            sent = sample.asking(replace(request, seed=sample.seed))
            kept = cache.get(reply_key(config, sent)) if is_real and cache is not None else None
            if kept is not None:
                row.cached += 1
                row.add_reply(kept.usage.completion_tokens, kind)
            elif is_real and reply_key(config, sent) in waiting:
                row.waiting += 1
            else:
                row.add_call(tokens, kind)


def _kind(track: str, variant: Variant) -> str:
    """Replies of one length."""
    return f"{track} {variant.shown.key}".strip()


def unlimited_spending(
    plan: RunPlan, folder: Path, *, use_cache: bool, retry_failed: bool = False
) -> Sequence[Estimate]:
    """Return the estimate of every model, where one that is billed may cost something and no limit
    of the suite holds it; nothing where there is nothing to agree to.
    """
    billed = _billed(plan)
    if plan.suite.limits.max_cost_usd is not None or not billed:
        return ()
    estimated = estimate(plan, folder, use_cache=use_cache, retry_failed=retry_failed)
    return estimated if any(row.may_cost and row.model in billed for row in estimated) else ()


def spending_refused(
    plan: RunPlan, estimated: Sequence[Estimate], message: str, hint: str
) -> SpecError:
    """The error that names the models that may cost money."""
    billed = _billed(plan)
    found = ", ".join(row.model for row in estimated if row.may_cost and row.model in billed)
    return SpecError(Problem(f"suite {plan.suite.name}", message, found=found, hint=hint))


def _billed(plan: RunPlan) -> set[str]:
    """The models whose calls somebody may be billed for."""
    return {model.name for model in plan.models if is_billed(model)}
