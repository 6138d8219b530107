"""A model behind a network, top to bottom: cache, retries, limits, budget, a server's client."""

from __future__ import annotations

import asyncio
import random
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

from tenacity import AsyncRetrying, RetryCallState, retry_if_exception_type

from phyblock.config.models import DIRECT_PROVIDERS, ModelConfig
from phyblock.errors import ModelError, RetryableError, UnavailableError
from phyblock.models.cache import ReplyCache, reply_key
from phyblock.models.costs import (
    Estimate,
    ModelBudget,
    cost_usd,
    counted,
    estimate,
    map_entry,
    may_be_billed,
)
from phyblock.models.limits import Clock, Limits
from phyblock.models.request import Journal, Request
from phyblock.models.servers import Server, Servers
from phyblock.records.record import Call, Reply

_SCHEMA_PROVIDERS = ("predibase", "fireworks_ai", "lm_studio", "nebius", "databricks")
"""Providers whose models, as litellm knows, all accept a schema."""

EventKind = Literal["retry", "batch"]


@dataclass(frozen=True)
class ModelEvent:
    """An event of a model that a user may want to see.

    `retry`: a request failed, with `status` if the server gave one, and is sent again after
    `wait_s`; `batch`: one was sent, is waited for or has ended. `message` is safe to show.
    """

    model: str
    kind: EventKind
    message: str
    wait_s: float = 0.0
    status: int | None = None


Observer = Callable[[ModelEvent], None]

Tell = Callable[[str], None]
"""Called with what concerns no single model: a server that is gone, a cache that fails."""


@dataclass(frozen=True)
class RetryPolicy:
    """Limits on how often and how long a request is sent again.

    A request is given up when it has failed `attempts` times and `retry_for_s` have passed since
    it first failed, both. HTTP 2xx with an unreadable body is an answer that was paid for: there
    the number alone decides.

    The wait before attempt n + 1 is uniform between 0 and min(`max_wait_s`, `base_s` * 2^(n-1)),
    on top of the server's `Retry-After` (followed up to `max_retry_after_s`). A server that has not
    answered once is given up after `max_connection_failures` tries: its address is probably wrong.
    """

    attempts: int = 8
    retry_for_s: float = 300.0
    max_connection_failures: int = 20
    base_s: float = 0.5
    max_wait_s: float = 60.0
    max_retry_after_s: float = 120.0
    clock: Clock = field(default_factory=Clock)

    def gives_up(self, error: ModelError, failures: int, failing_for_s: float) -> bool:
        """Return True if what failed so often and so long is not tried again."""
        is_success = error.status is not None and 200 <= error.status < 300
        return failures >= self.attempts and (is_success or failing_for_s >= self.retry_for_s)

    def followed_s(self, error: ModelError) -> float:
        """Return how much of the wait that the server asked for is followed [s]."""
        return min(getattr(error, "retry_after_s", None) or 0.0, self.max_retry_after_s)

    def retrying(
        self,
        on_retry: Callable[[RetryableError, float], None],
        is_over: Callable[[], bool] = lambda: False,
    ) -> AsyncRetrying:
        """Return tenacity's loop for one request: it goes on after a RetryableError alone.

        `on_retry` is called with the error and the wait [s] before each wait; once `is_over`,
        nothing is tried again.
        """
        first_failure_s: list[float] = []

        def error_of(state: RetryCallState) -> RetryableError:
            error = state.outcome.exception() if state.outcome is not None else None
            assert isinstance(error, RetryableError)
            return error

        def stop(state: RetryCallState) -> bool:
            first_failure_s.append(self.clock.now())
            lasted_s = first_failure_s[-1] - first_failure_s[0]
            return is_over() or self.gives_up(error_of(state), state.attempt_number, lasted_s)

        def wait(state: RetryCallState) -> float:
            doubled_s = self.base_s * 2.0 ** min(state.attempt_number - 1, 60)
            return self.followed_s(error_of(state)) + random.uniform(
                0.0, min(self.max_wait_s, doubled_s)
            )

        def before_sleep(state: RetryCallState) -> None:
            on_retry(error_of(state), state.upcoming_sleep)

        return AsyncRetrying(
            sleep=self.clock.sleep,
            stop=stop,
            wait=wait,
            retry=retry_if_exception_type(RetryableError),
            before_sleep=before_sleep,
            reraise=True,
        )


@dataclass
class _Call:
    """A request with what it is expected to take, how often it was sent, what that cost, and the
    server that failed last. `is_cancelled`: it is not sent again.
    """

    request: Request
    key: str
    expected: Estimate
    sent: int = 0
    billed_usd: float | None = None
    failed_at: Server | None = None
    is_cancelled: bool = False


@dataclass(eq=False, kw_only=True)
class ChatModel:
    """Asks a provider, at most as often as needed."""

    config: ModelConfig
    servers: Servers
    limits: Limits
    cache: ReplyCache | None = None
    budget: ModelBudget
    journal: Journal | None = None
    policy: RetryPolicy
    observer: Observer
    needs_messages: bool = field(default=True, init=False)

    def __post_init__(self) -> None:
        self.name = self.config.name

    async def ask(self, request: Request) -> Reply:
        """Return the cached reply, or a new one, which is then cached if it is whole.

        `cost_usd` of a cached reply is what it would cost today. Raises what the model seam says,
        and BudgetReachedError when the call does not fit.

        Cancelled while it waits, it gives up at once. Cancelled while a request is under way, which
        is paid for, it returns the answer; a second cancellation gives that up too.
        """
        is_keyed = self.cache is not None or self.journal is not None
        key = reply_key(self.config, request) if is_keyed else ""
        if self.journal is not None and (answered := self.journal.kept(key)) is not None:
            return answered
        if self.cache is None:
            return await self._ask(request, key)
        async with self.cache.asking(key):
            kept = self.cache.get(key)
            if kept is not None:
                return kept.model_copy(update={"cost_usd": self._cost_usd(kept)})
            reply = await self._ask(request, key)
            self.cache.put(key, self.config.id, reply)
            return reply

    @property
    def under_way(self) -> int:
        """Requests that were sent and are not answered."""
        return sum(server.under_way for server in self.servers.all)

    async def aclose(self) -> None:
        """Release connections."""
        for server in self.servers.all:
            await server.client.aclose()

    async def _ask(self, request: Request, key: str) -> Reply:
        """Send until answered; whatever ends it, what was billed is reported."""
        call = _Call(request, key, estimate(self.config, request))

        def on_retry(error: RetryableError, wait_s: float) -> None:
            if call.failed_at is not None:
                self.servers.pause(call.failed_at, error, wait_s)
            self.observer(ModelEvent(self.name, "retry", str(error), wait_s, error.status))

        try:
            async for attempt in self.policy.retrying(on_retry, lambda: call.is_cancelled):
                with attempt:
                    return await self._attempt(call)
        except ModelError as error:
            if call.is_cancelled and isinstance(error, RetryableError):
                # It would have been sent again.
                raise asyncio.CancelledError from None
            error.billed_usd = call.billed_usd
            raise
        raise AssertionError("tenacity neither returned nor raised")

    async def _attempt(self, call: _Call) -> Reply:
        """Send once, at a server that does not refuse everything."""
        expected, who = call.expected, (self.name, call.request.key, call.request.seed)
        while True:
            async with self.limits.slot(
                expected.prompt_tokens + expected.completion_tokens
            ) as slot:
                server, began_s = self.servers.pick(call.failed_at), self.policy.clock.now()
                try:
                    reply = await self._send(call, server)
                except ModelError as error:
                    if isinstance(error, RetryableError):
                        call.failed_at = server
                    is_servers_fault = self.servers.failed(server, error, who, began_s)
                    self.servers.usable()
                    if is_servers_fault and not call.is_cancelled:
                        continue
                    raise
                self.servers.heard(server)
                prompt, completion = reply.usage.prompt_tokens, reply.usage.completion_tokens
                if prompt is not None and completion is not None:
                    self.limits.settle(slot, prompt + completion)
                return reply

    async def _send(self, call: _Call, server: Server) -> Reply:
        """Send with the call's greatest cost reserved in the budget."""
        held = None
        if self.budget.tariff is not None:
            held = await self.budget.reserve(lambda: self._most_usd(call) or 0.0)
        exchange = asyncio.ensure_future(self._exchange(call, server, held))
        try:
            return await asyncio.shield(exchange)
        except asyncio.CancelledError:
            call.is_cancelled = True
            return await exchange

    async def _exchange(self, call: _Call, server: Server, held: int | None) -> Reply:
        """Write that a call is sent, send it, and write what became of it.

        A failure that may have been billed counts in full; a model that is found unable before
        anything is sent, and a bug of ours, which ends the run, cost nothing.
        """
        written: Call | None = None
        reply: Reply | None = None
        spent_usd: float | None = 0.0
        try:
            if self.journal is not None:
                sample, most_usd = call.request.sample, self._most_usd(call)
                written = await self.journal.sent(self.name, sample, call.key, most_usd)
                if call.is_cancelled:
                    raise asyncio.CancelledError
            call.sent += 1
            server.sent += 1
            server.under_way += 1
            spent_usd = None
            try:
                reply = await server.client.complete(call.request)
            finally:
                server.under_way -= 1
            reply = counted(reply, call.expected)
            spent_usd = self._cost_usd(reply)
            self.budget.learn(call.expected, reply.usage)
        except ModelError as error:
            is_free = isinstance(error, UnavailableError) or not may_be_billed(error)
            spent_usd = 0.0 if is_free else None
            raise
        except Exception:
            spent_usd = 0.0
            raise
        finally:
            if held is not None:
                spent_usd = self.budget.settle(held, spent_usd)
                call.billed_usd = (call.billed_usd or 0.0) + spent_usd
            if reply is not None:
                known = {"billed_usd": call.billed_usd, "attempts": call.sent}
                reply = reply.model_copy(update={"cost_usd": self._cost_usd(reply), **known})
            if self.journal is not None and written is not None:
                await self.journal.ended(written, spent_usd, reply)
        return reply

    def _most_usd(self, call: _Call) -> float | None:
        return self.budget.most_usd(call.expected)

    def _cost_usd(self, reply: Reply) -> float | None:
        return cost_usd(self.budget.tariff, reply)


def takes_format(config: ModelConfig) -> bool:
    """Return True if a model is taken to accept a JSON schema as `response_format`.

    Self-hosted servers that speak the OpenAI protocol (vLLM, SGLang, llama.cpp, LM Studio, Ollama)
    do; of all others litellm's map of models is believed.
    """
    is_own = config.provider in DIRECT_PROVIDERS and config.has_address
    is_known = is_own or config.provider in _SCHEMA_PROVIDERS
    return is_known or bool(map_entry(config).get("supports_response_schema"))
