"""What calls cost: prices, estimates before a call, and a budget that is not passed.

Prices come from models.yaml, else from litellm's map of models. Where neither knows a model its
cost is None, "unknown".
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from dataclasses import dataclass
from datetime import date, timedelta

from phyblock.config.models import BatchRateSpec, ModelConfig, RateSpec, host_of
from phyblock.errors import BudgetReachedError, ModelError, Problem, SpecError
from phyblock.models.base import Image, Request
from phyblock.models.keys import KEYLESS
from phyblock.models.payload import wire_params
from phyblock.models.picture_tokens import picture_tokens
from phyblock.models.price_map import map_entry, mapped_prices
from phyblock.models.prices import FREE, Price, Prices, Rate, Tariff, today
from phyblock.models.retry import is_success
from phyblock.models.text_tokens import text_tokens
from phyblock.records.reply import Reply, Usage

__all__ = [
    "Budget",
    "Estimate",
    "cost_usd",
    "counted",
    "estimate",
    "is_billed",
    "may_be_billed",
    "most_usd",
    "plausible",
    "prices_of",
    "reply_cost_usd",
    "require_prices",
]

_HALVING_HOSTS = {
    "openai": "api.openai.com",
    "anthropic": "api.anthropic.com",
    "gemini": "generativelanguage.googleapis.com",
}
"""By provider: the host whose batches cost half, as their price lists of November 2026 say."""

_TYPICAL_REPLY_TOKENS = 500
_TYPICAL_THINKING_TOKENS = 4_000
_ROOM_TO_THINK_TOKENS = 8_192
_LONGEST_REPLY_TOKENS = 32_768
_PROMPT_MARGIN = 1.5
_NOTHING_USD = 1e-9
_MOST_TIMES_EXPECTED = 100
_LEAST_EXPECTED_TOKENS = 1_000


@dataclass(frozen=True)
class Estimate:
    """Tokens of a call that was not made yet.

    `prompt_tokens`: texts by their words, and pictures by their providers' rules;
    `completion_tokens`: a usual reply, with thoughts where the model is told to think or has room
    for them; `most_completion_tokens`: the longest possible.
    """

    prompt_tokens: int
    completion_tokens: int
    most_completion_tokens: int

    @property
    def usage(self) -> Usage:
        """The usual case."""
        return Usage(prompt_tokens=self.prompt_tokens, completion_tokens=self.completion_tokens)


def prices_of(config: ModelConfig) -> Prices | None:
    """Prices of a model: its own, before their first day those of litellm's map; None where neither
    knows any. Baselines and recordings cost nothing. Batches whose price nobody says cost half at
    the provider's own address; elsewhere nothing is known of them, and they cost what others do.
    """
    if config.kind != "litellm":
        return FREE
    mapped = mapped_prices(config)
    prices = _own_prices(config).after(mapped) if config.prices else mapped
    return prices.with_halves() if prices is not None and _halves_batches(config) else prices


def _own_prices(config: ModelConfig) -> Prices:
    """Prices that the models file says."""

    def rate(spec: RateSpec, above_tokens: int = 0) -> Rate:
        batch = None if spec.batch is None else price(spec.batch)
        return Rate(price(spec), above_tokens, batch)

    def price(spec: BatchRateSpec) -> Price:
        return Price(spec.input, spec.output, spec.cached, spec.cache_write)

    return Prices(
        tuple(
            Tariff(
                (rate(spec), *(rate(tier, tier.above) for tier in spec.tiers)),
                spec.since,
                "the models file",
            )
            for spec in config.prices
        )
    )


def _halves_batches(config: ModelConfig) -> bool:
    """Whether a model is served where batches are known to cost half."""
    own = _HALVING_HOSTS.get(config.provider)
    if config.api_base is not None:
        return host_of(config.api_base) == own
    return own is not None and not config.has_address


def require_prices(config: ModelConfig) -> Prices:
    """Prices of a model under a cost limit; SpecError when today's is not known."""
    prices = prices_of(config)
    if prices is None or prices.on(today()) is None:
        hint = "give it a price in models.yaml, or run without max_cost_usd"
        message = "has no known price, so that max_cost_usd cannot be kept"
        raise SpecError(Problem(f"model {config.name}", message, "price", config.id, hint=hint))
    return prices


def is_billed(config: ModelConfig) -> bool:
    """Whether somebody may be billed for calls: not where the price is 0 from today on, nor by a
    server of one's own to which no price and no key was given.
    """
    prices = prices_of(config)
    if prices is None:
        return config.provider not in KEYLESS or config.api_key_env is not None
    return not prices.is_free_from(today())


def cost_usd(
    prices: Prices | None, usage: Usage, day: date, *, batched: bool = False
) -> float | None:
    """US dollars of a call that was made on a day; None when the price or the tokens are not known.

    By the length of the prompt the price may be another; what came out of the provider's cache, or
    went into it, has a price of its own. `batched` calls cost what the provider takes for those.
    """
    price = None if prices is None else prices.at(day, usage.prompt_tokens or 0, batched=batched)
    return None if price is None else price.cost(usage)


def reply_cost_usd(prices: Prices | None, reply: Reply, day: date) -> float | None:
    """US dollars of a reply that was asked for on a day, by whether that was in a batch."""
    return cost_usd(prices, reply.usage, day, batched=reply.batched)


def may_be_billed(error: ModelError) -> bool:
    """Whether the server may have made a reply: it promised one, or was lost on the way."""
    return error.sent in ("lost", "maybe") or is_success(error.status)


def counted(reply: Reply, expected: Estimate) -> Reply:
    """The reply with the counts alone that can be true."""
    said_something = bool(reply.text or reply.reasoning)
    return reply.model_copy(
        update={"usage": plausible(reply.usage, expected, said_something=said_something)}
    )


def most_usd(
    prices: Prices, expected: Estimate, day: date, ratio: float = 1.0, *, batched: bool = False
) -> float:
    """The most US dollars that a call can cost, its prompt `ratio` times its estimate.

    There is a margin on the prompt, as its tokens are estimated, and a day: a call that is sent
    before midnight may be answered after it, and one of a batch a day after that.
    """
    prompt = expected.prompt_tokens * _PROMPT_MARGIN * ratio
    days = [day + timedelta(days=n) for n in range(3 if batched else 2)]
    known = [prices.at(one, math.ceil(prompt), batched=batched) for one in days]
    return max(p.most(prompt, expected.most_completion_tokens) for p in known if p is not None)


def estimate(config: ModelConfig, request: Request) -> Estimate:
    """Tokens that the request would take."""
    parts = [part for message in request.messages for part in message.parts]
    texts = sum(text_tokens(config.id, part) for part in parts if isinstance(part, str))
    pictures = sum(
        picture_tokens(config.id, part, config.image_detail)
        for part in parts
        if isinstance(part, Image)
    )
    params = wire_params(config, request)
    given = params.get("max_completion_tokens", params.get("max_tokens"))
    known = map_entry(config).get("max_output_tokens")
    most = next((n for n in (given, known) if isinstance(n, int)), _LONGEST_REPLY_TOKENS)
    prompt = math.ceil(texts) + pictures
    thinks = params.get("reasoning_effort", "none") != "none" or (
        isinstance(given, int) and given > _ROOM_TO_THINK_TOKENS
    )
    usual = _TYPICAL_THINKING_TOKENS if thinks else _TYPICAL_REPLY_TOKENS
    return Estimate(prompt, min(usual, most), most)


def plausible(usage: Usage, expected: Estimate, *, said_something: bool) -> Usage:
    """The counts that can be true; the others are not known.

    Every request has a prompt and every reply that says something took tokens, whatever a server
    or a library puts in the place of a count that it does not have; and no call takes a hundred
    times what was expected of it.
    """
    prompt = _plausible(usage.prompt_tokens, 1, expected.prompt_tokens)
    completion = _plausible(
        usage.completion_tokens, int(said_something), expected.most_completion_tokens
    )
    reasoning = _plausible(usage.reasoning_tokens, 0, expected.most_completion_tokens)
    cached = _plausible(usage.cached_tokens, 0, expected.prompt_tokens)
    written = _plausible(usage.cache_write_tokens, 0, expected.prompt_tokens)
    if (cached or 0) + (written or 0) > (prompt or 0):
        cached = written = None
    return Usage(
        prompt_tokens=prompt,
        completion_tokens=completion,
        reasoning_tokens=reasoning,
        cached_tokens=cached,
        cache_write_tokens=written,
    )


def _plausible(count: int | None, least: int, expected: int) -> int | None:
    most = _MOST_TIMES_EXPECTED * max(expected, _LEAST_EXPECTED_TOKENS)
    is_count = isinstance(count, int) and not isinstance(count, bool)
    return count if is_count and least <= (count or 0) <= most else None


class Budget:
    """A cost limit for a whole run: room is reserved before a call and settled after it.

    What was spent never becomes less, and a cost that is not known counts as the most that was
    reserved. Of each model the largest ratio of real to estimated prompt tokens is remembered, so
    that pictures which a provider counts higher than the estimate soon are reserved for.
    """

    def __init__(self, max_cost_usd: float, spent_usd: float = 0.0) -> None:
        self._max_usd = _amount(max_cost_usd)
        self._spent_usd = _amount(spent_usd)
        self._held: dict[int, float] = {}
        self._next = 0
        self._changed = asyncio.Event()
        self._ratio: dict[str, float] = {}

    @property
    def spent_usd(self) -> float:
        """What settled calls cost, what was `spent_usd` at the start included."""
        return self._spent_usd

    @property
    def max_cost_usd(self) -> float:
        """The limit."""
        return self._max_usd

    def most_usd(
        self, model: str, prices: Prices, expected: Estimate, day: date, *, batched: bool = False
    ) -> float:
        """The most that a call can cost, as far as the model is known by now."""
        return most_usd(prices, expected, day, self._ratio.get(model, 1.0), batched=batched)

    async def reserve(self, most_usd: Callable[[], float]) -> int:
        """Hold the most that a call can cost, waiting for calls under way to settle; returns the
        reservation's number.

        `most_usd` is asked anew whenever a call has settled, since more is known of the model then.
        Raises BudgetReachedError when it does not fit although nothing is under way.
        """
        usd = _amount(most_usd())
        while self._spent_usd + sum(self._held.values()) + usd > self._max_usd:
            if not self._held:
                raise BudgetReachedError(
                    f"max_cost_usd {self._max_usd:g} is reached: {self._spent_usd:.4f} spent, "
                    f"the next call can cost {usd:.4f}"
                )
            self._changed.clear()
            await self._changed.wait()
            usd = _amount(most_usd())
        self._next += 1
        self._held[self._next] = usd
        return self._next

    def settle(self, reservation: int, usd: float | None) -> float:
        """Put the real cost in the place of a reservation; what is no amount counts all that was
        held, as None does.

        Returns what was counted [US dollars].
        """
        held = self._held.pop(reservation)
        counted = usd if usd is not None and _is_amount(usd) else held
        self._spent_usd += counted
        self._changed.set()
        return counted

    def fits(self, usd: float) -> bool:
        """Whether a further cost would stay within the limit."""
        return self._spent_usd + sum(self._held.values()) + usd <= self._max_usd

    def hold(self, usd: float, onto: int | None = None) -> int:
        """Add to a reservation, or make one, whether it fits or not; returns its number."""
        if onto is None:
            self._next += 1
            onto = self._next
        self._held[onto] = self._held.get(onto, 0.0) + _amount(usd)
        return onto

    def settle_part(self, reservation: int, part_usd: float, usd: float | None) -> float:
        """As `settle`, of one call among those that a reservation is for, the last of which ends
        it; what is read again may have none any more.
        """
        left_usd = self._held.pop(reservation, 0.0) - part_usd
        if left_usd > _NOTHING_USD:
            self._held[reservation] = left_usd
        return self.settle(self.hold(part_usd), usd)

    def settle_rest(self, reservation: int, usd: float | None) -> None:
        """As `settle`, of all calls of a reservation that are not settled, if there are any."""
        if reservation in self._held:
            self.settle(reservation, usd)

    def learn(self, model: str, expected: Estimate, usage: Usage) -> None:
        """Compare an estimate with what the provider counted, where that can be true."""
        counted = plausible(usage, expected, said_something=False).prompt_tokens
        if counted is not None and expected.prompt_tokens > 0:
            ratio = min(counted / expected.prompt_tokens, _MOST_TIMES_EXPECTED)
            self._ratio[model] = max(self._ratio.get(model, 1.0), ratio)


def _amount(usd: float) -> float:
    if not _is_amount(usd):
        raise ValueError(f"no amount of money: {usd}")
    return usd


def _is_amount(usd: float) -> bool:
    return math.isfinite(usd) and usd >= 0
