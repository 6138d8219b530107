"""Sending a batch so that it is never sent twice, and finding again one that was cut off.

Between the request that makes a batch and its id on disk nobody knows whether there is one. It is
looked for under our name; where the provider tells no names, among the batches of that time with as
many requests, by what the first answer of each says that it answers.
"""

from __future__ import annotations

import asyncio
import time
from collections import defaultdict
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import TypeVar

from phyblock.errors import ModelError, RetryableError, UnavailableError
from phyblock.files import writing
from phyblock.models.batches.ledger import Batch, BatchFiles, Ledger, new_token
from phyblock.models.batches.protocol import BatchProtocol, BatchStatus
from phyblock.models.batches.results import Results, custom_id
from phyblock.models.batches.wording import Written
from phyblock.models.model import RetryPolicy, Tell
from phyblock.records.files import BATCHES
from phyblock.text import counted

__all__ = ["Draft", "Sender", "UnsureError"]

T = TypeVar("T")

_WORTH_A_WORD_S = 2.0
"""Waits that are so long are told, or a log would fall silent."""
_CLOCKS_APART_S = 3600.0
_HINT = "free some space and give the same command again: nothing of this batch was sent"


class UnsureError(UnavailableError):
    """It is not known whether the provider has a batch."""


class Draft:
    """A batch that is being written into a file; `keys` are its requests with the most that each
    can cost [US dollars], None where no price is known; `held` are their
    reservations in the budget.
    """

    def __init__(self, protocol: BatchProtocol, files: BatchFiles, *, seeded: bool) -> None:
        self.seeded = seeded
        self.token = new_token()
        self.path = files.requests(self.token)
        self.keys: dict[str, float | None] = {}
        self.held: dict[str, int] = {}
        self._protocol = protocol
        self._bytes = 0
        with writing(self.path, _HINT):
            files.folder.mkdir(parents=True, exist_ok=True)
            self._file = self.path.open("wb")
        self._write(protocol.head(self.token))

    def takes(self, written: Written) -> bool:
        """Whether a request still fits, by the provider's limits and as all ask with a seed or
        without.
        """
        size = self._bytes + len(self._line(written)) + len(self._protocol.tail(self.token)) + 1
        has_room = len(self.keys) < self._protocol.most_requests
        return has_room and size <= self._protocol.most_bytes and written.seeded == self.seeded

    def add(self, key: str, written: Written, most_usd: float | None) -> None:
        """Write a request, which can cost so much."""
        line = self._line(written)
        self._write(self._protocol.between if self.keys else b"")
        self._write(line)
        self.keys[key] = most_usd

    def close(self) -> None:
        """End the file."""
        if not self._file.closed:
            self._write(self._protocol.tail(self.token))
            with writing(self.path, _HINT):
                self._file.close()

    def drop(self) -> None:
        """Remove the file: the batch is there, or nothing was asked."""
        self._file.close()
        self.path.unlink(missing_ok=True)

    def _line(self, written: Written) -> bytes:
        name = custom_id(self.token, len(self.keys))
        return self._protocol.line(name, written.body, written.headers)

    def _write(self, data: bytes) -> None:
        with writing(self.path, _HINT):
            self._bytes += self._file.write(data)

    @property
    def size(self) -> str:
        """How much it is, in words."""
        megabytes = self._bytes / 1e6
        weight = f"{megabytes:.1f} MB" if megabytes >= 0.1 else f"{1000 * megabytes:.0f} kB"
        return f"{counted(len(self.keys), 'request')}, {weight}"


class Sender:
    """Sends drafts of one model, and finds again what an earlier process was sending; `tell` hears
    what is waited for. `_strangers` are batches that are known not to be the one of a token.
    """

    def __init__(
        self,
        protocol: BatchProtocol,
        ledger: Ledger,
        files: BatchFiles,
        policy: RetryPolicy,
        tell: Tell,
    ) -> None:
        self._protocol = protocol
        self._ledger = ledger
        self._files = files
        self._policy = policy
        self._tell = tell
        self._strangers: defaultdict[str, set[str]] = defaultdict(set)

    async def send(self, draft: Draft) -> Batch:
        """Send a draft: the batch, which the provider has, with its id on disk.

        Raises UnavailableError where it cannot be sent, and nothing was asked; UnsureError where
        that is not known: the next command finds out.
        """
        try:
            return await self._send(draft)
        finally:
            draft.drop()

    async def _send(self, draft: Draft) -> Batch:
        draft.close()
        known = [usd for usd in draft.keys.values() if usd is not None]
        most_usd = known if len(known) == len(draft.keys) else []
        batch = await self._ledger.intend(draft.token, draft.keys, most_usd, seeded=draft.seeded)
        batch.held = draft.held
        try:
            status = await self._create(batch, draft.path)
        except UnsureError:
            raise
        except ModelError as error:
            await self._ledger.tell(batch, "lost", words=str(error))
            raise UnavailableError(
                f"a batch could not be sent: {error}", status=error.status, sent=error.sent
            ) from None
        await self._ledger.tell(batch, "created", id=status.id)
        return batch

    async def recover(self, batch: Batch) -> bool:
        """Whether the provider has a batch whose sending was cut off; it is then known by its id.

        Raises UnavailableError where that cannot be found out.
        """
        # A request that was cut off may still be worked on over there.
        status = await self._find(batch, time.time() + 2 * self._files.poll_s)
        if status is None:
            await self._ledger.tell(batch, "lost", words="not found at the provider")
            return False
        await self._ledger.tell(batch, "created", id=status.id)
        return True

    async def _create(self, batch: Batch, path: Path) -> BatchStatus:
        """Upload and begin, as often as is usual for requests."""
        file = await self.patiently(lambda: self._protocol.upload(batch.token, path))

        async def create() -> BatchStatus:
            try:
                return _named(await self._protocol.create(batch.token, path, file))
            except RetryableError as error:
                if error.sent == "no" or error.status == 429:
                    raise
                known = await self._find(batch, time.time() + self._files.poll_s)
                if known is None:
                    raise
                return known

        return await self.patiently(create)

    async def _find(self, batch: Batch, until_s: float) -> BatchStatus | None:
        """The batch with our name; None where there is none until then."""
        while True:
            try:
                found = await self._look_for(batch)
            except UnsureError:
                raise
            except UnavailableError as error:
                why = f"whether a batch was sent cannot be found out: {error}"
                raise UnsureError(why, status=error.status, sent=error.sent) from None
            if found is not None or time.time() >= until_s:
                return found
            await asyncio.sleep(min(self._files.poll_s, max(0.01, until_s - time.time())))

    async def _look_for(self, batch: Batch) -> BatchStatus | None:
        """The batch among those that the provider lists now, by its name or its answers.

        Those without a name are waited for, as none can be told before it has ended. Raises
        UnsureError where the answers of one cannot be read, and no other is ours.
        """
        named, candidates = await self.patiently(lambda: self._listed(batch))
        if named is not None:
            return named
        unread: dict[str, str] = {}
        is_told = False
        while candidates:
            for status in candidates:
                if status.state == "running":
                    continue
                try:
                    if await self._answers(status, batch):
                        return status
                except ModelError as error:
                    unread[status.id] = str(error)
                else:
                    self._strangers[batch.token].add(status.id)
            running = [status.id for status in candidates if status.state == "running"]
            if running and not is_told:
                is_told = True
                self._tell(
                    f"whether one of the batches {', '.join(running)} is the one that was being "
                    "sent shows when it has ended: waiting for that"
                )
            if running:
                await asyncio.sleep(self._files.poll_s)
            candidates = []
            for batch_id in running:
                try:
                    candidates.append(await self._looked_at(batch_id))
                except ModelError as error:
                    unread[batch_id] = str(error)
        if unread:
            said = "; ".join(f"{batch_id}: {why}" for batch_id, why in unread.items())
            raise UnsureError(
                f"a batch of {len(batch.places):,} that was being sent may be one whose answers "
                f"cannot be read ({said}). If it is not, remove the lines of {batch.token} from "
                f"{BATCHES}: its questions are then asked again, and billed again if it is"
            )
        return None

    async def _looked_at(self, batch_id: str) -> BatchStatus:
        return await self.patiently(lambda: self._protocol.look(batch_id))

    async def _listed(self, batch: Batch) -> tuple[BatchStatus | None, list[BatchStatus]]:
        """The batch with our name, and those without a name that may be it."""
        requests, candidates = len(batch.places), []
        others = self._ledger.ids | self._strangers[batch.token]
        async for status in self._protocol.listed():
            if status.token == batch.token:
                return status, []
            created_s = status.created_s
            if created_s is not None and created_s < batch.created_s - _CLOCKS_APART_S:
                break
            is_like = status.total in (None, 0, requests) and status.id not in others
            if status.token is None and is_like and status.state != "refused":
                candidates.append(status)
        return None, candidates

    async def _answers(self, status: BatchStatus, batch: Batch) -> bool:
        """Whether a batch that has ended answers what this one asks."""
        path = self._files.candidate(batch.token)
        try:
            await self.patiently(lambda: self._protocol.wire.download(status.results, path))
            found = await asyncio.to_thread(
                Results, path, self._protocol, batch.token, len(batch.places)
            )
        finally:
            path.unlink(missing_ok=True)
        return len(found) > 0

    async def patiently(self, call: Callable[[], Awaitable[T]]) -> T:
        """Call until it succeeds or cannot; UnavailableError where it never does."""
        try:
            async for attempt in self._policy.retrying(self._say_retry):
                with attempt:
                    return await call()
        except UnavailableError:
            raise
        except ModelError as error:
            raise UnavailableError(str(error), status=error.status, sent=error.sent) from None
        raise AssertionError("tenacity neither returned nor raised")

    def _say_retry(self, error: RetryableError, wait_s: float) -> None:
        if wait_s >= _WORTH_A_WORD_S:
            self._tell(f"trying again in {wait_s:.0f} s: {error}")


def _named(status: BatchStatus) -> BatchStatus:
    if not status.id:
        raise RetryableError("a batch without an id was answered", status=200)
    return status
