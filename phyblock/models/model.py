"""A model from its configuration to its reply: cache, retries, limits, budget, servers, client."""

from __future__ import annotations

import asyncio
import contextlib
import math
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import tenacity

from phyblock.config.models import DIRECT_PROVIDERS, ModelConfig
from phyblock.errors import ModelError, Problem, RetryableError, SpecError, UnavailableError
from phyblock.models import costs
from phyblock.models.cache import ReplyCache, reply_key
from phyblock.models.client import Client, HttpClient, OpenAIClient
from phyblock.models.costs import Budget, Estimate, ModelBudget, Reservation
from phyblock.models.replay import open_baseline, open_replay
from phyblock.models.request import Journal, Model, Request
from phyblock.records.record import Call, Reply

if TYPE_CHECKING:
    from phyblock.models.batch import BatchFiles


@dataclass(frozen=True)
class ModelEvent:
    """An event of a model, or of the whole run ("") to show to the user, with a safe message.

    `retry`: a request failed and is sent again after `wait_s`; `notice`: news of a batch, of the
    cache, or of a server that is no longer used; `stopped`: the model is not available.
    """

    model: str
    kind: Literal["retry", "notice", "stopped"]
    message: str
    wait_s: float = 0.0


Report = Callable[[ModelEvent], None]


@dataclass(frozen=True)
class RetryPolicy:
    """Limits on how often and how long a request is sent again.

    A request is given up when it has failed `attempts` times and `retry_for_s` have passed since
    the first. An unreadable answer with HTTP 2xx was paid for, so only `attempts` apply to it.

    The wait before attempt n + 1 is uniform between 0 and min(`max_wait_s`, `base_s` * 2^(n-1)), on
    top of the server's `Retry-After` (followed up to `max_retry_after_s`), by `now` and `sleep`.
    """

    attempts: int = 8
    retry_for_s: float = 300.0
    base_s: float = 0.5
    max_wait_s: float = 60.0
    max_retry_after_s: float = 120.0
    now: Callable[[], float] = time.monotonic
    sleep: Callable[[float], Awaitable[None]] = asyncio.sleep

    def followed_s(self, error: ModelError) -> float:
        """Return the part of the server's requested wait that is followed [s]."""
        return min(getattr(error, "retry_after_s", None) or 0.0, self.max_retry_after_s)

    def retrying(self, model: str, report: Report) -> tenacity.AsyncRetrying:
        """Return tenacity's loop for a request that repeats RetryableErrors and reports waits."""
        failed_s: list[float] = []

        def error_of(state: tenacity.RetryCallState) -> RetryableError:
            error = state.outcome.exception() if state.outcome is not None else None
            assert isinstance(error, RetryableError)
            return error

        def stop(state: tenacity.RetryCallState) -> bool:
            # tenacity's stop_after_delay would count the wait for a place before the first attempt.
            failed_s.append(self.now())
            was_paid = 200 <= (error_of(state).status or 0) < 300
            is_over = was_paid or failed_s[-1] - failed_s[0] >= self.retry_for_s
            return is_over and state.attempt_number >= self.attempts

        return tenacity.AsyncRetrying(
            sleep=self.sleep,
            stop=stop,
            wait=tenacity.wait_combine(
                tenacity.wait_random_exponential(self.base_s, self.max_wait_s),
                lambda state: self.followed_s(error_of(state)),
            ),
            retry=tenacity.retry_if_exception_type(RetryableError),
            before_sleep=lambda state: report(
                ModelEvent(model, "retry", str(error_of(state)), state.upcoming_sleep)
            ),
            reraise=True,
        )


MOST_CONNECTION_FAILURES = 10
"""Minimum number of failures in a row before a server is given up."""
_STARTING_S = 60.0
"""Time in which a server that has never answered may start before it is given up [s]."""
_GATEWAY = (502, 503, 504)
_TOO_MUCH = (429, 529)


@dataclass(eq=False)
class Server:
    """One server with the number of its requests `under_way`, and of all for which it was `chosen`.

    It failed `failures` times in a row, first at `failing_since_s`, and gets no request before
    `cool_at_s`, or while it `is_tried`; `refusal` is the reason why it is no longer used.
    """

    name: str
    client: Client
    under_way: int = 0
    chosen: int = 0
    was_heard: bool = False
    failures: int = 0
    failing_since_s: float = 0.0
    cool_at_s: float = float("-inf")
    is_tried: bool = False
    refusal: UnavailableError | None = None


@dataclass(eq=False)
class Servers:
    """Chooses among the servers of a model: the least loaded one that is not cooling down.

    A server cools down after two failed or lost connections or gateway errors (502, 503, 504) in a
    row, longer with each further one, then gets one request at a time until it answers. It also
    cools down after a 429 or 529, and always at least for the `Retry-After` that is followed. A
    timeout shows nothing: some requests are slow. `report` gets a sentence if one is given up.
    """

    all: tuple[Server, ...]
    policy: RetryPolicy
    report: Callable[[str], None]

    def usable(self) -> list[Server]:
        """Return the servers that are not given up. Raises UnavailableError if there are none."""
        usable = [server for server in self.all if server.refusal is None]
        if not usable and (refusal := self.all[-1].refusal) is not None:
            raise UnavailableError(str(refusal), status=refusal.status, sent=refusal.sent)
        return usable

    def cooling_s(self) -> float:
        """Return the time until a server may be used [s]. Raises UnavailableError as `usable`."""
        return min(map(self._rests_s, self.usable()))

    def _rests_s(self, server: Server) -> float:
        if server.is_tried:
            return math.inf
        return max(0.0, server.cool_at_s - self.policy.now())

    @contextlib.contextmanager
    def chosen(self, failed: Server | None = None) -> Iterator[Server]:
        """Hold a place at a chosen server. One that just `failed` the request is the last choice.

        It is chosen when the request is admitted, so that a server that is down gets only one.
        """
        server = min(
            self.usable(), key=lambda s: (self._rests_s(s), s is failed, s.under_way, s.chosen)
        )
        is_trial = server.failures > 1 and not server.is_tried
        server.is_tried |= is_trial
        server.chosen += 1
        server.under_way += 1
        try:
            yield server
        finally:
            server.under_way -= 1
            server.is_tried &= not is_trial

    def failed(self, server: Server, error: ModelError, sent_s: float) -> None:
        """Record that a request sent at `sent_s` failed.

        A server is given up if it refuses every request, or fails many times in a row for as long
        as a request is retried, at most `_STARTING_S` if it has never answered.
        """
        policy, now_s = self.policy, self.policy.now()
        server.was_heard |= error.status is not None
        is_down = error.sent in ("no", "lost") or error.status in _GATEWAY
        if is_down and sent_s >= server.cool_at_s:
            # Requests that were sent before its last failure show nothing new.
            server.failing_since_s = server.failing_since_s if server.failures else now_s
            server.failures += 1
        elif not is_down and error.sent == "answered":
            server.failures = 0
        if is_down or error.status in _TOO_MUCH:
            times = server.failures - 1 if is_down else 1
            wait_s = min(policy.base_s * times, policy.max_wait_s)
            until_s = now_s + max(wait_s, policy.followed_s(error))
            server.cool_at_s = max(server.cool_at_s, until_s)
        lasted_s = now_s - server.failing_since_s
        patience_s = policy.retry_for_s if server.was_heard else _STARTING_S
        is_over = lasted_s >= min(patience_s, policy.retry_for_s)
        if is_over and server.failures >= MOST_CONNECTION_FAILURES:
            why = f"{server.name} could not be reached for {lasted_s:.0f} s: {error}"
            error = UnavailableError(why, sent="no")
        if isinstance(error, UnavailableError):
            is_first, server.refusal = server.refusal is None, error
            if is_first and any(other.refusal is None for other in self.all):
                self.report(f"{server.name} is not used any more: {error}")


class Limits:
    """The limits of one model: requests in progress, and requests and tokens per minute.

    Each rate delays the next start by a request's share of a minute, so starts are evenly spaced,
    and one of more than a minute's tokens is sent, too. `overall` is shared by all models of a run.
    """

    def __init__(self, config: ModelConfig, overall: asyncio.Semaphore, servers: Servers) -> None:
        self._under_way = asyncio.Semaphore(config.max_concurrency)
        self._overall = overall
        self._servers = servers
        self._policy = servers.policy
        self._request_s = 60.0 / config.rpm if config.rpm else 0.0
        self._token_s = 60.0 / config.tpm if config.tpm else 0.0
        self._next_by_requests_s = self._next_by_tokens_s = float("-inf")
        self._admission = asyncio.Lock()

    @contextlib.asynccontextmanager
    async def slot(self, tokens: int = 0, failed: Server | None = None) -> AsyncIterator[Server]:
        """Hold a place of the model and of the whole run, at a chosen server.

        Requests are admitted one by one; a waiting model holds no place that others could use.
        `tokens` are the most of the request; a server that just `failed` it is the last choice.
        """
        async with self._under_way:
            async with self._admission:
                while (wait_s := self._wait_s()) > 0:
                    # In short waits, since tokens may be released or the last server given up.
                    await self._policy.sleep(min(wait_s, 1.0))
                await self._overall.acquire()
                now_s = self._policy.now()
                self._next_by_requests_s = now_s + self._request_s
                self._next_by_tokens_s = now_s + self._token_s * tokens
            try:
                with self._servers.chosen(failed) as server:
                    yield server
            finally:
                self._overall.release()

    def release(self, tokens: int) -> None:
        """Give back tokens that a request did not use after all."""
        self._next_by_tokens_s -= self._token_s * tokens

    def _wait_s(self) -> float:
        next_s = max(self._next_by_requests_s, self._next_by_tokens_s)
        return max(self._servers.cooling_s(), next_s - self._policy.now())


@dataclass
class _Call:
    """A request with its attempts, cost and last failed server; not repeated if `is_cancelled`."""

    request: Request
    key: str
    expected: Estimate
    sent: int = 0
    billed_usd: float | None = None
    failed_at: Server | None = None
    is_cancelled: bool = False


@dataclass(eq=False, kw_only=True)
class ChatModel:
    """A model at a provider, which is asked no more often than needed."""

    config: ModelConfig
    servers: Servers
    limits: Limits
    cache: ReplyCache | None = None
    budget: ModelBudget
    journal: Journal | None = None
    policy: RetryPolicy
    report: Report
    needs_messages: bool = field(default=True, init=False)
    under_way: int = field(default=0, init=False)
    """Number of requests that were sent and have not ended."""

    def __post_init__(self) -> None:
        self.name = self.config.name

    async def ask(self, request: Request) -> Reply:
        """Return the cached reply, or a new one, which is then cached if it is complete.

        A cached reply's `cost_usd` is today's. It raises and is cancelled as `Model.ask` says.
        """
        key = reply_key(self.config, request)
        if self.journal is not None and (answered := self.journal.kept(key)) is not None:
            return answered
        cache, alone = self.cache, contextlib.nullcontext()
        async with alone if cache is None else cache.shared(key):
            if cache is not None and (kept := cache.get(key)) is not None:
                usd = costs.cost_usd(self.budget.tariff, kept)
                return kept.model_copy(update={"cost_usd": usd})
            call = _Call(request, key, costs.estimate(self.config, request))
            retrying = self.policy.retrying(self.name, self.report)
            try:
                reply: Reply = await retrying(self._attempt, call)
            except ModelError as error:
                error.billed_usd = call.billed_usd
                raise
            if cache is not None:
                cache.put(key, self.config.id, reply)
            return reply

    async def aclose(self) -> None:
        """Release connections."""
        for server in self.servers.all:
            await server.client.aclose()

    async def _attempt(self, call: _Call) -> Reply:
        """Send once, when limits and budget have room."""
        async with self.limits.slot(call.expected.most_tokens, call.failed_at) as server:
            held = await self.budget.reserve(call.expected)
            exchange = asyncio.ensure_future(self._exchange(call, server, held))
            try:
                return await asyncio.shield(exchange)
            except asyncio.CancelledError:
                call.is_cancelled = True
                try:
                    return await exchange
                except RetryableError:
                    # It would otherwise be sent again.
                    raise asyncio.CancelledError from None

    async def _exchange(self, call: _Call, server: Server, held: Reservation | None) -> Reply:
        """Record that a call is sent, send it, and record its end.

        A failure counts in full if it may have been billed; an unsent call and a bug cost nothing.
        """
        written: Call | None = None
        reply: Reply | None = None
        spent_usd: float | None = 0.0
        try:
            if self.journal is not None:
                sample, most_usd = call.request.sample, None if held is None else held.usd
                written = await self.journal.sent(self.name, sample, call.key, most_usd)
                if call.is_cancelled:
                    raise asyncio.CancelledError
            spent_usd, sent_s = None, self.policy.now()
            call.sent += 1
            self.under_way += 1
            try:
                reply = await server.client.complete(call.request)
            finally:
                self.under_way -= 1
            server.was_heard, server.failures = True, 0
            spent_usd = costs.cost_usd(self.budget.tariff, reply)
            reply = reply.model_copy(update={"cost_usd": spent_usd, "attempts": call.sent})
            self.budget.learn(call.expected, reply.usage)
            prompt, completion = reply.usage.prompt_tokens, reply.usage.completion_tokens
            if prompt is not None and completion is not None:
                self.limits.release(call.expected.most_tokens - prompt - completion)
        except ModelError as error:
            call.failed_at = server
            self.servers.failed(server, error, sent_s)
            is_free = isinstance(error, UnavailableError) or not costs.may_be_billed(error)
            spent_usd = 0.0 if is_free else None
            if is_free:
                self.limits.release(call.expected.most_tokens)
            self.servers.usable()
            if isinstance(error, UnavailableError):
                # The server that refuses every request is disabled, and another one is used.
                raise RetryableError(str(error), status=error.status, sent="no") from None
            raise
        except Exception:
            spent_usd = 0.0
            raise
        finally:
            if held is not None:
                spent_usd = self.budget.settle(held, spent_usd)
                call.billed_usd = (call.billed_usd or 0.0) + spent_usd
            if reply is not None:
                reply = reply.model_copy(update={"billed_usd": call.billed_usd})
            if self.journal is not None and written is not None:
                await self.journal.ended(written, spent_usd, reply)
        return reply


def takes_format(config: ModelConfig) -> bool:
    """True if a model is assumed to accept a JSON schema as `response_format`.

    Own servers of the OpenAI protocol (vLLM, SGLang, ...) do; others if litellm's map says so.
    """
    is_own = config.provider in DIRECT_PROVIDERS and bool(config.addresses)
    return is_own or bool(costs.map_entry(config).get("supports_response_schema"))


def build_model(
    config: ModelConfig,
    *,
    cache: ReplyCache | None,
    overall: asyncio.Semaphore | None = None,
    budget: Budget | None = None,
    journal: Journal | None = None,
    report: Report = lambda _: None,
    policy: RetryPolicy | None = None,
    batches: BatchFiles | None = None,
) -> Model:
    """Return the model of a configuration; nothing is imported or sent before its first request.

    `overall` bounds the requests in progress of all models of a run; `report` gets events of the
    model. `batches` are the files of its batches. Raises SpecError for an unknown baseline, a model
    without a price under a limit or a provider without batches, DataError for missing recordings.
    """
    if config.kind == "baseline":
        return open_baseline(config)
    if config.kind == "replay":
        return open_replay(config)
    policy = policy or RetryPolicy()
    tariff = costs.tariff_of(config)
    own = ModelBudget(budget or Budget(), tariff)
    if own.is_limited and tariff is None:
        hint = "give it a price in models.yaml, or run without max_cost_usd"
        message = "has no known price, so that max_cost_usd cannot be kept"
        raise SpecError(Problem(f"model {config.name}", message, "price", config.id, hint=hint))

    def client(at: ModelConfig, http: HttpClient | None = None) -> Client:
        if at.is_direct:
            return OpenAIClient(at, http)
        from phyblock.models.litellm_client import LitellmClient

        return LitellmClient(at, http)

    shared: dict[str, Any] = {"config": config, "cache": cache, "budget": own, "policy": policy,
                              "report": report}  # fmt: skip
    if config.batch:
        from phyblock.models.batch import BatchModel

        assert batches is not None, "batches are kept in a run"
        return BatchModel(client=lambda http: client(config, http), files=batches, **shared)
    each = tuple(
        Server(
            # Scheme, host and port: the rest of an address may hold a secret.
            "/".join(address.split("/")[:3]).lower() if address else config.provider,
            client(config.at(address)),
        )
        for address in config.addresses or (None,)
    )
    servers = Servers(each, policy, lambda text: report(ModelEvent(config.name, "notice", text)))
    limits = Limits(config, overall or asyncio.Semaphore(config.max_concurrency), servers)
    return ChatModel(servers=servers, limits=limits, journal=journal, **shared)
