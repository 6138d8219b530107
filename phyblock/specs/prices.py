"""What a person may write about the price of a model."""

from __future__ import annotations

import contextlib
import re
from datetime import date
from itertools import pairwise
from typing import Annotated

from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, PrivateAttr, Tag

from phyblock.specs.fields import Count, Section, refuse

__all__ = ["BatchRateSpec", "PriceSpec", "PriceSpecs", "RateSpec"]

UsdPerMillion = Annotated[float, Field(strict=True, ge=0, le=1e9, allow_inf_nan=False)]


def _read_day(value: object) -> date:
    if isinstance(value, str) and re.fullmatch(r"\d{4}-\d\d-\d\d", value):
        with contextlib.suppress(ValueError):
            return date.fromisoformat(value)
    raise refuse("is no day", allowed="a day such as 2026-12-01")


class BatchRateSpec(Section):
    """What tokens cost in the provider's batches."""

    input: UsdPerMillion = Field(description="Prompt tokens [USD per million].")
    output: UsdPerMillion = Field(description="Reply tokens [USD per million].")
    cached: UsdPerMillion | None = Field(
        default=None,
        description="Prompt tokens that the provider has in its cache [USD per million]; null: as "
        "the others.",
    )
    cache_write: UsdPerMillion | None = Field(
        default=None,
        description="Prompt tokens that it puts into its cache [USD per million]; null: as the "
        "others.",
    )


class RateSpec(BatchRateSpec):
    """What tokens cost."""

    batch: BatchRateSpec | None = Field(
        default=None,
        description="What they cost in batches; null: half at OpenAI's, Anthropic's and Google's "
        "own addresses, and at others as outside of batches.",
    )


class TierSpec(RateSpec):
    """What tokens cost in calls with long prompts."""

    above: Count = Field(description="Prompts of more tokens than this.")


def _check_rising(tiers: tuple[TierSpec, ...]) -> tuple[TierSpec, ...]:
    for index, (tier, following) in enumerate(pairwise(tiers), start=1):
        if following.above <= tier.above:
            message, allowed = "is not above the one before it", f"more than {tier.above}"
            raise refuse(message, at=(index, "above"), allowed=allowed)
    return tiers


class PriceSpec(RateSpec):
    """What a model costs, where litellm's price map does not know it or is wrong."""

    since: Annotated[date, BeforeValidator(_read_day)] | None = Field(
        default=None,
        alias="from",
        description="Day from which this holds (UTC). Before the first one that is named, "
        "litellm's price map does.",
    )
    tiers: Annotated[tuple[TierSpec, ...], AfterValidator(_check_rising)] = Field(
        default=(), description="Other prices of calls with long prompts, by rising `above`."
    )
    _place: str = PrivateAttr(default="")

    def __eq__(self, other: object) -> bool:
        # Where a price is written is no part of it.
        return isinstance(other, PriceSpec) and self.__dict__ == other.__dict__

    def __hash__(self) -> int:
        return hash(tuple(self.__dict__.values()))

    @property
    def place(self) -> str:
        """The file and line that say so, "" where none is known."""
        return self._place

    def stands_at(self, place: str) -> None:
        """Note the file and line that say so."""
        self._place = place


def _check_days(prices: tuple[PriceSpec, ...]) -> tuple[PriceSpec, ...]:
    for index, (price, following) in enumerate(pairwise(prices), start=1):
        if following.since is None:
            message = "does not say from which day on it holds"
            raise refuse(message, at=(index,), hint="add from, for example from: 2026-12-01")
        if price.since is not None and following.since <= price.since:
            message, allowed = "is not later than the one before it", f"a day after {price.since}"
            raise refuse(message, at=(index, "from"), allowed=allowed)
    return prices


PriceSpecs = Annotated[
    Annotated[PriceSpec, Tag("one")]
    | Annotated[
        tuple[PriceSpec, ...], Field(min_length=1), AfterValidator(_check_days), Tag("list")
    ],
    Discriminator(lambda value: "list" if isinstance(value, list | tuple) else "one"),
]
"""One price, or several that follow on one another."""
