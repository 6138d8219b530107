"""A model from its configuration to its reply: cache, retries, limits, budget, servers, client."""

from __future__ import annotations

import asyncio
import contextlib
import random
import time
from collections import deque
from collections.abc import AsyncIterator, Awaitable, Callable, Hashable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

from tenacity import AsyncRetrying, RetryCallState, retry_if_exception_type

from phyblock.config.models import DIRECT_PROVIDERS, ModelConfig
from phyblock.errors import ModelError, Problem, RetryableError, SpecError, UnavailableError
from phyblock.models.cache import ReplyCache, reply_key
from phyblock.models.client import Client, HttpClient, OpenAIClient
from phyblock.models.costs import (
    Budget,
    Estimate,
    ModelBudget,
    cost_usd,
    counted,
    estimate,
    map_entry,
    may_be_billed,
    tariff_of,
)
from phyblock.models.replay import open_baseline, open_replay
from phyblock.models.request import Journal, Model, Request
from phyblock.records.record import Call, Reply

if TYPE_CHECKING:
    from phyblock.models.batch import BatchFiles

_SCHEMA_PROVIDERS = ("predibase", "fireworks_ai", "lm_studio", "nebius", "databricks")
"""Providers whose models all accept a schema according to litellm."""

WINDOW_S = 60.0
_NAP_S = 1.0


@dataclass(frozen=True)
class Clock:
    """The clock of limits, retries and servers, which tests replace."""

    now: Callable[[], float] = time.monotonic
    sleep: Callable[[float], Awaitable[None]] = asyncio.sleep


@dataclass
class Started:
    """A started request: its time [s], and its tokens for the limit."""

    at_s: float
    tokens: int


class Limits:
    """All limits of one model: requests in progress, and requests and tokens in any 60 s.

    A single request larger than `tpm` is admitted when nothing was started for a minute, or it
    could never start. `overall` is shared by all models of a run; `rest_s` returns how long no
    server of the model may be asked, as after a 429.
    """

    def __init__(
        self,
        most: int,
        overall: asyncio.Semaphore,
        rpm: int | None = None,
        tpm: int | None = None,
        *,
        rest_s: Callable[[], float] = lambda: 0.0,
        clock: Clock | None = None,
    ) -> None:
        self._under_way = asyncio.Semaphore(most)
        self._overall = overall
        self._rpm = rpm
        self._tpm = tpm
        self._rest_s = rest_s
        self._clock = clock or Clock()
        self._admission = asyncio.Lock()
        self._started: deque[Started] = deque()
        self._tokens = 0

    @contextlib.asynccontextmanager
    async def slot(self, tokens: int) -> AsyncIterator[Started]:
        """Hold a place of the model and of the whole run; `tokens` is the estimate for tpm.

        Requests are admitted one after another; a model that waits for its minute holds no place
        that another model could use.
        """
        async with self._under_way:
            async with self._admission:
                while (wait_s := max(self._rest_s(), self._window_s(tokens))) > 0:
                    # In short waits, since a resting server may answer earlier.
                    await self._clock.sleep(min(wait_s, _NAP_S))
                await self._overall.acquire()
                started = Started(self._clock.now(), tokens)
                self._started.append(started)
                self._tokens += tokens
            try:
                yield started
            finally:
                self._overall.release()

    def settle(self, started: Started, tokens: int) -> None:
        """Replace the estimate by the tokens that a request really took."""
        if started.at_s > self._clock.now() - WINDOW_S:
            self._tokens += tokens - started.tokens
            started.tokens = tokens

    def _window_s(self, tokens: int) -> float:
        """Return the seconds until a request of this many tokens may start."""
        now = self._clock.now()
        while self._started and self._started[0].at_s <= now - WINDOW_S:
            self._tokens -= self._started.popleft().tokens
        must_leave = 0 if self._rpm is None else max(0, len(self._started) - self._rpm + 1)
        if self._tpm is not None:
            held = self._tokens
            for count, started in enumerate(self._started):
                if held + tokens <= self._tpm:
                    break
                held -= started.tokens
                must_leave = max(must_leave, count + 1)
        return self._started[must_leave - 1].at_s + WINDOW_S - now if must_leave else 0.0


EventKind = Literal["retry", "batch"]


@dataclass(frozen=True)
class ModelEvent:
    """An event of a model to show to the user.

    `retry`: a request failed, with `status` if the server sent one, and is sent again after
    `wait_s`; `batch`: a batch was sent, is in progress or has ended. `message` is safe to show.
    """

    model: str
    kind: EventKind
    message: str
    wait_s: float = 0.0
    status: int | None = None


Observer = Callable[[ModelEvent], None]

Report = Callable[[str], None]
"""A callback for notices about the whole run, such as an unreachable server or a failed cache."""


@dataclass(frozen=True)
class RetryPolicy:
    """Limits on how often and how long a request is sent again.

    A request is given up only when it has failed `attempts` times and `retry_for_s` have passed
    since its first failure. An answer with HTTP 2xx and an unreadable body was paid for, so only
    the number of attempts applies.

    The wait before attempt n + 1 is uniform between 0 and min(`max_wait_s`, `base_s` * 2^(n-1)),
    on top of the server's `Retry-After` (followed up to `max_retry_after_s`). A server that has
    never answered is given up after `max_connection_failures` tries: its address is probably wrong.
    """

    attempts: int = 8
    retry_for_s: float = 300.0
    max_connection_failures: int = 20
    base_s: float = 0.5
    max_wait_s: float = 60.0
    max_retry_after_s: float = 120.0
    clock: Clock = field(default_factory=Clock)

    def gives_up(self, error: ModelError, failures: int, failing_for_s: float) -> bool:
        """True if a request is given up after this many failures in this time."""
        is_success = error.status is not None and 200 <= error.status < 300
        return failures >= self.attempts and (is_success or failing_for_s >= self.retry_for_s)

    def followed_s(self, error: ModelError) -> float:
        """Return the part of the server's requested wait that is followed [s]."""
        return min(getattr(error, "retry_after_s", None) or 0.0, self.max_retry_after_s)

    def retrying(
        self,
        on_retry: Callable[[RetryableError, float], None],
        is_over: Callable[[], bool] = lambda: False,
    ) -> AsyncRetrying:
        """Return tenacity's loop for one request, which continues only after a RetryableError.

        `on_retry` is called with the error and the wait [s] before each wait; nothing is retried
        once `is_over` returns true.
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


FAILURES_TO_REST = 5
_REQUESTS_TO_REST = 2
"""Failed requests that count as an outage: a single one may itself crash the server."""
_LONGEST_REST_S = 15.0
_GATEWAY = (502, 503, 504)
_TOO_MUCH = (429, 529)


@dataclass(eq=False)
class Server:
    """One server. After `failures` in a row, of the requests `failed`, it counts as away since
    `away_since_s`, and has rested `rests` times. `refusal` is the reason why it is not used any
    more.
    """

    name: str
    client: Client
    under_way: int = 0
    sent: int = 0
    failures: int = 0
    failed: set[Hashable] = field(default_factory=set)
    away_since_s: float = 0.0
    rests: int = 0
    rested_at_s: float = float("-inf")
    rests_until_s: float = float("-inf")
    was_heard: bool = False
    refusal: UnavailableError | None = None


class Servers:
    """Chooses among the servers of a model: the least loaded one that is not resting.

    An answer of the server itself, even an error 500 or 429, shows that it is up. A failed or lost
    connection, or a gateway error (502, 503, 504), shows that it is down. A timeout shows neither:
    some requests are slow. `report` is called with a sentence on changes.
    """

    def __init__(
        self, servers: Sequence[Server], policy: RetryPolicy, report: Callable[[str], None]
    ) -> None:
        self.all = tuple(servers)
        self._policy = policy
        self._report = report

    def usable(self) -> list[Server]:
        """Return the servers that are not given up. Raises UnavailableError if there are none."""
        usable = [server for server in self.all if server.refusal is None]
        if not usable and (refusal := self.all[-1].refusal) is not None:
            raise UnavailableError(str(refusal), status=refusal.status, sent=refusal.sent)
        return usable

    def rest_s(self) -> float:
        """Return the seconds until a server may be asked; raises UnavailableError as `usable`."""
        return max(0.0, min(s.rests_until_s for s in self.usable()) - self._policy.clock.now())

    def pick(self, failed: Server | None = None) -> Server:
        """Return the server to ask: the one with the fewest requests in progress, not resting.

        A server that just `failed` the request is asked only if there is no other. A server that
        was away gets a single request at a time until it answers.
        """
        now_s = self._policy.clock.now()
        chosen = min(
            self.usable(),
            key=lambda s: (max(0.0, s.rests_until_s - now_s), s is failed, s.under_way, s.sent),
        )
        if chosen.rests:
            chosen.rests_until_s = now_s + self._rest_of(chosen)
        return chosen

    def heard(self, server: Server) -> None:
        """Record that a server answered."""
        if server.rests:
            lasted_s = self._policy.clock.now() - server.away_since_s
            self._report(f"{server.name} answers again after {lasted_s:.0f} s")
            server.rests_until_s = float("-inf")
        server.was_heard, server.failures, server.rests = True, 0, 0
        server.failed.clear()

    def failed(self, server: Server, error: ModelError, request: Hashable, sent_s: float) -> bool:
        """Record that a request sent at `sent_s` failed. True if that is the server's fault, so
        that another attempt is free.

        Failures of requests that were sent before a server began to rest are ignored.
        """
        if isinstance(error, UnavailableError):
            self._refuse(server, error)
            return True
        if error.sent not in ("no", "lost") and error.status not in _GATEWAY:
            if error.sent == "answered":
                self.heard(server)
            return False
        server.was_heard |= error.status is not None
        if server.rests and sent_s <= server.rested_at_s:
            return True
        now_s = self._policy.clock.now()
        server.away_since_s = server.away_since_s if server.failures else now_s
        server.failures += 1
        server.failed.add(request)
        if server.failures < FAILURES_TO_REST or len(server.failed) < _REQUESTS_TO_REST:
            return False
        server.rests += 1
        server.rested_at_s = now_s
        wait_s = max(self._rest_of(server), self._policy.followed_s(error))
        server.rests_until_s = now_s + wait_s
        lasted_s, name = now_s - server.away_since_s, server.name
        tries = FAILURES_TO_REST + server.rests - 1
        if self._policy.gives_up(error, server.rests, lasted_s):
            why = f"{name} could not be reached for {lasted_s:.0f} s: {error}"
            self._refuse(server, UnavailableError(why, sent="no"))
        elif not server.was_heard and tries >= self._policy.max_connection_failures:
            why = f"{name} never answered, {tries} times in a row: {error}"
            self._refuse(server, UnavailableError(why, sent="no"))
        elif server.rests == 1:
            self._report(f"{name} cannot be reached, trying now and then: {error}")
        return True

    def pause(self, server: Server, error: RetryableError, wait_s: float) -> None:
        """Let a server that reports overload rest for a while."""
        if error.status in _TOO_MUCH:
            until_s = self._policy.clock.now() + wait_s
            server.rests_until_s = max(server.rests_until_s, until_s)

    def _refuse(self, server: Server, error: UnavailableError) -> None:
        is_first, server.refusal = server.refusal is None, error
        if is_first and any(other.refusal is None for other in self.all):
            self._report(f"{server.name} is not used any more: {error}")

    def _rest_of(self, server: Server) -> float:
        doubled_s = self._policy.base_s * 2.0 ** min(server.rests, 60)
        return min(_LONGEST_REST_S, self._policy.max_wait_s, doubled_s)


@dataclass
class _Call:
    """A request with its estimate, attempts, cost, and the server that failed last. If
    `is_cancelled`, it is not sent again.
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
        """Return the cached reply, or a new one, which is then cached if it is complete.

        `cost_usd` of a cached reply is what it would cost today. Raises as `Model.ask`.

        When cancelled while it waits, it gives up at once. When cancelled during a request, which
        is paid for, it returns the answer; a second cancellation gives that up too.
        """
        is_keyed = self.cache is not None or self.journal is not None
        key = reply_key(self.config, request) if is_keyed else ""
        if self.journal is not None and (answered := self.journal.kept(key)) is not None:
            return answered
        if self.cache is None:
            return await self._ask(request, key)
        async with self.cache.shared(key):
            kept = self.cache.get(key)
            if kept is not None:
                return kept.model_copy(update={"cost_usd": self._cost_usd(kept)})
            reply = await self._ask(request, key)
            self.cache.put(key, self.config.id, reply)
            return reply

    @property
    def under_way(self) -> int:
        """Number of requests without an answer yet."""
        return sum(server.under_way for server in self.servers.all)

    async def aclose(self) -> None:
        """Release connections."""
        for server in self.servers.all:
            await server.client.aclose()

    async def _ask(self, request: Request, key: str) -> Reply:
        """Send until answered; however it ends, the billed cost is reported."""
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
                # It would otherwise be sent again.
                raise asyncio.CancelledError from None
            error.billed_usd = call.billed_usd
            raise
        raise AssertionError("tenacity neither returned nor raised")

    async def _attempt(self, call: _Call) -> Reply:
        """Send once, to a server that does not refuse every request."""
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
        """Send with the call's highest cost reserved in the budget."""
        held = None
        if self.budget.tariff is not None:
            held = await self.budget.reserve(lambda: self.budget.most_usd(call.expected) or 0.0)
        exchange = asyncio.ensure_future(self._exchange(call, server, held))
        try:
            return await asyncio.shield(exchange)
        except asyncio.CancelledError:
            call.is_cancelled = True
            return await exchange

    async def _exchange(self, call: _Call, server: Server, held: int | None) -> Reply:
        """Write that a call is sent, send it, and write its end.

        A failure that may have been billed counts in full; a failure before anything is sent, and
        an internal error, which ends the run, cost nothing.
        """
        written: Call | None = None
        reply: Reply | None = None
        spent_usd: float | None = 0.0
        try:
            if self.journal is not None:
                sample, most_usd = call.request.sample, self.budget.most_usd(call.expected)
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

    def _cost_usd(self, reply: Reply) -> float | None:
        return cost_usd(self.budget.tariff, reply)


def takes_format(config: ModelConfig) -> bool:
    """True if a model is assumed to accept a JSON schema as `response_format`.

    Self-hosted servers that speak the OpenAI protocol (vLLM, SGLang, llama.cpp, LM Studio, Ollama)
    do; for all others litellm's map of models decides.
    """
    is_own = config.provider in DIRECT_PROVIDERS and bool(config.addresses)
    is_known = is_own or config.provider in _SCHEMA_PROVIDERS
    return is_known or bool(map_entry(config).get("supports_response_schema"))


def build_model(
    config: ModelConfig,
    *,
    cache: ReplyCache | None,
    overall: asyncio.Semaphore | None = None,
    budget: Budget | None = None,
    journal: Journal | None = None,
    observer: Observer = lambda _: None,
    report: Report = lambda _: None,
    policy: RetryPolicy | None = None,
    batches: BatchFiles | None = None,
) -> Model:
    """Return the model of a configuration; nothing is imported or sent before its first request.

    `overall` bounds the requests in progress of all models of a run; `observer` gets events of the
    model, `report` notices about its servers. `batches` are the files of its batches. Raises
    SpecError for an unknown baseline, a model without a price under a limit or a provider without
    batches, DataError for missing recordings.
    """
    if config.kind == "baseline":
        return open_baseline(config)
    if config.kind == "replay":
        return open_replay(config)
    if not config.provider:
        where, hint = f"model {config.name}", "for example openai/gpt-4o-2024-08-06"
        raise SpecError(Problem(where, "needs a provider", "id", config.id, hint=hint))
    policy = policy or RetryPolicy()
    tariff = tariff_of(config)
    own = (budget or Budget()).of(config.name, tariff, config.max_cost_usd)
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
                              "observer": observer}  # fmt: skip
    if config.batch:
        from phyblock.models.batch import BatchModel

        assert batches is not None, "batches are kept in a run"
        return BatchModel(client=lambda http: client(config, http), files=batches, **shared)
    each = [
        Server(
            # Scheme, host and port: the rest of an address may hold a secret.
            "/".join(address.split("/")[:3]).lower() if address else config.provider,
            client(config.at(address)),
        )
        for address in config.addresses or (None,)
    ]
    servers = Servers(each, policy, report)
    limits = Limits(
        config.max_concurrency,
        overall or asyncio.Semaphore(config.max_concurrency),
        config.rpm,
        config.tpm,
        rest_s=servers.rest_s,
        clock=policy.clock,
    )
    return ChatModel(servers=servers, limits=limits, journal=journal, **shared)
