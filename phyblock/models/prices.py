"""What models cost: dollars a token, by day, by length of the prompt, and where that is said."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import date, datetime, timezone

from phyblock.records.reply import Usage

__all__ = ["FREE", "Price", "Prices", "Rate", "Tariff", "today"]

_PER_MILLION = 1_000_000


def today() -> date:
    """The day by which calls are priced, in UTC."""
    return datetime.now(timezone.utc).date()


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
        """Whether nothing is to be paid, whatever the numbers of tokens."""
        return not any((self.input_usd, self.output_usd, self.cached_usd, self.cache_write_usd))

    def input_cost(self, prompt: int, cached: int = 0, written: int = 0) -> float:
        """US dollars of a prompt; `cached` and `written` are among its tokens."""
        read_usd = self.input_usd if self.cached_usd is None else self.cached_usd
        write_usd = self.input_usd if self.cache_write_usd is None else self.cache_write_usd
        fresh = max(0, prompt - cached - written)
        spent = fresh * self.input_usd + cached * read_usd + written * write_usd
        return spent / _PER_MILLION

    def output_cost(self, completion: int) -> float:
        """US dollars of a reply."""
        return completion * self.output_usd / _PER_MILLION

    def cost(self, usage: Usage) -> float | None:
        """US dollars of a call; None where the numbers of tokens are not known."""
        if self.is_free:
            return 0.0
        if usage.prompt_tokens is None or usage.completion_tokens is None:
            return None
        cached, written = usage.cached_tokens or 0, usage.cache_write_tokens or 0
        prompt = self.input_cost(usage.prompt_tokens, cached, written)
        return prompt + self.output_cost(usage.completion_tokens)

    def most(self, prompt: float, completion: int) -> float:
        """The most US dollars that so many tokens can cost: all are put into a cache, if that is
        dearer.
        """
        dearest = max(self.input_usd, self.cache_write_usd or 0.0)
        return (prompt * dearest + completion * self.output_usd) / _PER_MILLION

    def halved(self) -> Price:
        """Half the price, for which the batches of OpenAI, Anthropic and Google are answered."""
        halves = (None if n is None else n / 2 for n in (self.cached_usd, self.cache_write_usd))
        return Price(self.input_usd / 2, self.output_usd / 2, *halves)


@dataclass(frozen=True)
class Rate:
    """Prices of calls whose prompts are longer than `above_tokens`; `batch` of those in batches,
    None: as of the others.
    """

    price: Price
    above_tokens: int = 0
    batch: Price | None = None

    def of(self, *, batched: bool) -> Price:
        """The price of a call."""
        return self.batch if batched and self.batch is not None else self.price


@dataclass(frozen=True)
class Tariff:
    """The rates that hold from a day on, by rising `above_tokens`, the first of them 0; `source`
    is where they are said.
    """

    rates: tuple[Rate, ...]
    since: date | None = None
    source: str = ""

    def at(self, prompt_tokens: int, *, batched: bool = False) -> Price:
        """The price of a call with a prompt of so many tokens."""
        rates = (rate for rate in reversed(self.rates) if prompt_tokens > rate.above_tokens)
        return next(rates, self.rates[0]).of(batched=batched)


@dataclass(frozen=True)
class Prices:
    """What a model costs day by day: tariffs in the order of their days."""

    tariffs: tuple[Tariff, ...]

    @classmethod
    def flat(cls, input_usd: float, output_usd: float) -> Prices:
        """One price [US dollars per million tokens] for all days and prompts."""
        return cls((Tariff((Rate(Price(input_usd, output_usd)),)),))

    def on(self, day: date) -> Tariff | None:
        """The tariff of a day; None where nothing is known of it."""
        begun = (t for t in reversed(self.tariffs) if t.since is None or t.since <= day)
        return next(begun, None)

    def at(self, day: date, prompt_tokens: int = 0, *, batched: bool = False) -> Price | None:
        """The price of a call; None where it is not known."""
        tariff = self.on(day)
        return None if tariff is None else tariff.at(prompt_tokens, batched=batched)

    def next_after(self, day: date) -> Tariff | None:
        """The tariff that follows on that of a day."""
        coming = (t for t in self.tariffs if t.since is not None and t.since > day)
        return next(coming, None)

    def after(self, earlier: Prices | None) -> Prices:
        """These, and those of `earlier` until the first day that these speak of."""
        if earlier is None or self.tariffs[0].since is None:
            return self
        return Prices((*earlier.tariffs, *self.tariffs))

    def with_halves(self) -> Prices:
        """These, with half of each for batches where nothing else is said of them."""
        tariffs = (
            replace(
                tariff,
                rates=tuple(
                    rate if rate.batch is not None else replace(rate, batch=rate.price.halved())
                    for rate in tariff.rates
                ),
            )
            for tariff in self.tariffs
        )
        return Prices(tuple(tariffs))

    def is_free_from(self, day: date) -> bool:
        """Whether nothing is to be paid on this day and all that follow."""
        now = self.on(day)
        held = [t for t in self.tariffs if t is now or (t.since is not None and t.since > day)]
        rates = [rate for tariff in held for rate in tariff.rates]
        are_free = (rate.of(batched=batched).is_free for rate in rates for batched in (False, True))
        return now is not None and all(are_free)


FREE = Prices.flat(0.0, 0.0)
