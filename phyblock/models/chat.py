"""A model behind a network: cache, then retries, and for each attempt limits, budget, transport."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AsyncExitStack
from dataclasses import dataclass, replace

from phyblock.errors import (
    BudgetReachedError,
    ModelError,
    RetryableError,
    StoreError,
    UnavailableError,
)
from phyblock.models.base import Reply, Request
from phyblock.models.cache import ReplyCache, reply_key
from phyblock.models.config import ModelConfig, Price
from phyblock.models.cost import Budget, Estimate, cost_usd, estimate
from phyblock.models.events import EventKind, ModelEvent, Observer
from phyblock.models.halt import Halt, HaltedError
from phyblock.models.keys import hidden
from phyblock.models.limits import ModelLimiter
from phyblock.models.payload import wire_params
from phyblock.models.retry import RetryPolicy, with_retries
from phyblock.models.transport import Call, SeedRefusedError, Transport

__all__ = ["ChatModel", "ChatParts"]


@dataclass(frozen=True)
class ChatParts:
    """What a chat model is put together from; `secrets` are what no stored text may hold."""

    transport: Transport
    limiter: ModelLimiter
    cache: ReplyCache | None
    budget: Budget | None
    price: Price | None
    policy: RetryPolicy
    secrets: Sequence[str]
    observer: Observer
    halt: Halt


@dataclass
class _Question:
    """A request with its expected size, how often it was sent, what that cost, its last failure."""

    request: Request
    expected: Estimate
    sent: int = 0
    billed_usd: float | None = None
    failure: RetryableError | None = None


class ChatModel:
    """Asks a provider, at most as often as needed."""

    needs_messages = True

    def __init__(self, config: ModelConfig, parts: ChatParts) -> None:
        self.name = config.name
        self._config = config
        self._parts = parts
        self._takes_seed = config.sends_seed != "never"
        self._unavailable: UnavailableError | None = None

    async def ask(self, request: Request) -> Reply:
        """The cached reply, or a new one, which is then cached if it is whole.

        `cost_usd` of a cached reply is what it cost when it was new. Raises what the model seam
        says, BudgetReachedError when the call does not fit, HaltedError when the run ends before it
        is sent, StoreError for a broken cache. A new reply that the cache refuses is returned all
        the same; the StoreError is raised in the place of the next request.
        """
        cache, price = self._parts.cache, self._parts.price
        key = reply_key(self._config, request) if cache is not None else ""
        if cache is not None and (kept := cache.get(key)) is not None:
            return replace(kept, cost_usd=cost_usd(price, kept.usage))
        reply = await self._ask_new(_Question(request, estimate(self._config, request)))
        if cache is not None:
            cache.keep(key, self._config.id, reply)
        return reply

    async def aclose(self) -> None:
        """Release connections."""
        await self._parts.transport.aclose()

    async def _ask_new(self, question: _Question) -> Reply:
        """Send until answered; whatever ends it, what was billed is told."""
        try:
            reply = await with_retries(
                lambda: self._attempt(question),
                replace(self._parts.policy, sleep=self._sleep),
                self._on_retry,
            )
        except (UnavailableError, BudgetReachedError, HaltedError, StoreError):
            if not question.billed_usd:
                raise
            # These leave no record. The attempt that was billed needs one, and the next request
            # meets the same end.
            assert question.failure is not None, "only failures that may pass are billed"
            question.failure.billed_usd = question.billed_usd
            raise question.failure from None
        except ModelError as error:
            error.billed_usd = question.billed_usd
            raise
        return self._finished(reply, question)

    async def _attempt(self, question: _Question) -> Reply:
        expected = question.expected
        limiter = self._parts.limiter
        async with AsyncExitStack() as stack:
            with self._parts.halt.giving_up():
                tokens = expected.prompt_tokens + expected.completion_tokens
                slot = await stack.enter_async_context(limiter.slot(tokens))
            if self._parts.cache is not None:
                self._parts.cache.check()
            if self._unavailable is not None:
                raise UnavailableError(str(self._unavailable), status=self._unavailable.status)
            try:
                reply = await self._send_seeded(question)
            except RetryableError as error:
                question.failure = error
                if error.status == 429 and slot.rate_limited():
                    self._tell("slow_down", str(error), limit=limiter.width)
                raise
            except UnavailableError as error:
                self._stop(error)
                raise
            slot.succeeded(_total(reply))
            return reply

    async def _send_seeded(self, question: _Question) -> Reply:
        """Send with the seed, or without where the provider is known or found to take none.

        That an error speaks of a seed proves nothing, as some repeat the whole request: only a
        reply to the same request without a seed does.
        """
        request = question.request
        params = wire_params(self._config, request)
        seed = request.seed if self._takes_seed else None
        call = Call(request.messages, params, seed)
        try:
            reply = await self._send_paid(call, question)
        except SeedRefusedError as refusal:
            question.sent -= not refusal.sent
            if self._config.sends_seed == "always":
                raise UnavailableError("the provider takes no seed, and seed is `always`") from None
            call = replace(call, seed=None)
            reply = await self._send_paid(call, question)
            if self._takes_seed:
                self._takes_seed = False
                self._tell("seed_unsupported", "takes no seed: seeds are independent repeats")
        return replace(reply, seed_sent=call.seed is not None)

    async def _send_paid(self, call: Call, question: _Question) -> Reply:
        """Send with the call's greatest cost reserved in the budget.

        A failure without a status of the server's own may have been billed, and counts in full;
        a model that is found unable before anything is sent costs nothing.
        """
        budget, price = self._parts.budget, self._parts.price
        if budget is None or price is None:
            question.sent += 1
            return await self._parts.transport.send(call)
        with self._parts.halt.giving_up():
            held = await budget.reserve(budget.most_usd(self.name, price, question.expected))
        spent_usd: float | None = None
        try:
            question.sent += 1
            reply = await self._parts.transport.send(call)
            spent_usd = cost_usd(price, reply.usage)
            budget.learn(self.name, question.expected, reply.usage)
            return reply
        except (SeedRefusedError, UnavailableError):
            spent_usd = 0.0
            raise
        except ModelError as error:
            spent_usd = None if error.status in (None, 200) else 0.0
            raise
        finally:
            counted_usd = budget.settle(held, spent_usd)
            question.billed_usd = (question.billed_usd or 0.0) + counted_usd

    async def _sleep(self, wait_s: float) -> None:
        with self._parts.halt.giving_up():
            await self._parts.policy.sleep(wait_s)

    def _finished(self, reply: Reply, question: _Question) -> Reply:
        secrets = self._parts.secrets
        return replace(
            reply,
            text=hidden(reply.text, secrets, guess=False),
            reasoning=hidden(reply.reasoning, secrets, guess=False),
            cost_usd=cost_usd(self._parts.price, reply.usage),
            billed_usd=question.billed_usd,
            attempts=question.sent,
        )

    def _on_retry(self, error: RetryableError, wait_s: float) -> None:
        self._tell("retry", str(error), wait_s=wait_s)

    def _stop(self, error: UnavailableError) -> None:
        if self._unavailable is None:
            self._unavailable = error
            self._tell("unavailable", str(error))

    def _tell(self, kind: EventKind, message: str, *, wait_s: float = 0.0, limit: int = 0) -> None:
        self._parts.observer(ModelEvent(self.name, kind, message, wait_s, limit))


def _total(reply: Reply) -> int | None:
    used = (reply.usage.prompt_tokens, reply.usage.completion_tokens)
    return None if None in used else sum(n for n in used if n is not None)
