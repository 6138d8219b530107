"""Requests in a provider's batches: slower, cheaper at some providers, never sent twice.

A request waits in the draft of a batch, which is sent when no more requests arrive, or in the
newest batch that contains it in the ledger. If the command is killed or the connection lost while a
batch is created, it may or may not exist: the model is stopped until a person has checked.
"""

from __future__ import annotations

import asyncio
import secrets
import time
from collections.abc import Awaitable, Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from phyblock.config.models import ModelConfig
from phyblock.errors import ModelError, RetryableError, UnavailableError
from phyblock.files import atomic_write, load_json, writing
from phyblock.models.batch_providers import PROVIDERS, UNREADABLE, BatchProvider
from phyblock.models.cache import ReplyCache, reply_key
from phyblock.models.client import Answer, Client, HttpClient
from phyblock.models.costs import ModelBudget, Reservation, cost_usd, estimate, may_be_billed
from phyblock.models.model import ModelEvent, Report, RetryPolicy
from phyblock.models.request import Request
from phyblock.records.files import BATCHES
from phyblock.records.record import BatchEvent, BatchLine, Reply

T = TypeVar("T")

_FIRST_PAUSE_S = 5.0
_QUIET_S = 30.0
"""Time after which a draft that gets no more requests is sent, even if more were expected [s]."""
_TIME = "%Y-%m-%dT%H:%M:%SZ"


@dataclass(frozen=True)
class BatchFiles:
    """The batch files of a run: the lines written so far, oldest first, and a callback that appends
    one and returns when it is on disk. A batch is polled at least every `poll_s`; `recorded` are
    the samples with a record when the run was opened, `expected` is the number of samples to ask.
    """

    earlier: tuple[BatchLine, ...]
    put: Callable[[BatchLine], Awaitable[None]]
    run_folder: Path
    poll_s: float = 60.0
    recorded: Collection[str] = ()
    expected: int = 0


@dataclass(eq=False)
class Batch:
    """A batch, from its draft, with `lines` of `size_bytes` to send, to its answers by request.

    `most_usd` holds, by the keys of its requests in the reply cache, the maximum cost of each [US
    dollars], None if no price is known; `held` are their reservations in the budget, `unheld` the
    requests of an earlier command that have none yet. `token` is phyblock's name for it, `id` the
    provider's. `work` ends when its answers have arrived, or it is lost.
    """

    # Allowed by all providers in names and boundaries.
    token: str = field(default_factory=lambda: f"pb{secrets.token_hex(12)}")
    most_usd: dict[str, float | None] = field(default_factory=dict)
    created: datetime = field(default_factory=lambda: datetime.now(UTC))
    event: BatchEvent | None = None
    id: str = ""
    held: dict[str, Reservation] = field(default_factory=dict)
    unheld: set[str] = field(default_factory=set)
    lines: list[bytes] = field(default_factory=list)
    size_bytes: int = 0
    grown_s: float = 0.0
    work: asyncio.Future[None] | None = None
    answers: dict[str, Answer | str] | None = None
    is_blank: bool = False

    @property
    def shown(self) -> str:
        """The name that is shown to users."""
        return self.id or self.token

    def take(self, line: BatchLine) -> None:
        """Update the batch from a line of the ledger."""
        if line.event == "intended":
            costs = line.most_usd or [None] * len(line.keys)
            self.most_usd = dict(zip(line.keys, costs, strict=True))
            self.created = datetime.strptime(line.time, _TIME).replace(tzinfo=UTC)
        self.event, self.id = line.event, line.id or self.id


def read_batches(lines: Iterable[BatchLine], model: str) -> list[Batch]:
    """Return the batches of a model that are not lost, from its lines, in their order."""
    batches: dict[str, Batch] = {}
    for line in lines:
        if line.model == model:
            batches.setdefault(line.batch, Batch(line.batch)).take(line)
    return [batch for batch in batches.values() if batch.event != "lost"]


def under_way(lines: Iterable[BatchLine], model: str) -> list[Batch]:
    """Return the batches of a model that have not ended, from its lines."""
    return [batch for batch in read_batches(lines, model) if batch.event != "ended"]


@dataclass(eq=False, kw_only=True)
class BatchModel:
    """A Model over a provider's batches, which are sent once no request has arrived for a while.

    `client` makes a client from an HTTP client, which writes and reads as in direct calls.
    """

    config: ModelConfig
    client: Callable[[HttpClient], Client]
    files: BatchFiles
    cache: ReplyCache | None
    budget: ModelBudget
    policy: RetryPolicy
    report: Report
    needs_messages: bool = field(default=True, init=False)

    def __post_init__(self) -> None:
        self.name = self.config.name
        self._provider = PROVIDERS[self.config.provider](self.config)
        self._batches = read_batches(self.files.earlier, self.name)
        for batch in self._batches:
            batch.unheld = set(batch.most_usd)
        self._ended_before = [batch for batch in self._batches if batch.event == "ended"]
        # By request: the batch or draft that holds it.
        self._newest = {key: batch for batch in self._batches for key in batch.most_usd}
        self._asked = 0
        self._adding = asyncio.Lock()
        self._is_writing = False
        self._draft: Batch | None = None
        self._refusal: UnavailableError | None = None
        for batch in self._batches:
            if batch.event == "intended":
                self._refusal = self._unsure(batch, "the command ended in the meantime")
        self._given: set[str] = set()

    async def ask(self, request: Request) -> Reply:
        """Return the cached reply, or the answer of the newest batch with the request.

        Raises as `Model.ask`; the next command repeats failed requests. A batch is never cancelled.
        """
        key = reply_key(self.config, request)
        self._asked += 1
        if (batch := self._newest.get(key)) is None:
            if self.cache is not None and (kept := self.cache.get(key)) is not None:
                return kept.model_copy(update={"cost_usd": cost_usd(self.budget.tariff, kept)})
            async with self._adding:
                # Another sample may have added the same request in the meantime.
                batch = self._newest.get(key) or await self._add(key, request)
        if key in batch.unheld:
            batch.unheld.discard(key)
            if (usd := batch.most_usd[key]) is not None:
                batch.held[key] = self.budget.hold(usd)
        if batch.work is None:
            batch.work = asyncio.ensure_future(self._take_through(batch))
        try:
            await asyncio.shield(batch.work)
            reply = None if batch.answers is None else await self._read(key, request, batch)
        except UnavailableError as error:
            self._refusal = self._refusal or error
            # This command learns nothing more about batches in progress: they count as spent.
            for each in self._batches:
                # A draft is no longer sent.
                self._settle_all(each, 0.0 if each.event is None else None)
            raise
        except ModelError as error:
            if batch in self._ended_before and request.sample in self.files.recorded:
                # It was recorded and counted by an earlier command.
                self._settle(key, batch, 0.0)
                if self._newest.get(key) is batch:
                    del self._newest[key]
                return await self.ask(request)
            error.billed_usd = self._settle(key, batch, None if may_be_billed(error) else 0.0)
            raise
        if reply is None:
            assert self._refusal is not None, "a batch without answers was refused"
            raise self._refusal
        if key in self._given:
            # A second sample with the same request.
            return reply.model_copy(update={"cached": True, "attempts": 0})
        self._given.add(key)
        billed_usd = self._settle(key, batch, reply.cost_usd)
        self.budget.learn(estimate(self.config, request), reply.usage)
        reply = reply.model_copy(update={"billed_usd": billed_usd, "attempts": 1})
        if self.cache is not None:
            self.cache.put(key, self.config.id, reply)
        return reply

    async def aclose(self) -> None:
        """Release connections; batches continue at the provider."""
        works = [batch.work for batch in self._batches if batch.work is not None]
        for work in works:
            work.cancel()
        await asyncio.gather(*works, return_exceptions=True)
        await self._provider.http.aclose()

    async def _add(self, key: str, request: Request) -> Batch:
        """Add a request to the current draft, or a new one, once the budget has room for it."""
        self._is_writing, http = True, _NoConnection()
        try:
            await self.client(http).complete(request)
        except ModelError:
            if not http.body:
                raise
        finally:
            self._is_writing = False
        held = await self.budget.reserve(estimate(self.config, request), batched=True)
        if self._refusal is not None:
            if held is not None:
                self.budget.settle(held, 0.0)
            raise self._refusal
        draft = self._draft
        if (
            draft is None
            or len(draft.lines) >= self._provider.most_requests
            or draft.size_bytes + len(http.body) > self._provider.most_bytes
        ):
            draft = self._draft = Batch()
            self._batches.append(draft)
        name = custom_id(draft, len(draft.lines))
        draft.lines.append(self._provider.line(name, http.body, http.headers))
        draft.size_bytes += len(draft.lines[-1])
        draft.grown_s = time.monotonic()
        draft.most_usd[key] = None if held is None else held.usd
        if held is not None:
            draft.held[key] = held
        self._newest[key] = draft
        return draft

    def _settle(self, key: str, batch: Batch, usd: float | None) -> float | None:
        """Count the cost of a request once, and return it; None is the most that it can cost."""
        return self.budget.settle(batch.held.pop(key), usd) if key in batch.held else None

    def _settle_all(self, batch: Batch, usd: float | None) -> None:
        while batch.held:
            self.budget.settle(batch.held.popitem()[1], usd)

    async def _note(self, batch: Batch, event: BatchEvent, **fields: object) -> None:
        """Write the newest state of a batch; requests of a lost batch count as not sent."""
        known = {"batch": batch.token, "model": self.name, "event": event}
        now = datetime.now(UTC).strftime(_TIME)
        line = BatchLine.model_validate({**known, "time": now, **fields})
        await self.files.put(line)
        batch.take(line)
        if event == "lost":
            self._newest = {key: one for key, one in self._newest.items() if one is not batch}

    # A batch from its draft to its answers.

    async def _take_through(self, batch: Batch) -> None:
        """Send a complete draft; wait for answers of a batch, which may be lost or refused."""
        short_s = min(1.0, 4 * self.files.poll_s)
        if batch.event is None:
            while self._is_writing or time.monotonic() < batch.grown_s + (
                _QUIET_S if self._asked < self.files.expected else short_s
            ):
                await asyncio.sleep(short_s / 4)
            self._draft = None if self._draft is batch else self._draft
            if self._refusal is not None:
                raise self._refusal
            sending = asyncio.ensure_future(self._send(batch))
            try:
                await asyncio.shield(sending)
            except asyncio.CancelledError:
                await sending
                raise
        elif batch.event == "intended" and self._refusal is not None:
            raise self._refusal
        # It exists once the batch has ended.
        path = self.files.run_folder / "batches" / f"{batch.token}.answers.jsonl"
        lines = None
        if batch.event == "ended" and path.exists():
            lines = await asyncio.to_thread(path.read_bytes)
        elif batch.event != "lost":
            lines = await self._answered(batch, path)
        if lines is not None:
            batch.is_blank = not lines.strip()
            batch.answers = await asyncio.to_thread(answers_of, lines, self._provider, batch)

    async def _send(self, batch: Batch) -> None:
        """Send a draft; if that fails, nothing more is sent."""
        costs = [] if None in batch.most_usd.values() else list(batch.most_usd.values())
        await self._note(batch, "intended", keys=tuple(batch.most_usd), most_usd=costs)
        try:
            status = await self._patiently(partial(self._provider.create, batch.token, batch.lines))
        except UnavailableError as error:
            if error.sent == "maybe":
                self._refusal = self._unsure(batch, str(error))
                raise self._refusal from None
            why = f"a batch could not be sent: {error}"
            self._refusal = UnavailableError(why, status=error.status, sent=error.sent)
            self._settle_all(batch, 0.0)
            await self._note(batch, "lost", words=str(error))
            return
        await self._note(batch, "created", id=status.id)
        batch.lines.clear()
        self._notify(f"sent batch {batch.shown} of {len(batch.most_usd):,}")

    def _unsure(self, batch: Batch, why: str) -> UnavailableError:
        """Return the error of a batch that may exist, which a person has to check."""
        known = {"batch": batch.token, "model": self.name, "event": "created", "id": "ID"}
        line = BatchLine.model_validate({**known, "time": batch.created.strftime(_TIME)})
        return UnavailableError(
            f"it is not known whether batch {batch.token} was created: {why}. Look for this name "
            f"in the batches of your account ({self._provider.named_in}). If it is there, add this "
            f"line with the batch's id to {BATCHES}: {line.as_json()} "
            f"If not, remove the lines of {batch.token}: its requests are then sent again",
            sent="no",
        )

    async def _patiently(self, call: Callable[[], Awaitable[T]]) -> T:
        """Call until it succeeds or cannot. Raises UnavailableError if it never does."""
        try:
            return await self.policy.retrying(self.name, self.report)(call)
        except ModelError as error:
            raise UnavailableError(str(error), status=error.status, sent=error.sent) from None

    async def _answered(self, batch: Batch, path: Path) -> bytes | None:
        """Poll a batch until it has ended and keep its answers; None if it was refused."""
        pause_s, logged = min(_FIRST_PAUSE_S, self.files.poll_s), ""
        try:
            while True:
                status = await self._patiently(partial(self._provider.status, batch.id))
                if status.state != "running":
                    break
                if status.words != logged:
                    logged = status.words
                    since = batch.created.astimezone().strftime("%d %b %H:%M")
                    self._notify(f"waiting for batch {batch.shown} since {since}: {logged}")
                await asyncio.sleep(pause_s)
                pause_s = min(self.files.poll_s, 1.5 * pause_s)
            self._notify(f"batch {batch.shown} has ended: {status.words}")
            if status.state == "refused":
                self._refusal = UnavailableError(f"batch {batch.shown} was refused: {status.words}")
                self._settle_all(batch, 0.0)
                await self._note(batch, "lost", words=status.words)
                return None
            lines = await self._patiently(partial(self._provider.results, status))
        except ModelError as error:
            # In contrast, errors of its requests are recorded.
            why = f"no answers of batch {batch.shown}, which stays at the provider: {error}"
            raise UnavailableError(why, status=error.status, sent=error.sent) from None
        with writing(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            await asyncio.to_thread(atomic_write, path, lines, sync=True)
        await self._note(batch, "ended", words=status.words)
        return lines

    async def _read(self, key: str, request: Request, batch: Batch) -> Reply:
        """Return the reply that a direct call would return for the answer; raises like it."""
        assert batch.answers is not None, "the batch has ended"
        answer = batch.answers.get(key)
        if answer is None:
            why = f"batch {batch.shown} holds no answer that can be read"
            raise RetryableError(why, **{"sent": "no"} if batch.is_blank else {"status": 200})
        if isinstance(answer, str):
            why = f"batch {batch.shown} ended before this was asked: {answer}"
            raise RetryableError(why, sent="no")
        reply = await self.client(_NoConnection(answer)).complete(request)
        reply = reply.model_copy(update={"latency_s": 0.0, "batched": True})
        return reply.model_copy(update={"cost_usd": cost_usd(self.budget.tariff, reply)})

    def _notify(self, text: str) -> None:
        self.report(ModelEvent(self.name, "notice", text))


class _NoConnection(HttpClient):
    """Keeps the data of a request instead of sending it, and returns an answer that has arrived."""

    def __init__(self, answer: Answer | None = None) -> None:
        self.body = b""
        self.headers: Mapping[str, str] = {}
        self._answer = answer

    async def send(self, url: str, body: bytes, headers: Mapping[str, str], **_: Any) -> Answer:
        """Return the answer. Raises RetryableError if there is none: nothing was sent."""
        self.body, self.headers = body, headers
        if self._answer is None:
            raise RetryableError(f"a request to {url} is kept for a batch", sent="no")
        return self._answer


def custom_id(batch: Batch, place: int) -> str:
    """Return the name of a request in a batch."""
    return f"{batch.token}-{place}"


def answers_of(lines: bytes, provider: BatchProvider, batch: Batch) -> dict[str, Answer | str]:
    """Return the first readable answer to each request, or a text on why it was not processed."""
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
