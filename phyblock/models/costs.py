"""Prices of models, estimates of the tokens of a call, and the cost limit of a run.

Prices come from models.yaml, else from litellm's map of models, which is read as a file of the
installed library, without importing it. Values that neither has are None, unknown.
"""

from __future__ import annotations

import asyncio
import functools
import importlib.util
import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from phyblock.config.models import ModelConfig, Price, Tariff, host_of
from phyblock.errors import BudgetReachedError, ModelError, UnavailableError
from phyblock.files import read_own_yaml
from phyblock.models.client import KEYLESS, api_key_status
from phyblock.models.request import Image, Request, wire_params
from phyblock.records.record import Reply, Usage
from phyblock.types import ImageDetail

_MAP_FILE = "model_prices_and_context_window_backup.json"
_MAP_KEYS = {
    "input": "input_cost_per_token",
    "output": "output_cost_per_token",
    "cached": "cache_read_input_token_cost",
    "cache_write": "cache_creation_input_token_cost",
}
_ABOVE = re.compile(r"input_cost_per_token_above_(\d+)k_tokens")
_HALVING_HOSTS = {
    "openai": "api.openai.com",
    "anthropic": "api.anthropic.com",
    "gemini": "generativelanguage.googleapis.com",
}
"""By provider: the host whose batches cost half, by its price list of November 2026."""
_TYPICAL_REPLY_TOKENS = 500
_TYPICAL_THINKING_TOKENS = 4_000
_ROOM_TO_THINK_TOKENS = 8_192
_LONGEST_REPLY_TOKENS = 32_768
_PROMPT_MARGIN = 1.5
_MOST_TIMES_EXPECTED = 100


def tariff_of(config: ModelConfig) -> Tariff | None:
    """Return a model's price, or that in litellm's map, or None; baselines and recordings are free.

    Batches without a price cost half at the provider's own address, and the full price elsewhere.
    """
    if config.kind != "litellm":
        return Tariff(input=0.0, output=0.0)
    tariff = config.price or _mapped_tariff(config)
    host, base = _HALVING_HOSTS.get(config.provider), config.api_base
    is_halved = host is not None and (host_of(base) == host if base else not config.addresses)
    if tariff is None or tariff.batch is not None or not is_halved:
        return tariff
    half = {name: None if usd is None else usd / 2 for name, usd in tariff if name in _MAP_KEYS}
    return tariff.model_copy(update={"batch": Price.model_validate(half)})


def price_at(tariff: Tariff, *, batched: bool = False) -> Price:
    """Return the price of a call, in a batch or by itself."""
    return tariff.batch if batched and tariff.batch is not None else tariff


def is_free(tariff: Tariff) -> bool:
    """True if every call is free, in batches too."""
    prices = [price for price in (tariff, tariff.batch) if price is not None]
    return not any(getattr(price, name) for price in prices for name in _MAP_KEYS)


def cost_usd(tariff: Tariff | None, reply: Reply) -> float | None:
    """Return a reply's cost [US dollars]; None if its tokens or their price are unknown."""
    if tariff is None or is_free(tariff):
        return None if tariff is None else 0.0
    usage = reply.usage
    if usage.prompt_tokens is None or usage.completion_tokens is None:
        return None
    if tariff.up_to is not None and usage.prompt_tokens > tariff.up_to:
        return None
    price = price_at(tariff, batched=reply.batched)
    read, written = usage.cached_tokens or 0, usage.cache_write_tokens or 0
    read_usd = price.input if price.cached is None else price.cached
    write_usd = price.input if price.cache_write is None else price.cache_write
    fresh = max(0, usage.prompt_tokens - read - written)
    prompt = fresh * price.input + read * read_usd + written * write_usd
    return prompt / 1_000_000 + usage.completion_tokens * price.output / 1_000_000


def is_billed(config: ModelConfig) -> bool:
    """True if calls may be billed: not at price 0, nor by local servers without price and key."""
    tariff = tariff_of(config)
    if tariff is None:
        return config.provider not in KEYLESS or api_key_status(config).key is not None
    return not is_free(tariff)


@functools.cache
def map_entries() -> dict[str, dict[str, Any]]:
    """Return litellm's map of models by id; empty without the library's file."""
    spec = importlib.util.find_spec("litellm")
    path = Path(spec.origin).with_name(_MAP_FILE) if spec and spec.origin else None
    if path is None or not path.is_file():
        return {}
    entries: dict[str, dict[str, Any]] = json.loads(path.read_text(encoding="utf-8"))
    return entries


def map_entry(config: ModelConfig) -> dict[str, Any]:
    """Return a model's entry in litellm's map, by id or the provider's bare name, or {}."""
    entries = map_entries()
    if config.id in entries:
        return entries[config.id]
    entry = entries.get(config.provider_model, {})
    owner = str(entry.get("litellm_provider", ""))
    return entry if config.provider and owner.startswith(config.provider) else {}


def _mapped_tariff(config: ModelConfig) -> Tariff | None:
    """Return the price in the map of the shortest prompts, or None."""
    entry = map_entry(config)
    ends = [1000 * int(match[1]) for match in map(_ABOVE.fullmatch, entry) if match]
    tiers = entry.get("tiered_pricing")
    if isinstance(tiers, list):
        entry = min(tiers, key=lambda tier: tier["range"][0])
        ends = [int(entry["range"][1])]
    if (price := _mapped_price(entry, "")) is None:
        return None
    batch, up_to = _mapped_price(entry, "_batches"), min(ends, default=None)
    return Tariff.model_validate({**price, "batch": batch, "up_to": up_to})


def _mapped_price(entry: Mapping[str, Any], ending: str) -> dict[str, Any] | None:
    """Return the price in the keys with this ending, which that of cached prompts may lack."""
    found = {name: entry.get(key + ending) for name, key in _MAP_KEYS.items()}
    usd = {name: float(n) * 1_000_000 for name, n in found.items() if n is not None}
    if "input" not in usd or "output" not in usd:
        return None
    if (usual := entry.get(_MAP_KEYS["cached"])) is not None:
        usd.setdefault("cached", min(float(usual) * 1_000_000, usd["input"]))
    return usd


@dataclass(frozen=True, eq=False)
class Reservation:
    """The most that a call in progress can cost [US dollars]."""

    usd: float


@dataclass(eq=False)
class Budget:
    """A cost limit for a whole run: room is reserved before a call and settled after it.

    Spending never decreases, and an unknown cost counts as the whole reserve. Without a limit it
    only counts. `spent_usd` is the cost of settled calls, which includes that of earlier commands.
    """

    max_usd: float = math.inf
    spent_usd: float = 0.0
    held_usd: float = 0.0
    holds: int = 0
    changed: asyncio.Event = field(default_factory=asyncio.Event)


class ModelBudget:
    """The calls of one model within a run's budget, and what is learned from its replies.

    The largest ratios of real to estimated tokens are kept: reserves adapt to providers that count
    more. Under a limit, at most one more call is in progress than have been settled: 1, 2, 4, ...
    """

    def __init__(self, run: Budget, tariff: Tariff | None = None) -> None:
        self._run = run
        self.tariff = tariff
        self._under_way: set[Reservation] = set()
        self._settled = 0
        self._prompt_ratio = self._reply_ratio = 1.0
        self.is_limited = run.max_usd < math.inf

    def most_usd(self, expected: Estimate, *, batched: bool = False) -> float | None:
        """Return the most that a call can cost, by what is known of the model so far; None without
        a price. Raises UnavailableError if a limit cannot be kept for such a long prompt.
        """
        if self.tariff is None:
            return None
        longest = math.ceil(expected.most_completion_tokens * self._reply_ratio)
        prompt = expected.prompt_tokens * self._prompt_ratio
        if self.is_limited and self.tariff.up_to is not None and prompt > self.tariff.up_to:
            why = f"prompts of more than {self.tariff.up_to:,} tokens have another price"
            raise UnavailableError(f"{why}: set it in models.yaml, or run without max_cost_usd")
        return most_usd(self.tariff, prompt, longest, batched=batched)

    async def reserve(self, expected: Estimate, *, batched: bool = False) -> Reservation | None:
        """Reserve the most that a call can cost when there is room; None without a price.

        It is computed again when a call settles. Calls of a batch do not wait for the first ones.
        Raises BudgetReachedError if it exceeds the limit with no call under way, and as `most_usd`.
        """
        run = self._run
        while (usd := self.most_usd(expected, batched=batched)) is not None:
            is_slow = self.is_limited and len(self._under_way) > self._settled
            fits = run.spent_usd + run.held_usd + usd <= run.max_usd
            if fits and (batched or not is_slow):
                reservation = self.hold(usd)
                if not batched:
                    self._under_way.add(reservation)
                return reservation
            if not run.holds and run.spent_usd + usd > run.max_usd:
                spent = f"max_cost_usd: ${run.spent_usd:.4f} of ${run.max_usd:g} spent"
                raise BudgetReachedError(f"{spent}; the next call can cost ${usd:.4f}")
            run.changed.clear()
            await run.changed.wait()
        return None

    def hold(self, usd: float) -> Reservation:
        """Make a reservation even if it exceeds the limit."""
        self._run.held_usd += usd
        self._run.holds += 1
        return Reservation(usd)

    def settle(self, reservation: Reservation, usd: float | None) -> float:
        """Settle a reservation at a cost, in full if that is None or invalid; return it [USD]."""
        self._under_way.discard(reservation)
        self._settled += 1
        counted = usd if usd is not None and math.isfinite(usd) and usd >= 0 else reservation.usd
        run = self._run
        run.holds -= 1
        # Rounding errors of the running sum must not add up over a run.
        run.held_usd = max(0.0, run.held_usd - reservation.usd) if run.holds else 0.0
        run.spent_usd += counted
        run.changed.set()
        return counted

    def learn(self, expected: Estimate, usage: Usage) -> None:
        """Compare an estimate with the provider's counts, if they are plausible."""

        def ratio(known: float, real: int | None, estimated: int) -> float:
            if real is None or estimated <= 0:
                return known
            return max(known, min(real / estimated, _MOST_TIMES_EXPECTED))

        self._prompt_ratio = ratio(self._prompt_ratio, usage.prompt_tokens, expected.prompt_tokens)
        longest = expected.most_completion_tokens
        self._reply_ratio = ratio(self._reply_ratio, usage.completion_tokens, longest)


@dataclass(frozen=True)
class Estimate:
    """Tokens of a future call: of the prompt, of a typical reply (with thoughts if the model is set
    to think or has room for them), and of the longest possible one.
    """

    prompt_tokens: int
    completion_tokens: int
    most_completion_tokens: int

    @property
    def most_tokens(self) -> int:
        """The tokens of the prompt and of the longest possible reply."""
        return self.prompt_tokens + self.most_completion_tokens


def estimate(config: ModelConfig, request: Request) -> Estimate:
    """Return an estimate of the tokens of a request."""
    texts, pictures = 0.0, 0
    for part in (part for message in request.messages for part in message.parts):
        if isinstance(part, Image):
            pictures += picture_tokens(config.id, part, config.image_detail)
        else:
            texts += text_tokens(config.id, part)
    params = wire_params(config, request)
    given = params.get("max_completion_tokens", params.get("max_tokens"))
    known = map_entry(config).get("max_output_tokens")
    most = next((n for n in (given, known) if isinstance(n, int)), _LONGEST_REPLY_TOKENS)
    thinks = params.get("reasoning_effort", "none") != "none" or (
        isinstance(given, int) and given > _ROOM_TO_THINK_TOKENS
    )
    usual = _TYPICAL_THINKING_TOKENS if thinks else _TYPICAL_REPLY_TOKENS
    return Estimate(math.ceil(texts) + pictures, min(usual, most), most)


def most_usd(tariff: Tariff, prompt: float, reply: int, *, batched: bool = False) -> float:
    """Return the most these tokens can cost [USD]: a cache is written, the prompt has a margin."""
    price = price_at(tariff, batched=batched)
    prompt_usd = prompt * _PROMPT_MARGIN * max(price.input, price.cache_write or 0.0)
    return (prompt_usd + reply * price.output) / 1_000_000


def may_be_billed(error: ModelError) -> bool:
    """True if the server may have made a reply: it indicated one, or the connection was lost."""
    return error.sent in ("lost", "maybe") or 200 <= (error.status or 0) < 300


_PIECE = re.compile(
    r"[^\r\n\w]?[A-Za-z]+|[^\W\d_a-zA-Z]{1,2}|\d{1,3}| ?[^\s\w]+[\r\n]*|_|\s*[\r\n]+|\s+(?!\S)|\s+"
)


@functools.lru_cache(maxsize=1024)
def text_tokens(model_id: str, text: str) -> float:
    """Return an estimate of a text's tokens; `model_id` may name any provider.

    It counts words and runs of digits and signs, into which tokenizers first split texts: for the
    bundled prompts, the result is within 1 % of the tokens of OpenAI's o200k. Anthropic's last
    published vocabulary makes 3 % more. Google says that a token is about four characters.
    """
    name = model_id.lower()
    if "gemini" in name or "gemma" in name:
        return len(text) / 4
    return len(_PIECE.findall(text)) * (1.03 if "claude" in name else 1.0)


@functools.cache
def _picture_rules() -> list[tuple[re.Pattern[str], dict[str, Any]]]:
    """Read pictures.yaml, which says what its rules mean, with each pattern of names."""
    entries = read_own_yaml(Path(__file__).with_name("pictures.yaml"))
    return [(re.compile(rf"(^|\.){entry['model']}"), entry) for entry in entries]


def picture_tokens(model_id: str, image: Image, detail: ImageDetail | None = None) -> int:
    """Return the tokens of a picture at a detail, or the provider's default, for a model id."""
    name = model_id.rpartition("/")[2].lower()
    entry = next(entry for names, entry in _picture_rules() if names.search(name))
    rule = entry.get("details", {}).get(detail or "auto", entry["usual"])
    if isinstance(rule, int):
        return rule
    width, height, side = image.width_px, image.height_px, rule["side"]
    longest, shortest = rule.get("longest", math.inf), rule.get("shortest", math.inf)
    scale = min(1.0, longest / max(width, height), shortest / min(width, height))
    squares = math.ceil(width * scale / side) * math.ceil(height * scale / side)
    most, each = rule.get("most", math.inf), rule.get("each", 1)
    tokens: float = rule.get("plus", 0) + each * min(most, squares)
    return math.ceil(tokens)
