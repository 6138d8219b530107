"""A model behind a network: the cache, then retries; for each attempt those who ask the same,
a server that can be reached, limits, budget, transport.
"""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from contextlib import AbstractAsyncContextManager, AsyncExitStack
from dataclasses import dataclass, replace

from phyblock.config.models import ModelConfig
from phyblock.errors import (
    BudgetReachedError,
    ModelError,
    RetryableError,
    UnavailableError,
)
from phyblock.models.base import Request
from phyblock.models.cache import ReplyCache, reply_key
from phyblock.models.costs import Budget, estimate
from phyblock.models.events import EventKind, ModelEvent, Observer
from phyblock.models.halt import Halt, HaltedError
from phyblock.models.keys import hidden
from phyblock.models.limits import ModelLimiter, Slot
from phyblock.models.pace import Mark, is_late, says_too_much
from phyblock.models.prices import Prices
from phyblock.models.replicas import Replica, Replicas
from phyblock.models.retry import RetryPolicy, with_retries
from phyblock.models.sender import Outlay, Sender
from phyblock.records.reply import Reply

__all__ = ["ChatModel", "ChatParts"]


@dataclass(frozen=True)
class ChatParts:
    """What a chat model is put together from; `secrets` are what no stored text may hold."""

    replicas: Replicas
    limiter: ModelLimiter
    cache: ReplyCache | None
    budget: Budget | None
    prices: Prices | None
    policy: RetryPolicy
    secrets: Sequence[str]
    observer: Observer
    halt: Halt


@dataclass
class _Question:
    """A request with its key in the cache and its outlay, its last failure and the server that
    failed, its reply.
    """

    request: Request
    key: str
    outlay: Outlay
    failure: RetryableError | None = None
    failed_at: Replica | None = None
    reply: Reply | None = None


class ChatModel:
    """Asks a provider, at most as often as needed."""

    needs_messages = True

    def __init__(self, config: ModelConfig, parts: ChatParts) -> None:
        self.name = config.name
        self._config = config
        self._parts = parts
        self._sender = Sender(config, parts.budget, parts.prices, parts.halt, self._say_seedless)
        self._unavailable: UnavailableError | None = None

    async def ask(self, request: Request) -> Reply:
        """The cached reply, or a new one, which is then cached if it is whole.

        `cost_usd` of a cached reply is what it would cost today. Raises what the model seam
        says, BudgetReachedError when the call does not fit, HaltedError when the run ends before it
        is sent.
        """
        cache = self._parts.cache
        key = ""
        if cache is not None:
            key = reply_key(self._config, request)
            kept = cache.get(key)
            if kept is not None:
                return kept.model_copy(update={"cost_usd": self._sender.cost_usd(kept)})
        outlay = Outlay(estimate(self._config, request))
        return await self._ask_new(_Question(request, key, outlay))

    async def aclose(self) -> None:
        """Release connections."""
        await self._parts.replicas.aclose()

    async def _ask_new(self, question: _Question) -> Reply:
        """Send until answered; whatever ends it, what was billed is told.

        A cancellation that comes when the reply is in hand is too late: the reply is returned, so
        that it is recorded.
        """
        policy = self._parts.policy
        clock = replace(policy.clock, sleep=self._pause)
        try:
            return await with_retries(
                lambda: self._attempt(question), replace(policy, clock=clock), self._on_retry
            )
        except asyncio.CancelledError:
            if question.reply is None:
                raise
            return question.reply
        except (UnavailableError, BudgetReachedError, HaltedError):
            if not question.outlay.billed_usd:
                raise
            # These leave no record. The attempt that was billed needs one, and the next request
            # meets the same end.
            assert question.failure is not None, "only failures that may pass are billed"
            question.failure.billed_usd = question.outlay.billed_usd
            raise question.failure from None
        except ModelError as error:
            error.billed_usd = question.outlay.billed_usd
            raise

    async def _attempt(self, question: _Question) -> Reply:
        """Send once, when it is this question's turn, or find the reply to it meanwhile."""
        while True:
            async with AsyncExitStack() as stack:
                cache = self._parts.cache
                with self._parts.halt.giving_up():
                    if cache is not None and await stack.enter_async_context(
                        cache.asking(question.key)
                    ):
                        kept = cache.get(question.key)
                        if kept is not None:
                            return self._found(kept, question)
                    probed = await stack.enter_async_context(self._parts.replicas.passing())
                    self._fit_width()
                    slot = await stack.enter_async_context(self._slot(question))
                if self._unavailable is not None:
                    raise UnavailableError(str(self._unavailable), status=self._unavailable.status)
                replica = self._parts.replicas.choose(probed, question.failed_at)
                if replica is None:
                    continue
                reply = await self._send_watched(question, replica, is_probe=probed is replica)
                if reply is None:
                    continue
                question.reply = reply
                slot.settle(_total(reply))
                if cache is not None:
                    cache.put(question.key, self._config.id, reply)
                return reply

    def _slot(self, question: _Question) -> AbstractAsyncContextManager[Slot]:
        expected = question.outlay.expected
        return self._parts.limiter.slot(expected.prompt_tokens + expected.completion_tokens)

    async def _send_watched(
        self, question: _Question, replica: Replica, *, is_probe: bool
    ) -> Reply | None:
        """Send, and tell the pace and the breaker what came of it; None where it is the server
        that failed, and not this request.
        """
        breaker, replicas = replica.breaker, self._parts.replicas
        try:
            with replica.asked() as mark:
                reply = await self._sender.send(
                    question.request, question.outlay, replica.transport
                )
        except ModelError as error:
            sender = (self.name, question.request.key, question.request.seed)
            breaker.failed(error, sender, is_probe=is_probe)
            if isinstance(error, UnavailableError):
                if replicas.leave_out(replica, error):
                    return None
                self._stop(error)
            elif isinstance(error, RetryableError):
                question.failure = error
                question.failed_at = replica
                self._slow_down(error, replica, mark)
                replicas.raise_if_none_left()
                if breaker.is_open and breaker.is_outage(error):
                    return None
            raise
        breaker.replied()
        replica.pace.answered(mark, reply.latency_s)
        self._fit_width()
        return self._finished(reply, question)

    def _slow_down(self, error: RetryableError, replica: Replica, mark: Mark) -> None:
        """Send less at once to a server that has too much to do."""
        pace = replica.pace
        is_cut = (says_too_much(error) and pace.refused(mark)) or (
            is_late(error) and pace.late(mark)
        )
        if is_cut:
            width = self._fit_width()
            self._tell("slow_down", str(error), limit=width, status=error.status)

    def _fit_width(self) -> int:
        """Have as many requests under way as the servers may have now; how many that is."""
        width = self._parts.limiter.width = self._parts.replicas.width
        return width

    async def _pause(self, wait_s: float) -> None:
        with self._parts.halt.giving_up():
            await self._parts.policy.clock.sleep(wait_s)

    def _found(self, kept: Reply, question: _Question) -> Reply:
        """A reply that another brought, with what attempts of our own had cost before."""
        return kept.model_copy(
            update={
                "cost_usd": self._sender.cost_usd(kept),
                "billed_usd": question.outlay.billed_usd,
                "attempts": question.outlay.sent,
            }
        )

    def _finished(self, reply: Reply, question: _Question) -> Reply:
        secrets = self._parts.secrets
        return reply.model_copy(
            update={
                "text": hidden(reply.text, secrets, guess=False),
                "reasoning": hidden(reply.reasoning, secrets, guess=False),
                "cost_usd": self._sender.cost_usd(reply),
                "billed_usd": question.outlay.billed_usd,
                "attempts": question.outlay.sent,
            }
        )

    def _on_retry(self, error: RetryableError, wait_s: float) -> None:
        self._tell("retry", str(error), wait_s=wait_s, status=error.status)

    def _say_seedless(self) -> None:
        self._tell("seed_unsupported", "takes no seed: seeds are independent repeats")

    def _stop(self, error: UnavailableError) -> None:
        if self._unavailable is None:
            self._unavailable = error
            self._tell("unavailable", str(error))

    def _tell(
        self,
        kind: EventKind,
        message: str,
        *,
        wait_s: float = 0.0,
        limit: int = 0,
        status: int | None = None,
    ) -> None:
        self._parts.observer(ModelEvent(self.name, kind, message, wait_s, limit, status))


def _total(reply: Reply) -> int | None:
    used = (reply.usage.prompt_tokens, reply.usage.completion_tokens)
    return None if None in used else sum(n for n in used if n is not None)
