"""What models cost: dollars a token by day, by length of the prompt, and in batches.

Prices come from models.yaml, else from litellm's map of models, which is read as a file of the
installed library: nothing heavy is imported. What neither knows is
None, unknown.
"""

from __future__ import annotations

import functools
import importlib.util
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import UTC, date, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from phyblock.config.models import BatchRateSpec, ModelConfig, RateSpec, host_of
from phyblock.errors import Problem, SpecError
from phyblock.models.keys import KEYLESS
from phyblock.records.reply import Reply, Usage

_PER_MILLION = 1_000_000
_MAP_FILE = "model_prices_and_context_window_backup.json"
_MAP_KEYS = {
    "input_usd": "input_cost_per_token",
    "output_usd": "output_cost_per_token",
    "cached_usd": "cache_read_input_token_cost",
    "cache_write_usd": "cache_creation_input_token_cost",
}
_ABOVE = re.compile(r"input_cost_per_token_above_(\d+)k_tokens")
_HALVING_HOSTS = {
    "openai": "api.openai.com",
    "anthropic": "api.anthropic.com",
    "gemini": "generativelanguage.googleapis.com",
}
"""By provider: the host whose batches cost half, as their price lists of November 2026 say."""


def today() -> date:
    """Return the day by which calls are priced, in UTC."""
    return datetime.now(UTC).date()


@dataclass(frozen=True)
class Price:
    """US dollars per million tokens.

    `cached_usd` is for prompt tokens that the provider had in its cache, `cache_write_usd` for
    those that it put there; None: they cost as all others do.
    """

    input_usd: float
    output_usd: float
    cached_usd: float | None = None
    cache_write_usd: float | None = None

    @property
    def is_free(self) -> bool:
        """True if nothing is to be paid, whatever the numbers of tokens."""
        return not any((self.input_usd, self.output_usd, self.cached_usd, self.cache_write_usd))

    def input_cost(self, prompt: int, cached: int = 0, written: int = 0) -> float:
        """Return US dollars of a prompt; `cached` and `written` are among its tokens."""
        read_usd = self.input_usd if self.cached_usd is None else self.cached_usd
        write_usd = self.input_usd if self.cache_write_usd is None else self.cache_write_usd
        fresh = max(0, prompt - cached - written)
        spent = fresh * self.input_usd + cached * read_usd + written * write_usd
        return spent / _PER_MILLION

    def output_cost(self, completion: int) -> float:
        """Return US dollars of a reply."""
        return completion * self.output_usd / _PER_MILLION

    def cost(self, usage: Usage) -> float | None:
        """Return US dollars of a call; None where the numbers of tokens are not known."""
        if self.is_free:
            return 0.0
        if usage.prompt_tokens is None or usage.completion_tokens is None:
            return None
        cached, written = usage.cached_tokens or 0, usage.cache_write_tokens or 0
        prompt = self.input_cost(usage.prompt_tokens, cached, written)
        return prompt + self.output_cost(usage.completion_tokens)

    def most(self, prompt: float, completion: int) -> float:
        """Return the most US dollars that so many tokens can cost: all are put into a cache, if
        that is dearer.
        """
        dearest = max(self.input_usd, self.cache_write_usd or 0.0)
        return (prompt * dearest + completion * self.output_usd) / _PER_MILLION

    def halved(self) -> Price:
        """Return half the price, as batches cost at OpenAI, Anthropic and Google."""
        halves = (None if n is None else n / 2 for n in (self.cached_usd, self.cache_write_usd))
        return Price(self.input_usd / 2, self.output_usd / 2, *halves)


@dataclass(frozen=True)
class Rate:
    """The price of calls whose prompts are longer than `above_tokens`, and of those in batches,
    where that is another.
    """

    price: Price
    above_tokens: int = 0
    batch: Price | None = None


@dataclass(frozen=True)
class Tariff:
    """The rates that hold from a day on, by rising `above_tokens`, the first of them 0; `source`
    is where they are said.
    """

    rates: tuple[Rate, ...]
    since: date | None = None
    source: str = ""

    def at(self, prompt_tokens: int, *, batched: bool = False) -> Price:
        """Return the price of a call with a prompt of so many tokens."""
        longer = (rate for rate in reversed(self.rates) if prompt_tokens > rate.above_tokens)
        rate = next(longer, self.rates[0])
        return rate.batch if batched and rate.batch is not None else rate.price


@dataclass(frozen=True)
class Prices:
    """What a model costs day by day: tariffs in the order of their days."""

    tariffs: tuple[Tariff, ...]

    @classmethod
    def flat(cls, input_usd: float, output_usd: float) -> Prices:
        """Return one price [US dollars per million tokens] for all days and prompts."""
        return cls((Tariff((Rate(Price(input_usd, output_usd)),)),))

    def on(self, day: date) -> Tariff | None:
        """Return the tariff of a day; None where nothing is known of it."""
        begun = (t for t in reversed(self.tariffs) if t.since is None or t.since <= day)
        return next(begun, None)

    def next_after(self, day: date) -> Tariff | None:
        """Return the tariff that follows on that of a day."""
        coming = (t for t in self.tariffs if t.since is not None and t.since > day)
        return next(coming, None)

    def at(self, day: date, prompt_tokens: int = 0, *, batched: bool = False) -> Price | None:
        """Return the price of a call; None where it is not known."""
        tariff = self.on(day)
        return None if tariff is None else tariff.at(prompt_tokens, batched=batched)

    def is_free_from(self, day: date) -> bool:
        """True if nothing is to be paid on this day and all that follow."""
        now = self.on(day)
        held = [t for t in self.tariffs if t is now or (t.since is not None and t.since > day)]
        prices = [p for t in held for rate in t.rates for p in (rate.price, rate.batch)]
        return now is not None and all(price is None or price.is_free for price in prices)


_FREE = Prices.flat(0.0, 0.0)


def prices_of(config: ModelConfig) -> Prices | None:
    """Return the prices of a model: its own, before their first day those of litellm's map; None
    where neither knows any. Baselines and recordings cost nothing.

    Batches whose price nobody says cost half at the provider's own address; elsewhere nothing is
    known of them, and they cost what other calls do.
    """
    if config.kind != "litellm":
        return _FREE

    def price(spec: BatchRateSpec) -> Price:
        return Price(spec.input, spec.output, spec.cached, spec.cache_write)

    def rate(spec: RateSpec, above_tokens: int = 0) -> Rate:
        batch = None if spec.batch is None else price(spec.batch)
        return Rate(price(spec), above_tokens, batch)

    tariffs = [
        Tariff(
            (rate(spec), *(rate(tier, tier.above) for tier in spec.tiers)),
            spec.since,
            "the models file",
        )
        for spec in config.prices
    ]
    if not tariffs or tariffs[0].since is not None:
        tariffs = [*_mapped_tariffs(config), *tariffs]
    host, base = _HALVING_HOSTS.get(config.provider), config.api_base
    if host is not None and (host_of(base) == host if base else not config.has_address):
        tariffs = [
            replace(t, rates=tuple(replace(r, batch=r.batch or r.price.halved()) for r in t.rates))
            for t in tariffs
        ]
    return Prices(tuple(tariffs)) if tariffs else None


def require_prices(config: ModelConfig) -> Prices:
    """Return the prices of a model under a cost limit; SpecError when today's is not known."""
    prices = prices_of(config)
    if prices is None or prices.on(today()) is None:
        hint = "give it a price in models.yaml, or run without max_cost_usd"
        message = "has no known price, so that max_cost_usd cannot be kept"
        raise SpecError(Problem(f"model {config.name}", message, "price", config.id, hint=hint))
    return prices


def is_billed(config: ModelConfig) -> bool:
    """True if somebody may be billed for calls: not where the price is 0 from today on, nor by a
    local server to which no price and no key was given.
    """
    prices = prices_of(config)
    if prices is None:
        return config.provider not in KEYLESS or config.api_key_env is not None
    return not prices.is_free_from(today())


def reply_cost_usd(prices: Prices | None, reply: Reply, day: date) -> float | None:
    """Return US dollars of a reply that was asked for on a day, in a batch or not; None when the
    price or the tokens are not known.
    """
    prompt = reply.usage.prompt_tokens or 0
    price = None if prices is None else prices.at(day, prompt, batched=reply.batched)
    return None if price is None else price.cost(reply.usage)


def map_entry(config: ModelConfig) -> dict[str, Any]:
    """Return what litellm's map says of a model, by full id, or by bare name where the provider is
    the same; empty where it does not know it.
    """
    entries = _map_entries()
    if config.id in entries:
        return entries[config.id]
    entry = entries.get(config.provider_model, {})
    owner = str(entry.get("litellm_provider", ""))
    return entry if config.provider and owner.startswith(config.provider) else {}


def mapped_providers() -> frozenset[str]:
    """Return the providers of the map's models."""
    named = (str(entry.get("litellm_provider", "")) for entry in _map_entries().values())
    # Some entries name none.
    return frozenset(name for name in named if name)


def ends_on(config: ModelConfig) -> date | None:
    """Return the day from which a model no longer answers; None where the map names none."""
    try:
        return date.fromisoformat(str(map_entry(config).get("deprecation_date")))
    except ValueError:
        return None


def is_unlisted(config: ModelConfig) -> bool:
    """True if a provider's model is not in the map: retired already, or newer than the map."""
    is_hosted = config.kind == "litellm" and not config.has_address
    return is_hosted and config.provider not in KEYLESS and not map_entry(config)


def _mapped_tariffs(config: ModelConfig) -> list[Tariff]:
    """Return the tariff of the map, which knows no days; none where it knows no price."""
    entry = map_entry(config)
    tiers = entry.get("tiered_pricing")
    if isinstance(tiers, list):
        places = [(tier, "", int(tier["range"][0])) for tier in tiers if "range" in tier]
    else:
        found = (match[1] for match in map(_ABOVE.fullmatch, entry) if match)
        above = [(entry, f"_above_{number}k_tokens", int(number) * 1000) for number in found]
        places = [(entry, "", 0), *above]
    rates = [
        Rate(price, above_tokens, _mapped_price(fields, f"{ending}_batches"))
        for fields, ending, above_tokens in sorted(places, key=lambda place: place[2])
        if (price := _mapped_price(fields, ending)) is not None
    ]
    if not rates or rates[0].above_tokens > 0:
        return []
    return [Tariff(tuple(rates), source=f"litellm {version('litellm')} map")]


def _mapped_price(entry: Mapping[str, Any], ending: str) -> Price | None:
    """Return the price in the keys that end so; what a prompt cache costs may be said without the
    end, and is never more than what it saves.
    """
    told = {name: entry.get(key + ending) for name, key in _MAP_KEYS.items()}
    usd = {name: float(n) * _PER_MILLION for name, n in told.items() if n is not None}
    if "input_usd" not in usd or "output_usd" not in usd:
        return None
    usual = entry.get(_MAP_KEYS["cached_usd"])
    if usual is not None:
        usd.setdefault("cached_usd", min(float(usual) * _PER_MILLION, usd["input_usd"]))
    return Price(**usd)


@functools.cache
def _map_entries() -> dict[str, dict[str, Any]]:
    spec = importlib.util.find_spec("litellm")
    path = Path(spec.origin).with_name(_MAP_FILE) if spec and spec.origin else None
    if path is None or not path.is_file():
        return {}
    entries: dict[str, dict[str, Any]] = json.loads(path.read_text(encoding="utf-8"))
    return entries
