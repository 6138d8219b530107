"""A model behind a network, top to bottom: cache, retries, limits, budget, a server's client."""

from __future__ import annotations

import asyncio
import random
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

from tenacity import AsyncRetrying, RetryCallState, retry_if_exception_type

from phyblock.config.models import DIRECT_PROVIDERS, ModelConfig
from phyblock.errors import (
    BudgetReachedError,
    ModelError,
    RefusedError,
    RetryableError,
    UnavailableError,
)
from phyblock.models.cache import ReplyCache, reply_key
from phyblock.models.client import SeedRefusedError
from phyblock.models.costs import (
    Estimate,
    ModelBudget,
    Prices,
    counted,
    estimate,
    map_entry,
    may_be_billed,
    most_usd,
    reply_cost_usd,
    today,
)
from phyblock.models.limits import Clock, Limits
from phyblock.models.request import Journal, Request, wire_params
from phyblock.models.servers import Server, Servers
from phyblock.records.record import Call, Reply

_FORMAT_HINT = (
    "if the provider takes no JSON schema, set response_format: never for this model in the models "
    "file: the prompt says the form all the same"
)
_SCHEMA_PROVIDERS = ("predibase", "fireworks_ai", "lm_studio", "nebius", "databricks")
"""Providers of which litellm knows that all their models take a schema."""
_SPEAKS_OF_FORMAT = re.compile(
    r"response_?(?:format|schema|json_?schema)|json[_ ]?schema|structured[_ ]outputs?"
    r"|output_(?:format|config)|guided[_ ](?:json|decoding)|\bgrammar\b",
    re.IGNORECASE,
)

EventKind = Literal["retry", "seed_unsupported", "unavailable", "batch"]


@dataclass(frozen=True)
class ModelEvent:
    """Something a user may want to see while a model works.

    `retry`: a request failed, with `status` if the server gave one, and is sent again after
    `wait_s`; `seed_unsupported`: from now on no seed is sent; `unavailable`: nothing more is sent;
    `batch`: one was sent, is waited for or has ended. `message` is safe to show and store.
    """

    model: str
    kind: EventKind
    message: str
    wait_s: float = 0.0
    status: int | None = None


Observer = Callable[[ModelEvent], None]

Tell = Callable[[str], None]
"""Told in plain words what concerns no single model: a server that is gone, a cache that fails."""


@dataclass(frozen=True)
class RetryPolicy:
    """Limits on how often and how long a request is sent again.

    A request is given up when it has failed `attempts` times and `retry_for_s` have passed since
    it first failed, both: attempts that fail at once outlast an outage, attempts that each take
    long are bounded by their number. HTTP 2xx with an unreadable body is an answer that was paid
    for: there the number alone decides.

    The wait before attempt n + 1 is uniform between 0 and min(`max_wait_s`, `base_s` * 2^(n-1)),
    on top of the server's `Retry-After` (followed up to `max_retry_after_s`). Eight attempts leave
    one request in a million unanswered when 18 % of the requests fail.

    A server that has not answered once is given up after `max_connection_failures` tries already:
    its address is probably wrong.
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
        if failures < self.attempts:
            return False
        is_success = error.status is not None and 200 <= error.status < 300
        return is_success or failing_for_s >= self.retry_for_s

    def followed_s(self, error: ModelError) -> float:
        """Return how much of the wait that the server asked for is followed [s]."""
        asked_s = error.retry_after_s if isinstance(error, RetryableError) else None
        return min(asked_s or 0.0, self.max_retry_after_s)

    def retrying(
        self,
        on_retry: Callable[[RetryableError, float], None],
        is_over: Callable[[], bool] = lambda: False,
    ) -> AsyncRetrying:
        """Return tenacity's loop for one request: it goes on after a RetryableError alone.

        `on_retry` hears of the error and the wait [s] before each wait; once `is_over`, nothing is
        tried again.
        """
        first_failure_s: list[float] = []

        def error_of(state: RetryCallState) -> RetryableError:
            error = state.outcome.exception() if state.outcome is not None else None
            assert isinstance(error, RetryableError)
            return error

        def stop(state: RetryCallState) -> bool:
            now_s = self.clock.now()
            first_failure_s.append(now_s)
            lasted_s = now_s - first_failure_s[0]
            return is_over() or self.gives_up(error_of(state), state.attempt_number, lasted_s)

        def wait(state: RetryCallState) -> float:
            doubled_s = self.base_s * 2.0 ** min(state.attempt_number - 1, 60)
            jitter_s = random.uniform(0.0, min(self.max_wait_s, doubled_s))
            return self.followed_s(error_of(state)) + jitter_s

        def before_sleep(state: RetryCallState) -> None:
            wait_s = state.next_action.sleep if state.next_action is not None else 0.0
            on_retry(error_of(state), wait_s)

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
    """A request with what it is expected to take, how often it was sent and what that cost, its
    last failure that may pass and the server that failed. `is_cancelled`: it is not sent again.
    """

    request: Request
    key: str
    expected: Estimate
    sent: int = 0
    billed_usd: float | None = None
    failure: RetryableError | None = None
    failed_at: Server | None = None
    is_cancelled: bool = False


class ChatModel:
    """Asks a provider, at most as often as needed."""

    needs_messages = True

    def __init__(
        self,
        config: ModelConfig,
        servers: Servers,
        limits: Limits,
        *,
        cache: ReplyCache | None,
        budget: ModelBudget | None,
        prices: Prices | None,
        journal: Journal | None,
        policy: RetryPolicy,
        observer: Observer,
    ) -> None:
        self.name = config.name
        self._config = config
        self._servers = servers
        self._limits = limits
        self._cache = cache
        self._budget = budget
        self._prices = prices
        self._journal = journal
        self._policy = policy
        self._observer = observer
        self._takes_seed = config.seed != "never"
        self._took_format = False
        self._is_told_unavailable = False

    async def ask(self, request: Request) -> Reply:
        """Return the cached reply, or a new one, which is then cached if it is whole.

        `cost_usd` of a cached reply is what it would cost today. Raises what the model seam says,
        and BudgetReachedError when the call does not fit.

        Cancelled while it waits, it gives up at once. Cancelled while a request is under way, which
        is paid for, it returns the answer; a second cancellation gives that up too.
        """
        if self._cache is None and self._journal is None:
            return await self._ask(request, "")
        key = reply_key(self._config, request)
        if self._journal is not None and (answered := self._journal.kept(key)) is not None:
            return answered
        if self._cache is None:
            return await self._ask(request, key)
        async with self._cache.asking(key):
            kept = self._cache.get(key)
            if kept is not None:
                return kept.model_copy(update={"cost_usd": self._cost_usd(kept)})
            reply = await self._ask(request, key)
            self._cache.put(key, self._config.id, reply)
            return reply

    @property
    def under_way(self) -> int:
        """Requests that were sent and are not answered."""
        return sum(server.under_way for server in self._servers.all)

    async def aclose(self) -> None:
        """Release connections."""
        for server in self._servers.all:
            await server.client.aclose()

    async def _ask(self, request: Request, key: str) -> Reply:
        """Send until answered; whatever ends it, what was billed is reported."""
        call = _Call(request, key, estimate(self._config, request))

        def on_retry(error: RetryableError, wait_s: float) -> None:
            if call.failed_at is not None:
                self._servers.pause(call.failed_at, error, wait_s)
            self._tell("retry", str(error), wait_s, error.status)

        try:
            async for attempt in self._policy.retrying(on_retry, lambda: call.is_cancelled):
                with attempt:
                    return await self._attempt(call)
        except (UnavailableError, BudgetReachedError, asyncio.CancelledError) as error:
            if isinstance(error, UnavailableError) and not self._is_told_unavailable:
                self._is_told_unavailable = True
                self._tell("unavailable", str(error))
            if not call.billed_usd or call.failure is None:
                raise
            # These leave no record. The attempt that was billed needs one, and the next request
            # meets the same end.
            call.failure.billed_usd = call.billed_usd
            raise call.failure from None
        except ModelError as error:
            if call.is_cancelled and isinstance(error, RetryableError) and not call.billed_usd:
                # It would have been sent again, and nothing is known that a record could say.
                raise asyncio.CancelledError from None
            error.billed_usd = call.billed_usd
            raise
        raise AssertionError("tenacity neither returned nor raised")

    async def _attempt(self, call: _Call) -> Reply:
        """Send once, at a server that does not refuse everything."""
        expected, clock = call.expected, self._policy.clock
        while True:
            async with self._limits.slot(
                expected.prompt_tokens + expected.completion_tokens
            ) as slot:
                server = self._servers.pick(call.failed_at)
                began_s = clock.now()
                try:
                    reply = await self._send_as_taken(call, server)
                except ModelError as error:
                    who = (self.name, call.request.key, call.request.seed)
                    if isinstance(error, RetryableError):
                        call.failure, call.failed_at = error, server
                    is_servers_fault = self._servers.failed(server, error, who, began_s)
                    self._servers.usable()
                    if is_servers_fault and not call.is_cancelled:
                        continue
                    raise
                self._servers.replied(server)
                used = (reply.usage.prompt_tokens, reply.usage.completion_tokens)
                if None not in used:
                    self._limits.settle(slot, sum(n for n in used if n is not None))
                return reply

    async def _send_as_taken(self, call: _Call, server: Server) -> Reply:
        """Send with the seed and the format of the answer, as far as the provider takes them.

        That an error speaks of a seed proves nothing, as some repeat the whole request: only a
        reply to the same request without a seed does. A provider that refuses the format would
        refuse it every time; one that has taken it once means something else.
        """
        with_seed = self._takes_seed
        try:
            try:
                reply = await self._send(call, server, with_seed=with_seed)
            except SeedRefusedError as error:
                call.sent -= error.sent == "no"
                if self._config.seed == "always":
                    why = "the provider takes no seed, and seed is `always`"
                    raise UnavailableError(why) from None
                reply = await self._send(call, server, with_seed=False)
                if self._takes_seed:
                    self._takes_seed = False
                    self._tell("seed_unsupported", "takes no seed: seeds are independent repeats")
        except ModelError as error:
            refused = format_refused(self._config, call.request, error)
            if refused is None or self._took_format:
                raise
            raise refused from None
        self._took_format = True
        return reply

    async def _send(self, call: _Call, server: Server, *, with_seed: bool) -> Reply:
        """Send with the call's greatest cost reserved in the budget and written in the journal.

        A failure that may have been billed counts in full; a model that is found unable before
        anything is sent costs nothing.
        """
        budget = self._budget
        held: int | None = None
        if budget is not None and self._most_usd(call) is not None:
            held = await budget.reserve(lambda: self._most_usd(call) or 0.0)
        exchange = asyncio.ensure_future(self._exchange(call, server, held, with_seed=with_seed))
        try:
            return await asyncio.shield(exchange)
        except asyncio.CancelledError:
            call.is_cancelled = True
            return await exchange

    async def _exchange(
        self, call: _Call, server: Server, held: int | None, *, with_seed: bool
    ) -> Reply:
        """Write that a call is sent, send it, and write what became of it."""
        budget, journal = self._budget, self._journal
        written: Call | None = None
        reply: Reply | None = None
        spent_usd: float | None = 0.0
        try:
            if journal is not None:
                sample, most_usd = call.request.sample, self._most_usd(call)
                written = await journal.sent(self.name, sample, call.key, most_usd)
                if call.is_cancelled:
                    raise asyncio.CancelledError
            call.sent += 1
            server.sent += 1
            server.under_way += 1
            spent_usd = None
            try:
                reply = await server.client.complete(call.request, with_seed=with_seed)
            finally:
                server.under_way -= 1
            reply = counted(reply, call.expected)
            spent_usd = self._cost_usd(reply)
            if budget is not None:
                budget.learn(call.expected, reply.usage)
        except UnavailableError:
            spent_usd = 0.0
            raise
        except ModelError as error:
            spent_usd = None if may_be_billed(error) else 0.0
            raise
        except Exception:
            # A bug of ours, which ends the run, is not charged.
            spent_usd = 0.0
            raise
        finally:
            if held is not None and budget is not None:
                spent_usd = budget.settle(held, spent_usd)
                call.billed_usd = (call.billed_usd or 0.0) + spent_usd
            if reply is not None:
                known = {"billed_usd": call.billed_usd, "attempts": call.sent}
                reply = reply.model_copy(update={"cost_usd": self._cost_usd(reply), **known})
            if journal is not None and written is not None:
                await journal.ended(written, spent_usd, reply)
        return reply

    def _most_usd(self, call: _Call) -> float | None:
        """Return the most that a call can cost by now; None where no price is known."""
        day, prices = today(), self._prices
        if prices is None or prices.on(day) is None:
            return None
        if self._budget is None:
            return most_usd(prices, call.expected, day)
        return self._budget.most_usd(prices, call.expected, day)

    def _cost_usd(self, reply: Reply) -> float | None:
        return reply_cost_usd(self._prices, reply, today())

    def _tell(
        self, kind: EventKind, message: str, wait_s: float = 0.0, status: int | None = None
    ) -> None:
        self._observer(ModelEvent(self.name, kind, message, wait_s, status))


def format_refused(
    config: ModelConfig, request: Request, error: ModelError
) -> UnavailableError | None:
    """Return the error of a provider that does not take the `response_format` that was sent; None
    where an error cannot mean that.
    """
    is_sent = "response_format" in wire_params(config, request)
    may_refuse = error.status in (400, 422) or error.sent == "no"
    if not is_sent or not may_refuse or isinstance(error, RefusedError):
        return None
    if _SPEAKS_OF_FORMAT.search(str(error)) is None:
        return None
    return UnavailableError(f"{error} ({_FORMAT_HINT})", status=error.status, sent=error.sent)


def takes_format(config: ModelConfig) -> bool:
    """Return True if a model is taken to accept a JSON schema as `response_format`.

    Self-hosted servers that speak the OpenAI protocol (vLLM, SGLang, llama.cpp, LM Studio, Ollama)
    do; of all others litellm's map of models is believed.
    """
    if config.provider in DIRECT_PROVIDERS and config.has_address:
        return True
    is_known = config.provider in _SCHEMA_PROVIDERS
    return is_known or bool(map_entry(config).get("supports_response_schema"))
