"""A reply, at run time and in every file; or the error in its place."""

from __future__ import annotations

from typing import Literal, Self, TypeVar

from phyblock.records.line import LARGEST_WHOLE, Amount, Line, Usd, Whole, encodable
from phyblock.types import Finish

__all__ = ["ErrorKind", "Reply", "StoredError", "Usage"]

ErrorKind = Literal["retryable", "sample", "refused", "unavailable", "unjudged"]

_NumberT = TypeVar("_NumberT", int, float)


def _within(number: _NumberT | None, least: int) -> _NumberT | None:
    return number if number is not None and least <= number <= LARGEST_WHOLE else None


class Usage(Line):
    """Tokens of a reply as the provider counted them; null where it did not say."""

    prompt_tokens: Whole | None = None
    """Tokens of the prompt, pictures included."""
    completion_tokens: Whole | None = None
    """Tokens of the reply."""
    reasoning_tokens: Whole | None = None
    """Those of `completion_tokens` that were spent on reasoning."""
    cached_tokens: Whole | None = None
    """Those of `prompt_tokens` that the provider had in its prompt cache."""
    cache_write_tokens: Whole | None = None
    """Those of `prompt_tokens` that it put into its prompt cache and bills as such."""


class Reply(Line):
    """An answer that was read."""

    text: str
    """The answer."""
    reasoning: str = ""
    """The reasoning that the provider showed beside it."""
    finish: Finish = "stop"
    """The reason why it ended: by itself, at the token limit, by a content filter, or not said."""
    usage: Usage = Usage()
    """Its tokens."""
    cost_usd: Usd | None = None
    """Its price [US dollars]; null: not known."""
    billed_usd: Usd | None = None
    """Amount that `max_cost_usd` counts [US dollars], failed attempts included, a reply without
    token counts at its dearest; null: no price is known."""
    latency_s: Amount = 0.0
    """Time of the successful request alone [s]."""
    provider_model: str = ""
    """The model that the provider says it used."""
    attempts: Whole = 1
    """Requests sent for it, 0 from the cache."""
    cached: bool = False
    """True if it came from the cache."""
    seed_sent: bool = True
    """True if the provider takes a seed; where not, seeds are independent repeats."""
    batched: bool = False
    """True if it came in a batch, at the price of one."""

    def storable(self) -> Self:
        """Return the reply with all its fields, as it is written.

        It is paid for: an absurd number in it is one that is not known, and characters that no
        file could hold become "?".
        """
        fields = self.model_dump()
        texts = {name: encodable(text) for name, text in fields.items() if isinstance(text, str)}
        usage = fields["usage"].items()
        counts = {name: _within(count, -LARGEST_WHOLE) for name, count in usage}
        money = {name: _within(fields[name], 0) for name in ("cost_usd", "billed_usd")}
        return self.model_validate({**fields, **texts, **money, "usage": counts})

    @property
    def tokens(self) -> int:
        """Tokens of prompt and reply, as far as they are known."""
        return (self.usage.prompt_tokens or 0) + (self.usage.completion_tokens or 0)

    @property
    def limit_usd(self) -> float:
        """Amount that a limit counted for it, else its cost unless that was paid elsewhere."""
        if self.billed_usd is not None:
            return self.billed_usd
        return 0.0 if self.cached else self.cost_usd or 0.0


class StoredError(Line):
    """The reason why there is no reply, or no judgement of it."""

    kind: ErrorKind
    """`retryable`: every attempt failed; `sample`: this request cannot succeed; `refused`: by a
    content policy; `unjudged`: there is a reply, which no engine could carry out."""
    status: Whole | None = None
    """HTTP status, where there was one."""
    message: str = ""
    """The words of it."""
    billed_usd: Usd | None = None
    """As of a reply."""
