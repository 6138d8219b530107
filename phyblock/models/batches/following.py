"""Waiting for a batch: looking at it now and then, telling how far it is, fetching its answers."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from datetime import datetime

from phyblock.errors import ModelError, RetryableError, UnavailableError
from phyblock.files import sync_folder, writing
from phyblock.models.batches.ledger import Batch, BatchFiles, Ledger
from phyblock.models.batches.protocol import BatchProtocol, BatchStatus
from phyblock.models.batches.results import Results
from phyblock.models.batches.sending import Sender
from phyblock.models.model import RetryPolicy, Tell
from phyblock.records.files import BATCHES

__all__ = ["Follower"]

_FIRST_PAUSE_S = 5.0
_TELL_EVERY_S = 600.0


class Follower:
    """Follows the batches of one model to their ends; `tell` hears how far they are."""

    def __init__(
        self,
        protocol: BatchProtocol,
        ledger: Ledger,
        files: BatchFiles,
        sender: Sender,
        policy: RetryPolicy,
        tell: Tell,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._protocol = protocol
        self._ledger = ledger
        self._files = files
        self._sender = sender
        self._policy = policy
        self._tell = tell
        self._now = now

    async def follow(self, batch: Batch) -> None:
        """Return when the batch has ended and its answers are here, or when it is lost: refused as
        a whole, so that nothing was asked.

        Raises UnavailableError where nothing can be learned of it now: it is left as it is.
        """
        if batch.event == "created":
            try:
                status = await self._end(batch)
                if status.state != "refused":
                    await self._fetch(batch, status)
            except ModelError as error:
                # An error of its requests is another thing: these are asked again, or recorded.
                why = f"no answers of batch {batch.shown}, which stays at the provider: {error}"
                raise UnavailableError(why, status=error.status, sent=error.sent) from None
            words = self._words(status)
            if status.state == "refused":
                await self._ledger.tell(batch, "lost", words=words)
                return
            await self._ledger.tell(batch, "ended", words=words, is_complete=status.is_complete)
        path = self._files.answers(batch.token)
        if not path.exists():
            raise UnavailableError(
                f"the answers of batch {batch.shown} are gone ({path}): without its lines in "
                f"{BATCHES} its questions are asked again"
            )
        batch.results = await asyncio.to_thread(
            Results, path, self._protocol, batch.token, len(batch.places)
        )
        if batch.results.remark:
            self._tell(f"batch {batch.shown} holds lines {batch.results.remark}")

    def _words(self, status: BatchStatus) -> str:
        said = f": {status.words}" if status.words else ""
        return self._protocol.wire.shown(f"{status.progress}{said}")

    async def _end(self, batch: Batch) -> BatchStatus:
        """What the provider says when the batch has ended."""
        pause_s, failures = min(_FIRST_PAUSE_S, self._files.poll_s), 0
        told, told_s = "", self._now()
        since = datetime.fromtimestamp(batch.created_s).strftime("%d %b %H:%M")
        while True:
            try:
                status = await self._protocol.look(batch.id)
                failures = 0
                said = self._words(status)
            except RetryableError as error:
                failures += 1
                if failures >= self._policy.max_connection_failures:
                    raise
                said = f"cannot be looked at now ({error})"
            else:
                if status.state != "running":
                    self._tell(f"batch {batch.shown} has ended: {said}")
                    return status
            if said != told or self._now() - told_s >= _TELL_EVERY_S:
                self._tell(f"waiting for batch {batch.shown} since {since}: {said}")
                told, told_s = said, self._now()
            await asyncio.sleep(pause_s)
            pause_s = min(self._files.poll_s, 1.5 * pause_s)

    async def _fetch(self, batch: Batch, status: BatchStatus) -> None:
        """Have the answers on disk, whole."""
        path = self._files.answers(batch.token)
        part = self._files.half_fetched(batch.token)
        path.parent.mkdir(parents=True, exist_ok=True)
        wire = self._protocol.wire
        await self._sender.patiently(lambda: wire.download(status.results, part))
        with writing(path):
            part.replace(path)
            sync_folder(path.parent)
