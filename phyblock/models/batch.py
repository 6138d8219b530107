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
    Prices,
    counted,
    estimate,
    may_be_billed,
    reply_cost_usd,
    today,
    worst_usd,
)
from phyblock.models.model import EventKind, ModelEvent, Observer, RetryPolicy
from phyblock.models.request import AskLaterError, Request
from phyblock.records.files import BATCHES
from phyblock.records.record import BatchEvent, BatchLine, Reply

T = TypeVar("T")

_FIRST_PAUSE_S = 5.0
_CLOCKS_APART_S = 3600.0


class UnsureError(UnavailableError):
    """It is not known whether the provider has a batch."""


@dataclass(eq=False, kw_only=True)
class BatchModel:
    """A GatheringModel over a provider's batches.

    `client` makes a client that sends through an HTTP client: by it requests are written and
    answers are read as those of direct calls. `_again` are requests whose answer in the newest
    batch failed, `_failures` how often; `_given` those whose answer a sample of this command has,
    `_billed_usd` what a limit counted for each.
    """

    config: ModelConfig
    client: Callable[[HttpClient], Client]
    files: BatchFiles
    cache: ReplyCache | None
    budget: ModelBudget | None
    prices: Prices | None
    policy: RetryPolicy
    observer: Observer
    needs_messages: bool = field(default=True, init=False)

    def __post_init__(self) -> None:
        self.name = self.config.name
        self._provider = PROVIDERS[self.config.provider](self.config)
        self._ledger = Ledger(self.name, self.files)
        self._earlier = {key for batch in self._ledger.batches.values() for key in batch.places}
        self._drafting = asyncio.Lock()
        self._draft: _Draft | None = None
        self._refusal: UnavailableError | None = None
        self._has_begun = False
        self._takes_seed = self.config.seed != "never"
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
                self._tell(f"looking for a batch of {len(batch.places):,} that was being sent")
                # A call that was cut off may still be worked on over there.
                status = await self._find(batch, time.time() + 2 * self.files.poll_s)
                if status is None:
                    await self._ledger.note(batch.token, "lost", words="not found at the provider")
                else:
                    await self._ledger.note(batch.token, "created", id=status.id)
            if batch.event == "created":
                self._following(batch)

    async def gather(self, request: Request, *, anew: bool = False) -> bool:
        """See GatheringModel."""
        key = reply_key(self.config, request)
        async with self._drafting:
            is_drafted = self._draft is not None and key in self._draft.keys
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
            cost_usd = reply_cost_usd(self.prices, kept, today())
            return kept.model_copy(update={"cost_usd": cost_usd})
        try:
            await asyncio.shield(self._following(batch))
            if batch.answers is None:
                raise AskLaterError
            reply = await self._read(key, request, batch)
        except UnavailableError:
            # No more is heard in this command of what is under way: it counts as spent.
            for each in self._ledger.batches.values():
                self._settle_all(each.held, None)
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
        cost_usd = reply_cost_usd(self.prices, reply, batch.created.date())
        if key in self._given:
            # A second sample that asks the same.
            update = {"cost_usd": cost_usd, "cached": True, "attempts": 0}
            return reply.model_copy(update=update)
        self._given.add(key)
        self._settle(key, batch, cost_usd)
        if self.budget is not None:
            self.budget.learn(estimate(self.config, request), reply.usage)
        billed_usd, attempts = self._billed_usd.get(key), self._failures[key] + 1
        update = {"cost_usd": cost_usd, "billed_usd": billed_usd, "attempts": attempts}
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
            if key in self._earlier and self.budget is not None:
                # Held once, however often it is gathered.
                self._earlier.discard(key)
                batch.held[key] = self.budget.hold(batch.most_usd(key))
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
        usd = worst_usd(self.prices, self.budget, estimate(self.config, request), batched=True)
        held: int | None = None
        if self.budget is not None:
            # Under a limit prices are known.
            most = usd or 0.0
            if self.budget.fits(most):
                held = self.budget.hold(most)
            elif self._draft or any(b.event == "created" for b in self._ledger.batches.values()):
                return False
            else:
                held = await self.budget.reserve(lambda: most)
        if self._draft is not None and not self._draft.add(key, http, usd, held, seeded=seeded):
            sending = asyncio.ensure_future(self._send_draft())
            try:
                await asyncio.shield(sending)
            except asyncio.CancelledError:
                await sending
                raise
            if self._refusal is not None:
                self._settle_all({} if held is None else {key: held}, 0.0)
                return False
        if self._draft is None:
            self._draft = _Draft(self._provider, seeded)
            self._draft.add(key, http, usd, held, seeded=seeded)
        return True

    def _settle(self, key: str, batch: Batch, usd: float | None) -> None:
        """Count the cost of a request, once; None is all that it can have cost."""
        if self.budget is not None and key in batch.held:
            spent_usd = self.budget.settle(batch.held.pop(key), usd)
            self._billed_usd[key] = self._billed_usd.get(key, 0.0) + spent_usd

    def _settle_all(self, held: dict[str, int], usd: float | None) -> None:
        while self.budget is not None and held:
            self.budget.settle(held.popitem()[1], usd)

    # Sending, and finding again what an earlier process was sending.

    async def _send_draft(self) -> None:
        draft, self._draft = self._draft, None
        if draft is None:
            return
        try:
            batch = await self._send(draft)
        except UnavailableError as error:
            # Whether one was sent of which that is not known, the next command finds out.
            self._refusal = error
            self._settle_all(draft.held, None if isinstance(error, UnsureError) else 0.0)
            return
        self._again.difference_update(batch.places)
        requests = "1 request" if len(batch.places) == 1 else f"{len(batch.places):,} requests"
        self._tell(f"sent batch {batch.shown}: {requests}")
        self._following(batch)

    async def _send(self, draft: _Draft) -> Batch:
        """Send a draft; return the batch, which the provider has, with its id on disk.

        Raises UnavailableError where it cannot be sent, and nothing was asked; UnsureError where
        that is not known.
        """
        known = [usd for usd in draft.keys.values() if usd is not None]
        costs = tuple(known) if len(known) == len(draft.keys) else ()
        fields = {"keys": tuple(draft.keys), "most_usd": costs, "seeded": draft.seeded}
        await self._ledger.note(draft.token, "intended", **fields)
        batch = self._ledger.batches[draft.token]
        batch.held = draft.held

        async def create() -> BatchStatus:
            try:
                return await self._provider.create(batch.token, draft.lines)
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
            await self._ledger.note(batch.token, "lost", words=str(error))
            why = f"a batch could not be sent: {error}"
            raise UnavailableError(why, status=error.status, sent=error.sent) from None
        await self._ledger.note(batch.token, "created", id=status.id)
        return batch

    async def _find(self, batch: Batch, until_s: float) -> BatchStatus | None:
        """Return the batch that was being sent; None where there is none until then.

        Those without a name that may be it are waited for: their answers say whose they are.
        Raises UnsureError where the list or the answers of one cannot be read.
        """
        strangers = {one.id for one in self._ledger.batches.values()}

        async def candidates() -> list[BatchStatus]:
            found = []
            async for status in self._provider.listed():
                earliest_s = batch.created.timestamp() - _CLOCKS_APART_S
                if status.created_s is not None and status.created_s < earliest_s:
                    break
                is_like = status.total in (None, 0, len(batch.places)) and status.state != "refused"
                is_nameless = status.token is None and is_like and status.id not in strangers
                if status.token == batch.token or is_nameless:
                    found.append(status)
            return sorted(found, key=lambda status: status.token is None)

        try:
            while True:
                running = False
                for status in await self._patiently(candidates):
                    if status.token == batch.token:
                        return status
                    if status.state == "running":
                        running = True
                        continue
                    lines = await self._patiently(partial(self._provider.results, status))
                    if (await asyncio.to_thread(Answers, lines, self._provider, batch)).found:
                        return status
                    strangers.add(status.id)
                if not running and time.time() >= until_s:
                    return None
                left_s = self.files.poll_s if running else until_s - time.time()
                await asyncio.sleep(max(0.01, min(self.files.poll_s, left_s)))
        except UnavailableError as error:
            raise UnsureError(
                f"it is not known whether a batch of {len(batch.places):,} was sent: {error}. If "
                f"it was not, remove the lines of {batch.token} from {BATCHES}: its questions are "
                "then asked again, and billed again if it was",
                status=error.status, sent=error.sent,
            ) from None  # fmt: skip

    async def _patiently(self, call: Callable[[], Awaitable[T]]) -> T:
        """Call until it succeeds or cannot; UnavailableError where it never does."""

        def on_retry(error: RetryableError, wait_s: float) -> None:
            # A log would fall silent over a long wait.
            if wait_s >= 2.0:
                self._tell(f"trying again in {wait_s:.0f} s: {error}")

        try:
            async for attempt in self.policy.retrying(on_retry):
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
        """Return when the batch has ended and its answers are here, or when it is lost: refused as
        a whole, so that nothing was asked.

        Raises UnavailableError where nothing can be learned of it now: it is left as it is.
        """
        path = self.files.answers(batch.token)
        if batch.event == "created":
            try:
                status = await self._end(batch)
                words = self._provider.shown(status.words)
                if status.state == "refused":
                    await self._ledger.note(batch.token, "lost", words=words)
                    self._refusal = UnavailableError(f"batch {batch.shown} was refused: {words}")
                    self._settle_all(batch.held, 0.0)
                    return
                lines = await self._patiently(lambda: self._provider.results(status))
            except ModelError as error:
                # An error of its requests is another thing: these are asked again, or recorded.
                why = f"no answers of batch {batch.shown}, which stays at the provider: {error}"
                raise UnavailableError(why, status=error.status, sent=error.sent) from None
            with writing(path):
                path.parent.mkdir(parents=True, exist_ok=True)
                await asyncio.to_thread(atomic_write, path, lines, sync=True)
            fields = {"words": words, "is_complete": status.is_complete}
            await self._ledger.note(batch.token, "ended", **fields)
            if not status.is_complete:
                self._refusal = UnavailableError(
                    f"batch {batch.shown} was taken back before all of it was asked: give the same "
                    "command again to ask the rest"
                )
        if not path.exists():
            raise UnavailableError(
                f"the answers of batch {batch.shown} are gone ({path}): without its lines in "
                f"{BATCHES} its questions are asked again"
            )
        lines = await asyncio.to_thread(path.read_bytes)
        batch.answers = await asyncio.to_thread(Answers, lines, self._provider, batch)
        if faults := batch.answers.faults:
            said = ", ".join(f"{n} {what}" for what, n in sorted(faults.items()))
            self._tell(f"batch {batch.shown} holds lines {said}")

    async def _end(self, batch: Batch) -> BatchStatus:
        """Look at a batch now and then; return its last state."""
        pause_s, failures, told = min(_FIRST_PAUSE_S, self.files.poll_s), 0, ""
        since = datetime.fromtimestamp(batch.created.timestamp()).strftime("%d %b %H:%M")
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
                self._tell(f"waiting for batch {batch.shown} since {since}: {said}")
                told = said
            await asyncio.sleep(pause_s)
            pause_s = min(self.files.poll_s, 1.5 * pause_s)

    # Requests as lines and answers as replies, by the client of direct calls.

    async def _written(self, request: Request) -> tuple[_NoConnection, bool]:
        """Return the body and headers of a direct call, and True if it has a seed; raises as a
        direct call does before it sends.
        """
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
        """Return the reply that a direct call would have made of the answer; raises as that does.

        RetryableError also where there is no answer, or none that can be read.
        """
        assert batch.answers is not None, "the batch has ended"
        answer = batch.answers.found.get(batch.places[key])
        if answer is None:
            has_lines = batch.answers.found or batch.answers.faults
            why = f"batch {batch.shown} holds no answer that can be read"
            raise RetryableError(why, status=200) if has_lines else RetryableError(why, sent="no")
        if isinstance(answer, str):
            why = f"batch {batch.shown} ended before this was asked: {answer}"
            raise RetryableError(self._provider.shown(why), sent="no")
        client = self.client(_NoConnection(answer))
        try:
            reply = await client.complete(request, with_seed=batch.intent.seeded)
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


@dataclass(eq=False)
class _Draft:
    """A batch that is being put together; `keys` are its requests with the most that each can cost
    [US dollars], None where no price is known; `held` are their reservations.
    """

    provider: BatchProvider
    seeded: bool
    # What the providers allow in names and boundaries.
    token: str = field(default_factory=lambda: f"pb{secrets.token_hex(12)}")
    keys: dict[str, float | None] = field(default_factory=dict)
    held: dict[str, int] = field(default_factory=dict)
    lines: list[bytes] = field(default_factory=list)
    size: int = 0

    def add(
        self, key: str, http: _NoConnection, usd: float | None, held: int | None, *, seeded: bool
    ) -> bool:
        """Take a request in; return False where it does not fit, by the bounds of a batch and as
        all ask with a seed or without.
        """
        name = custom_id(self.token, len(self.keys))
        line = self.provider.line(name, http.body, http.headers)
        is_full = len(self.keys) >= self.provider.most_requests
        is_full = is_full or self.size + len(line) >= self.provider.most_bytes
        if self.keys and (is_full or seeded != self.seeded):
            return False
        self.lines.append(line)
        self.size += len(line) + 1
        self.keys[key] = usd
        if held is not None:
            self.held[key] = held
        return True


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
    """A batch: its line of intent, its newest state, and its answers when they are here.

    `places` are its requests by their keys in the reply cache, `held` their reservations in the
    budget. `following` is the work that ends when it has ended.
    """

    intent: BatchLine
    event: BatchEvent = "intended"
    id: str = ""
    places: dict[str, int] = field(default_factory=dict)
    held: dict[str, int] = field(default_factory=dict)
    following: asyncio.Future[None] | None = None
    answers: Answers | None = None

    def __post_init__(self) -> None:
        self.places = {key: place for place, key in enumerate(self.intent.keys)}

    @property
    def token(self) -> str:
        """Our name for it."""
        return self.intent.batch

    @property
    def shown(self) -> str:
        """Its name for people."""
        return self.id or self.token

    @property
    def created(self) -> datetime:
        """When it was about to be sent, in UTC; its answers are priced by that day."""
        return datetime.strptime(self.intent.time, "%Y-%m-%dT%H:%M:%SZ").replace(tzinfo=UTC)

    def most_usd(self, key: str) -> float:
        """Return the most that one of its requests can cost."""
        return self.intent.most_usd[self.places[key]] if self.intent.most_usd else 0.0


class Ledger:
    """The batches of one model; every change is on disk when `note` returns."""

    def __init__(self, model: str, files: BatchFiles) -> None:
        self._model = model
        self._files = files
        self.batches: dict[str, Batch] = {}
        for line in files.earlier:
            if line.model == model:
                self._take(line)

    def newest(self, key: str) -> Batch | None:
        """Return the last batch that a request went out in, or is about to."""
        return next((b for b in reversed(self.batches.values()) if key in b.places), None)

    async def note(self, token: str, event: BatchEvent, **fields: object) -> None:
        """Write the newest state of a batch; one that is `intended` counts as under way."""
        time = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
        told = {"batch": token, "model": self._model, "event": event, "time": time, **fields}
        line = BatchLine.model_validate(told)
        await self._files.put(line)
        self._take(line)

    def _take(self, line: BatchLine) -> None:
        if line.event == "intended":
            self.batches[line.batch] = Batch(line)
        elif line.event == "lost":
            # Its requests count as not sent in it.
            self.batches.pop(line.batch).event = "lost"
        else:
            batch = self.batches[line.batch]
            batch.event, batch.id = line.event, line.id or batch.id


class Answers:
    """The first readable answer to each request of a batch that has one, by its place there; a text
    says why the request was never asked. `faults` counts other lines by what is wrong with them.
    """

    def __init__(self, lines: bytes, provider: BatchProvider, batch: Batch) -> None:
        self.found: dict[int, Answer | str] = {}
        self.faults: Counter[str] = Counter()
        places = {custom_id(batch.token, place): place for place in batch.places.values()}
        for line in filter(None, map(bytes.strip, lines.splitlines())):
            try:
                name, answer = provider.read(load_json(line))
                place = places.get(name)
            except UNREADABLE:
                self.faults["that cannot be read"] += 1
                continue
            if place is None:
                self.faults["to what was not asked"] += 1
            elif place in self.found:
                self.faults["to what has an answer already"] += 1
            else:
                self.found[place] = answer


def custom_id(token: str, place: int) -> str:
    """Return the name of a request in a batch."""
    return f"{token}-{place}"


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

    files = BatchFiles(tuple(lines), put, run_folder)
    provider = PROVIDERS[config.provider](config)
    waiting: set[str] = set()
    for batch in Ledger(config.name, files).batches.values():
        path = files.answers(batch.token)
        # Without its answers a batch stops its model: nothing of it is asked again.
        if batch.event != "ended" or not path.is_file():
            waiting |= batch.places.keys()
            continue
        found = Answers(path.read_bytes(), provider, batch).found
        for key, place in batch.places.items():
            answer = found.get(place)
            if isinstance(answer, Answer) and answer.is_success:
                waiting.add(key)
    return frozenset(waiting)
