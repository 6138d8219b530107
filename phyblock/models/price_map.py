"""litellm's map of models: what it says of one, and the prices in it.

The map is read as a file of the installed library, so that nothing heavy is imported.
"""

from __future__ import annotations

import functools
import importlib.util
import json
import re
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

from phyblock.config.models import ModelConfig
from phyblock.models.prices import Price, Prices, Rate, Tariff

__all__ = ["map_entry", "mapped_prices", "mapped_providers"]

_FILE = "model_prices_and_context_window_backup.json"
_PER_MILLION = 1_000_000
_BASE = {
    "input_usd": "input_cost_per_token",
    "output_usd": "output_cost_per_token",
    "cached_usd": "cache_read_input_token_cost",
    "cache_write_usd": "cache_creation_input_token_cost",
}
_ABOVE = re.compile(r"input_cost_per_token_above_(\d+)k_tokens")


def map_entry(config: ModelConfig) -> dict[str, Any]:
    """What litellm's map says of a model, by full id, or by bare name where the provider is the
    same; empty where it does not know it.
    """
    entries = _entries()
    if config.id in entries:
        return entries[config.id]
    entry = entries.get(config.provider_model, {})
    owner = str(entry.get("litellm_provider", ""))
    return entry if config.provider and owner.startswith(config.provider) else {}


def mapped_providers() -> frozenset[str]:
    """The providers of the map's models."""
    named = (str(entry.get("litellm_provider", "")) for entry in _entries().values())
    # Some entries name none.
    return frozenset(name for name in named if name)


def mapped_prices(config: ModelConfig) -> Prices | None:
    """Prices of a model by the map, which knows no days; None where it knows no price."""
    entry = map_entry(config)
    tiers = entry.get("tiered_pricing")
    if isinstance(tiers, list):
        rates = [_rate(tier, "", int(tier["range"][0])) for tier in tiers]
    else:
        found = (match[1] for match in map(_ABOVE.fullmatch, entry) if match)
        above = [(f"_above_{thousands}k_tokens", int(thousands) * 1000) for thousands in found]
        rates = [_rate(entry, ending, least) for ending, least in [("", 0), *above]]
    known = sorted((rate for rate in rates if rate is not None), key=lambda rate: rate.above_tokens)
    if not known or known[0].above_tokens > 0:
        return None
    source = f"litellm {version('litellm')} map"
    return Prices((Tariff(tuple(known), source=source),))


def _rate(entry: Mapping[str, Any], ending: str, above_tokens: int) -> Rate | None:
    price = _price(entry, ending)
    return None if price is None else Rate(price, above_tokens, _price(entry, f"{ending}_batches"))


def _price(entry: Mapping[str, Any], ending: str) -> Price | None:
    """The price in the keys that end so; what a prompt cache costs may be said without the end,
    and is never more than what it saves.
    """
    told = {name: entry.get(key + ending) for name, key in _BASE.items()}
    usd = {name: float(n) * _PER_MILLION for name, n in told.items() if n is not None}
    if "input_usd" not in usd or "output_usd" not in usd:
        return None
    usual = entry.get(_BASE["cached_usd"])
    if usual is not None:
        usd.setdefault("cached_usd", min(float(usual) * _PER_MILLION, usd["input_usd"]))
    return Price(**usd)


@functools.cache
def _entries() -> dict[str, dict[str, Any]]:
    spec = importlib.util.find_spec("litellm")
    if spec is None or spec.origin is None:
        return {}
    path = Path(spec.origin).with_name(_FILE)
    if not path.is_file():
        return {}
    entries: dict[str, dict[str, Any]] = json.loads(path.read_text(encoding="utf-8"))
    return entries
