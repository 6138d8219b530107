"""A model asked in a provider's batches: slower, cheaper where the provider says so, never twice.

A request is in the draft of a batch, or in the newest batch that the ledger has it in. Between the
call that makes a batch and its id on disk nobody knows whether there is one. It is looked for under
our name; where the provider tells no names, among the batches of that time with as many requests,
by the names of requests in their answers.
"""

from __future__ import annotations

import asyncio
import secrets
import time
from collections import Counter
from collections.abc import Awaitable, Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from phyblock.config.models import ModelConfig
from phyblock.errors import ModelError, RetryableError, UnavailableError
from phyblock.files import atomic_write, load_json, writing
from phyblock.models.batch_providers import PROVIDERS, UNREADABLE, BatchProvider, BatchStatus
from phyblock.models.cache import ReplyCache, reply_key
from phyblock.models.client import Answer, Client, HttpClient, SeedRefusedError
from phyblock.models.costs import (
    ModelBudget,
    cost_usd,
    counted,
    estimate,
    may_be_billed,
)
from phyblock.models.model import EventKind, ModelEvent, Observer, RetryPolicy
from phyblock.models.request import AskLaterError, Request
from phyblock.records.files import BATCHES
from phyblock.records.record import BatchEvent, BatchLine, Reply

T = TypeVar("T")

_FIRST_PAUSE_S = 5.0
_CLOCKS_APART_S = 3600.0
_TIME = "%Y-%m-%dT%H:%M:%SZ"


class UnsureError(UnavailableError):
    """It is not known whether the provider has a batch."""


@dataclass(frozen=True)
class BatchFiles:
    """Batches of a run as they are kept: the lines written so far, oldest first, and a callback
    that appends one and returns when it is on disk. A batch is looked at every `poll_s` at least.
    """

    earlier: tuple[BatchLine, ...]
    put: Callable[[BatchLine], Awaitable[None]]
    run_folder: Path
    poll_s: float = 60.0

    def answers(self, token: str) -> Path:
        """Return the file of a batch's answers, which is there once it has ended."""
        return self.run_folder / "batches" / f"{token}.answers.jsonl"


@dataclass(eq=False)
class Batch:
    """A batch, from its draft, with `lines` to send, to its answers by request.

    `most_usd` are its requests by their keys in the reply cache, with the most that each can cost
    [US dollars], None where no price is known; `held` are their reservations in the budget. `token`
    is our name for it, `id` the provider's. `following` is the work that ends when it has ended.
    """

    # What the providers allow in names and boundaries.
    token: str = field(default_factory=lambda: f"pb{secrets.token_hex(12)}")
    seeded: bool = True
    most_usd: dict[str, float | None] = field(default_factory=dict)
    created: datetime = field(default_factory=lambda: datetime.now(UTC))
    event: BatchEvent | None = None
    id: str = ""
    held: dict[str, int] = field(default_factory=dict)
    lines: list[bytes] = field(default_factory=list)
    size: int = 0
    following: asyncio.Future[None] | None = None
    answers: dict[str, Answer | str] | None = None
    is_blank: bool = False

    @property
    def shown(self) -> str:
        """Its name for people."""
        return self.id or self.token


class Ledger:
    """The batches of one model; every change is on disk when `note` returns."""

    def __init__(
        self, model: str, lines: Iterable[BatchLine], put: Callable[[BatchLine], Awaitable[None]]
    ) -> None:
        self._model = model
        self._put = put
        self.batches: dict[str, Batch] = {}
        for line in lines:
            if line.model == model and line.event == "intended":
                costs = line.most_usd or [None] * len(line.keys)
                created = datetime.strptime(line.time, _TIME).replace(tzinfo=UTC)
                most_usd = dict(zip(line.keys, costs, strict=True))
                self._take(Batch(line.batch, line.seeded, most_usd, created), line)
            elif line.model == model:
                self._take(self.batches[line.batch], line)

    def newest(self, key: str) -> Batch | None:
        """Return the last batch that a request went out in, or is about to."""
        return next((b for b in reversed(self.batches.values()) if key in b.most_usd), None)

    async def note(self, batch: Batch, event: BatchEvent, **fields: object) -> None:
        """Write the newest state of a batch; one that is `intended` counts as under way."""
        batch.created = datetime.now(UTC) if event == "intended" else batch.created
        known = {"batch": batch.token, "model": self._model, "event": event}
        now = datetime.now(UTC).strftime(_TIME)
        line = BatchLine.model_validate({**known, "time": now, **fields})
        await self._put(line)
        self._take(batch, line)

    def _take(self, batch: Batch, line: BatchLine) -> None:
        self.batches[batch.token] = batch
        batch.event, batch.id = line.event, line.id or batch.id
        if line.event == "lost":
            # Its requests count as not sent in it.
            del self.batches[batch.token]


@dataclass(eq=False, kw_only=True)
class BatchModel:
    """A GatheringModel over a provider's batches.

    `client` makes a client that sends through an HTTP client: by it requests are written and
    answers are read as those of direct calls.
    """

    config: ModelConfig
    client: Callable[[HttpClient], Client]
    files: BatchFiles
    cache: ReplyCache | None
    budget: ModelBudget
    policy: RetryPolicy
    observer: Observer
    needs_messages: bool = field(default=True, init=False)

    def __post_init__(self) -> None:
        self.name = self.config.name
        self._provider = PROVIDERS[self.config.provider](self.config)
        self._ledger = Ledger(self.name, self.files.earlier, self.files.put)
        self._earlier = {key for batch in self._ledger.batches.values() for key in batch.most_usd}
        self._drafting = asyncio.Lock()
        self._draft: Batch | None = None
        self._refusal: UnavailableError | None = None
        self._has_begun = False
        self._takes_seed = self.config.seed != "never"
        # Requests whose newest answer failed, how often, and those whose answer a sample has.
        self._again: set[str] = set()
        self._failures: Counter[str] = Counter()
        self._given: set[str] = set()
        self._billed_usd: dict[str, float] = {}

    # A round: begin, gather, dispatch, ask.

    async def begin(self) -> None:
        """See GatheringModel; the first round takes up the batches of earlier commands."""
        if self._refusal is not None:
            raise self._refusal
        if self._has_begun:
            return
        self._has_begun = True
        for batch in tuple(self._ledger.batches.values()):
            if batch.event == "intended":
                # A call that was cut off may still be worked on over there.
                status = await self._find(batch, time.time() + 2 * self.files.poll_s)
                if status is None:
                    await self._ledger.note(batch, "lost", words="not found at the provider")
                else:
                    await self._ledger.note(batch, "created", id=status.id)
            if batch.event == "created":
                self._following(batch)

    async def gather(self, request: Request, *, anew: bool = False) -> bool:
        """See GatheringModel."""
        key = reply_key(self.config, request)
        async with self._drafting:
            is_drafted = self._draft is not None and key in self._draft.most_usd
            if is_drafted or await self._is_answered(key, request, anew=anew):
                return True
            return self._refusal is None and await self._add(key, request)

    async def dispatch(self) -> None:
        """See GatheringModel. What keeps a batch from being sent is raised by the next `begin`."""
        async with self._drafting:
            await self._send_draft()

    async def ask(self, request: Request) -> Reply:
        """Return the answer of the newest batch with the request, else the cached reply.

        Raises what the model seam says, AskLaterError where the request belongs to the next round.
        """
        key = reply_key(self.config, request)
        batch = self._ledger.newest(key)
        if batch is None or batch.event == "intended" or key in self._again:
            kept = None if self.cache is None else self.cache.get(key)
            if kept is None:
                raise AskLaterError
            return kept.model_copy(update={"cost_usd": cost_usd(self.budget.tariff, kept)})
        try:
            await asyncio.shield(self._following(batch))
            if batch.answers is None:
                raise AskLaterError
            reply = await self._read(key, request, batch)
        except UnavailableError:
            # No more is heard in this command of what is under way: it counts as spent.
            for each in self._ledger.batches.values():
                self._settle_all(each, None)
            raise
        except ModelError as error:
            self._settle(key, batch, None if may_be_billed(error) else 0.0)
            error.billed_usd = self._billed_usd.get(key)
            if isinstance(error, RetryableError):
                self._again.add(key)
                self._failures[key] += 1
                if self._failures[key] < self.policy.attempts or self._refusal is not None:
                    raise AskLaterError from None
            raise
        paid_usd = cost_usd(self.budget.tariff, reply)
        reply = reply.model_copy(update={"cost_usd": paid_usd})
        if key in self._given:
            # A second sample that asks the same.
            return reply.model_copy(update={"cached": True, "attempts": 0})
        self._given.add(key)
        self._settle(key, batch, paid_usd)
        self.budget.learn(estimate(self.config, request), reply.usage)
        update = {"billed_usd": self._billed_usd.get(key), "attempts": self._failures[key] + 1}
        reply = reply.model_copy(update=update)
        if self.cache is not None:
            self.cache.put(key, self.config.id, reply)
        return reply

    async def aclose(self) -> None:
        """Release connections; batches go on at the provider."""
        followings = [b.following for b in self._ledger.batches.values() if b.following is not None]
        for following in followings:
            following.cancel()
        await asyncio.gather(*followings, return_exceptions=True)
        await self._provider.aclose()

    # The draft, and what it holds of the budget.

    async def _is_answered(self, key: str, request: Request, *, anew: bool) -> bool:
        """Return True if `ask` has an answer to a request, or will have when a batch ends."""
        batch = self._ledger.newest(key)
        if batch is not None and key not in self._again:
            if key in self._earlier:
                # Held once, however often it is gathered.
                self._earlier.discard(key)
                batch.held[key] = self.budget.hold(batch.most_usd[key] or 0.0)
            if batch.event != "ended":
                return True
            await asyncio.shield(self._following(batch))
            try:
                await self._read(key, request, batch)
                return True
            except ModelError as error:
                if not anew and not isinstance(error, RetryableError):
                    return True
                # Where it was recorded, it was counted, too.
                self._settle(key, batch, None if may_be_billed(error) and not anew else 0.0)
                self._again.add(key)
        return self.cache is not None and self.cache.get(key) is not None

    async def _add(self, key: str, request: Request) -> bool:
        """Put a request into the draft, or a new one; False where the budget has no room for it."""
        http, seeded = await self._written(request)
        expected = estimate(self.config, request)
        usd = self.budget.most_usd(expected, batched=True)
        # Under a limit prices are known.
        most = usd or 0.0
        if self.budget.fits(most):
            held = self.budget.hold(most)
        elif self._draft or any(b.event == "created" for b in self._ledger.batches.values()):
            return False
        else:
            held = await self.budget.reserve(lambda: most)
        for draft in (self._draft, Batch(seeded=seeded)):
            if draft is None:
                continue
            line = self._provider.line(custom_id(draft, len(draft.lines)), http.body, http.headers)
            fits = len(draft.lines) < self._provider.most_requests
            fits = fits and draft.size + len(line) < self._provider.most_bytes
            if not draft.lines or (fits and seeded == draft.seeded):
                break
            sending = asyncio.ensure_future(self._send_draft())
            try:
                await asyncio.shield(sending)
            except asyncio.CancelledError:
                await sending
                raise
            if self._refusal is not None:
                self.budget.settle(held, 0.0)
                return False
        self._draft = draft
        assert draft is not None
        draft.lines.append(line)
        draft.size += len(line) + 1
        draft.most_usd[key] = usd
        draft.held[key] = held
        return True

    def _settle(self, key: str, batch: Batch, usd: float | None) -> None:
        """Count the cost of a request, once; None is all that it can have cost."""
        if key in batch.held:
            spent_usd = self.budget.settle(batch.held.pop(key), usd)
            self._billed_usd[key] = self._billed_usd.get(key, 0.0) + spent_usd

    def _settle_all(self, batch: Batch, usd: float | None) -> None:
        while batch.held:
            self.budget.settle(batch.held.popitem()[1], usd)

    # Sending, and finding again what an earlier process was sending.

    async def _send_draft(self) -> None:
        draft, self._draft = self._draft, None
        if draft is None:
            return
        try:
            await self._send(draft)
        except UnavailableError as error:
            # Whether one was sent of which that is not known, the next command finds out.
            self._refusal = error
            self._settle_all(draft, None if isinstance(error, UnsureError) else 0.0)
            return
        self._again.difference_update(draft.most_usd)
        self._tell(f"sent batch {draft.shown} of {len(draft.most_usd):,}")
        self._following(draft)

    async def _send(self, batch: Batch) -> None:
        """Send a draft and note its id; UnsureError where it is not known if it was sent."""
        costs = [] if None in batch.most_usd.values() else list(batch.most_usd.values())
        fields = {"keys": tuple(batch.most_usd), "most_usd": costs, "seeded": batch.seeded}
        await self._ledger.note(batch, "intended", **fields)

        async def create() -> BatchStatus:
            try:
                return await self._provider.create(batch.token, batch.lines)
            except RetryableError as error:
                if error.sent == "no" or error.status == 429:
                    raise
                known = await self._find(batch, time.time() + self.files.poll_s)
                if known is None:
                    raise
                return known

        try:
            status = await self._patiently(create)
        except UnsureError:
            raise
        except UnavailableError as error:
            await self._ledger.note(batch, "lost", words=str(error))
            why = f"a batch could not be sent: {error}"
            raise UnavailableError(why, status=error.status, sent=error.sent) from None
        await self._ledger.note(batch, "created", id=status.id)
        batch.lines.clear()

    async def _find(self, batch: Batch, until_s: float) -> BatchStatus | None:
        """Return the batch that was being sent, None where there is none; raises UnsureError."""
        strangers = {one.id for one in self._ledger.batches.values()}
        earliest_s = batch.created.timestamp() - _CLOCKS_APART_S

        async def candidates() -> list[BatchStatus]:
            found = []
            async for status in self._provider.listed():
                if status.created_s is not None and status.created_s < earliest_s:
                    break
                is_like = status.total in (None, 0, len(batch.most_usd))
                is_like = is_like and status.state != "refused" and status.id not in strangers
                if status.token == batch.token or (status.token is None and is_like):
                    found.append(status)
            return sorted(found, key=lambda status: status.token is None)

        try:
            while True:
                is_running = False
                for status in await self._patiently(candidates):
                    if status.token == batch.token:
                        return status
                    if status.state == "running":
                        is_running = True
                        continue
                    lines = await self._patiently(partial(self._provider.results, status))
                    if answers_of(lines, self._provider, batch):
                        return status
                    strangers.add(status.id)
                if not is_running and time.time() >= until_s:
                    return None
                await asyncio.sleep(self.files.poll_s)
        except UnavailableError as error:
            why = (
                f"it is not known whether a batch was sent: {error}. If it was not, remove the "
                f"lines of {batch.token} from {BATCHES}: its questions are then asked again"
            )
            raise UnsureError(why, status=error.status, sent=error.sent) from None

    async def _patiently(self, call: Callable[[], Awaitable[T]]) -> T:
        """Call until it succeeds or cannot; UnavailableError where it never does."""
        try:
            async for attempt in self.policy.retrying(lambda *_: None):
                with attempt:
                    return await call()
        except UnavailableError:
            raise
        except ModelError as error:
            raise UnavailableError(str(error), status=error.status, sent=error.sent) from None
        raise AssertionError("tenacity neither returned nor raised")

    # Following a batch to its end.

    def _following(self, batch: Batch) -> asyncio.Future[None]:
        if batch.following is None:
            batch.following = asyncio.ensure_future(self._follow(batch))
        return batch.following

    async def _follow(self, batch: Batch) -> None:
        """Return when the answers are here, or when the batch was refused as a whole."""
        path = self.files.answers(batch.token)
        if batch.event == "created":
            try:
                status = await self._end(batch)
                words = self._provider.shown(status.words)
                if status.state == "refused":
                    await self._ledger.note(batch, "lost", words=words)
                    self._refusal = UnavailableError(f"batch {batch.shown} was refused: {words}")
                    self._settle_all(batch, 0.0)
                    return
                lines = await self._patiently(lambda: self._provider.results(status))
            except ModelError as error:
                # An error of its requests is another thing: these are asked again, or recorded.
                why = f"no answers of batch {batch.shown}, which stays at the provider: {error}"
                raise UnavailableError(why, status=error.status, sent=error.sent) from None
            with writing(path):
                path.parent.mkdir(parents=True, exist_ok=True)
                await asyncio.to_thread(atomic_write, path, lines, sync=True)
            await self._ledger.note(batch, "ended", words=words)
            if status.state == "cancelled":
                why = f"batch {batch.shown} was cancelled; the same command asks the rest"
                self._refusal = UnavailableError(why)
        if not path.exists():
            raise UnavailableError(
                f"the answers of batch {batch.shown} are gone ({path}): without its lines in "
                f"{BATCHES} its questions are asked again"
            )
        lines = await asyncio.to_thread(path.read_bytes)
        batch.is_blank = not lines.strip()
        batch.answers = await asyncio.to_thread(answers_of, lines, self._provider, batch)

    async def _end(self, batch: Batch) -> BatchStatus:
        """Look at a batch now and then; return its last state."""
        pause_s, failures, told = min(_FIRST_PAUSE_S, self.files.poll_s), 0, ""
        while True:
            try:
                status = await self._provider.status(batch.id)
                failures, said = 0, self._provider.shown(status.words)
                if status.state != "running":
                    self._tell(f"batch {batch.shown} has ended: {said}")
                    return status
            except RetryableError as error:
                failures += 1
                if failures >= self.policy.max_connection_failures:
                    raise
                said = f"cannot be looked at now ({error})"
            if said != told:
                since = batch.created.astimezone().strftime("%d %b %H:%M")
                self._tell(f"waiting for batch {batch.shown} since {since}: {said}")
                told = said
            await asyncio.sleep(pause_s)
            pause_s = min(self.files.poll_s, 1.5 * pause_s)

    # Requests as lines and answers as replies, by the client of direct calls.

    async def _written(self, request: Request) -> tuple[_NoConnection, bool]:
        """Return what a direct call would send, and True if it has a seed; raises as that."""
        while True:
            http, with_seed = _NoConnection(), self._takes_seed
            try:
                await self.client(http).complete(request, with_seed=with_seed)
            except SeedRefusedError:
                self._go_without_seed()
            except ModelError:
                if not http.body:
                    raise
                return http, with_seed

    async def _read(self, key: str, request: Request, batch: Batch) -> Reply:
        """Return the reply that a direct call would have made of the answer; raises as that."""
        assert batch.answers is not None, "the batch has ended"
        answer = batch.answers.get(key)
        if answer is None:
            why = f"batch {batch.shown} holds no answer that can be read"
            raise RetryableError(why, **{"sent": "no"} if batch.is_blank else {"status": 200})
        if isinstance(answer, str):
            why = f"batch {batch.shown} ended before this was asked: {answer}"
            raise RetryableError(self._provider.shown(why), sent="no")
        client = self.client(_NoConnection(answer))
        try:
            reply = await client.complete(request, with_seed=batch.seeded)
        except SeedRefusedError:
            self._go_without_seed()
            raise RetryableError("the provider takes no seed", sent="answered") from None
        reply = counted(reply, estimate(self.config, request))
        return reply.model_copy(update={"latency_s": 0.0, "batched": True})

    def _go_without_seed(self) -> None:
        if self.config.seed == "always":
            raise UnavailableError("the provider takes no seed, and seed is `always`")
        if self._takes_seed:
            self._takes_seed = False
            self._tell("takes no seed: seeds are independent repeats", "seed_unsupported")

    def _tell(self, text: str, kind: EventKind = "batch") -> None:
        self.observer(ModelEvent(self.name, kind, text))


class _NoConnection(HttpClient):
    """Keeps what would be sent, and gives an answer that is here already."""

    def __init__(self, answer: Answer | None = None) -> None:
        self.body = b""
        self.headers: Mapping[str, str] = {}
        self._answer = answer

    async def send(self, url: str, body: bytes, headers: Mapping[str, str], **_: Any) -> Answer:
        """Return the answer; RetryableError where there is none: nothing was sent."""
        self.body, self.headers = body, headers
        if self._answer is None:
            raise RetryableError(f"a request to {url} is kept for a batch", sent="no")
        return self._answer

    async def aclose(self) -> None:
        """Nothing is open."""


def custom_id(batch: Batch, place: int) -> str:
    """Return the name of a request in a batch."""
    return f"{batch.token}-{place}"


def answers_of(lines: bytes, provider: BatchProvider, batch: Batch) -> dict[str, Answer | str]:
    """Return the first readable answer to each request of a batch that has one; a text says why
    the request was never asked.
    """
    keys = {custom_id(batch, place): key for place, key in enumerate(batch.most_usd)}
    found: dict[str, Answer | str] = {}
    for line in filter(None, map(bytes.strip, lines.splitlines())):
        try:
            name, answer = provider.read(load_json(line))
            key = keys.get(name)
        except UNREADABLE:
            continue
        if key is not None:
            found.setdefault(key, answer)
    return found


def under_way(lines: Iterable[BatchLine]) -> dict[str, str]:
    """Return batches that have not ended, by the name of their model: one of each."""
    newest = {line.batch: line for line in lines}
    return {
        line.model: line.id or line.batch
        for line in newest.values()
        if line.event in ("intended", "created")
    }


def waiting_keys(
    config: ModelConfig, lines: Sequence[BatchLine], run_folder: Path
) -> frozenset[str]:
    """Return the requests that are not asked again, by their keys in the reply cache: of batches
    that have not ended all, of others those that were answered.
    """

    async def put(line: BatchLine) -> None:
        raise AssertionError(f"only read here: {line.event}")

    files, waiting = BatchFiles((), put, run_folder), set[str]()
    provider = PROVIDERS[config.provider](config)
    for batch in Ledger(config.name, lines, put).batches.values():
        path = files.answers(batch.token)
        # Without its answers a batch stops its model: nothing of it is asked again.
        if batch.event != "ended" or not path.is_file():
            waiting |= batch.most_usd.keys()
            continue
        found = answers_of(path.read_bytes(), provider, batch)
        waiting |= {k for k, one in found.items() if isinstance(one, Answer) and one.is_success}
    return frozenset(waiting)
