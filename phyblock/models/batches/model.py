"""A model that is asked in batches: the cache first, then a batch for all that is not in it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass

from phyblock.config.models import ModelConfig
from phyblock.errors import ModelError, RetryableError, UnavailableError
from phyblock.models.batches.following import Follower
from phyblock.models.batches.ledger import Batch, BatchFiles, Ledger
from phyblock.models.batches.protocol import BatchProtocol
from phyblock.models.batches.purse import Purse
from phyblock.models.batches.sending import Draft, Sender, UnsureError
from phyblock.models.batches.wording import Wording, Written
from phyblock.models.cache import ReplyCache, reply_key
from phyblock.models.client import Client, HttpClient
from phyblock.models.costs import Budget, may_be_billed
from phyblock.models.model import EventKind, ModelEvent, Observer, RetryPolicy
from phyblock.models.prices import Prices, reply_cost_usd, today
from phyblock.models.request import AskLaterError, Request
from phyblock.records.reply import Reply

__all__ = ["BatchModel", "BatchParts"]


@dataclass(frozen=True)
class BatchParts:
    """What a model in batches is put together from; `client` makes one that sends through an
    HTTP client, by which requests are written and answers are read.
    """

    protocol: BatchProtocol
    client: Callable[[HttpClient], Client]
    files: BatchFiles
    cache: ReplyCache | None
    budget: Budget | None
    prices: Prices | None
    policy: RetryPolicy
    observer: Observer


class BatchModel:
    """A GatheringModel over a provider's batches.

    A request is in a draft, or in the newest batch that the ledger has it in. `_again` are those
    whose answer there failed; `_given` those whose answer a sample of this command has.
    """

    needs_messages = True

    def __init__(self, config: ModelConfig, parts: BatchParts) -> None:
        self.name = config.name
        self._config = config
        self._parts = parts
        protocol, files, policy = parts.protocol, parts.files, parts.policy
        self._ledger = Ledger(config.name, files)
        self._sender = Sender(protocol, self._ledger, files, policy, self._tell)
        self._follower = Follower(protocol, self._ledger, files, self._sender, policy, self._tell)
        self._wording = Wording(config, protocol, parts.client, self._say_seedless)
        self._purse = Purse(config, parts.budget, parts.prices)
        self._earlier = frozenset(self._ledger.batches)
        self._draft: Draft | None = None
        self._drafting = asyncio.Lock()
        self._failures: dict[str, int] = {}
        self._again: set[str] = set()
        self._given: set[str] = set()
        self._refusal: UnavailableError | None = None
        self._has_begun = False

    async def begin(self) -> None:
        """See GatheringModel; the first round takes up the batches of earlier commands."""
        if self._refusal is not None:
            raise self._refusal
        if not self._has_begun:
            self._has_begun = True
            for batch in tuple(self._ledger.batches.values()):
                await self._take_up(batch)

    async def gather(self, request: Request, *, anew: bool = False) -> bool:
        """See GatheringModel."""
        key = reply_key(self._config, request)
        if self._is_drafted(key) or await self._is_answered(key, request, anew=anew):
            return True
        return self._refusal is None and await self._take_in(key, request)

    async def _take_in(self, key: str, request: Request) -> bool:
        written = await self._wording.write(request)
        async with self._drafting:
            newest = self._ledger.newest(key)
            # Another sample that asks the same may have come first.
            if self._is_drafted(key) or (newest is not None and newest.event == "created"):
                return True
            return await self._add(key, request, written)

    async def dispatch(self) -> None:
        """See GatheringModel. What keeps a batch from being sent is raised by the next `begin`."""
        async with self._drafting:
            await self._send_draft()

    async def ask(self, request: Request) -> Reply:
        """The answer of the newest batch with the request, else the cached reply.

        Raises what the model seam says, AskLaterError where the request belongs to the next round,
        HaltedError when the run ends before the batch does.
        """
        key = reply_key(self._config, request)
        batch = self._ledger.newest(key)
        if batch is None or batch.event == "intended" or key in self._again:
            kept = self._kept(key)
            if kept is None:
                raise AskLaterError
            return kept.model_copy(
                update={"cost_usd": reply_cost_usd(self._parts.prices, kept, today())}
            )
        try:
            await asyncio.shield(self._following(batch))
            if batch.results is None:
                raise AskLaterError
            reply = await self._wording.read(key, request, batch)
        except UnavailableError:
            self._give_up()
            raise
        except ModelError as error:
            self._failed(key, batch, error)
            error.billed_usd = self._purse.billed_usd(key)
            if key in self._again:
                is_last = self._failures[key] >= self._parts.policy.attempts
                if not (is_last and batch.is_complete):
                    raise AskLaterError from None
            raise
        return await self._finished(key, request, batch, reply)

    async def aclose(self) -> None:
        """Release connections; batches go on at the provider."""
        followings = [b.following for b in self._ledger.batches.values() if b.following is not None]
        for following in followings:
            following.cancel()
        await asyncio.gather(*followings, return_exceptions=True)
        if self._draft is not None:
            self._draft.drop()
        await self._parts.protocol.wire.aclose()

    async def _take_up(self, batch: Batch) -> None:
        """Go on with a batch of an earlier command."""
        if batch.event == "intended":
            self._tell(f"looking for a batch of {len(batch.places):,} that was being sent")
            if not await self._sender.recover(batch):
                return
        if batch.event == "created":
            self._following(batch)

    def _following(self, batch: Batch) -> asyncio.Future[None]:
        if batch.following is None:
            batch.following = asyncio.ensure_future(self._follow(batch))
        return batch.following

    async def _follow(self, batch: Batch) -> None:
        had_ended = batch.event == "ended"
        await self._follower.follow(batch)
        if batch.event == "lost":
            self._refusal = UnavailableError(f"batch {batch.shown} was refused: {batch.words}")
            self._purse.settle_all(batch.held, 0.0)
        elif not batch.is_complete and not had_ended:
            self._refusal = UnavailableError(
                f"batch {batch.shown} was taken back before all of it was asked: give the same "
                "command again to ask the rest"
            )

    def _is_drafted(self, key: str) -> bool:
        return self._draft is not None and key in self._draft.keys

    async def _is_answered(self, key: str, request: Request, *, anew: bool) -> bool:
        """Whether `ask` will have something to say of a request, or will have when a batch ends."""
        batch = self._ledger.newest(key)
        if batch is not None and key not in self._again:
            if batch.token in self._earlier:
                self._purse.hold_again(batch, key)
            if batch.event != "ended":
                return True
            await asyncio.shield(self._following(batch))
            try:
                await self._wording.read(key, request, batch)
            except ModelError as error:
                if not anew and not isinstance(error, RetryableError):
                    return True
                # Where it was recorded, it was counted, too.
                self._purse.settle(key, batch, None if may_be_billed(error) and not anew else 0.0)
                self._again.add(key)
            else:
                return True
        return self._kept(key) is not None

    def _kept(self, key: str) -> Reply | None:
        cache = self._parts.cache
        return None if cache is None else cache.get(key)

    async def _add(self, key: str, request: Request, written: Written) -> bool:
        """Put a request into the draft, or into a new one where it is full; whether there was
        room.
        """
        draft = self._draft
        if draft is not None and not draft.takes(written):
            await asyncio.shield(self._send_draft())
            if self._refusal is not None:
                return False
        most_usd = self._purse.most_usd(request)
        if not self._purse.fits(most_usd):
            if self._draft is not None or self._is_waiting:
                return False
            await self._purse.wait_for(most_usd)
        if self._draft is None:
            files = self._parts.files
            self._draft = Draft(self._parts.protocol, files, seeded=written.seeded)
        self._draft.add(key, written, most_usd)
        self._purse.hold(key, most_usd, self._draft.held)
        return True

    @property
    def _is_waiting(self) -> bool:
        """Whether a batch is under way."""
        return any(batch.event == "created" for batch in self._ledger.batches.values())

    async def _send_draft(self) -> None:
        draft, self._draft = self._draft, None
        if draft is None:
            return
        try:
            batch = await self._sender.send(draft)
        except UnavailableError as error:
            self._refusal = error
            self._purse.settle_all(draft.held, None if isinstance(error, UnsureError) else 0.0)
            return
        self._again.difference_update(batch.places)
        self._tell(f"sent batch {batch.shown}: {draft.size}")
        self._following(batch)

    def _failed(self, key: str, batch: Batch, error: ModelError) -> None:
        """Count a failed answer; one that may pass is asked for again."""
        self._purse.settle(key, batch, None if may_be_billed(error) else 0.0)
        if isinstance(error, RetryableError):
            self._again.add(key)
            self._failures[key] = self._failures.get(key, 0) + 1

    async def _finished(self, key: str, request: Request, batch: Batch, reply: Reply) -> Reply:
        """The reply with its cost, in the cache; to a second sample that asks the same a copy."""
        reply = reply.model_copy(
            update={"cost_usd": reply_cost_usd(self._parts.prices, reply, batch.day)}
        )
        if key in self._given:
            return reply.model_copy(update={"cached": True, "attempts": 0})
        self._given.add(key)
        self._purse.settle(key, batch, reply.cost_usd)
        self._purse.learn(request, reply)
        attempts = self._failures.get(key, 0) + 1
        reply = reply.model_copy(
            update={"billed_usd": self._purse.billed_usd(key), "attempts": attempts}
        )
        if self._parts.cache is not None:
            self._parts.cache.put(key, self._config.id, reply)
        return reply

    def _give_up(self) -> None:
        """Count all that is under way as spent: no more is heard of it in this command."""
        for batch in self._ledger.batches.values():
            self._purse.settle_all(batch.held, None)

    def _say_seedless(self) -> None:
        self._tell("takes no seed: seeds are independent repeats", "seed_unsupported")

    def _tell(self, text: str, kind: EventKind = "batch") -> None:
        self._parts.observer(ModelEvent(self.name, kind, text))
