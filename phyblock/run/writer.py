"""Records on their way to disk: those that come while one sync runs share the next."""

from __future__ import annotations

import asyncio

from phyblock.records.line import Line
from phyblock.run.appending import AppendFile

__all__ = ["RecordWriter"]


class RecordWriter:
    """Appends records off the event loop; `put` returns when its record is synced."""

    def __init__(self, file: AppendFile) -> None:
        self._file = file
        self._waiting: list[tuple[Line, asyncio.Future[None]]] = []
        self._flusher: asyncio.Task[None] | None = None

    async def put(self, record: Line) -> None:
        """Append a record and wait until it is on disk; StoreError when the disk refuses."""
        written: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._waiting.append((record, written))
        if self._flusher is None:
            self._flusher = asyncio.create_task(self._flush())
        await written

    async def drain(self) -> None:
        """Wait until everything that was put is on disk or refused."""
        if self._flusher is not None:
            await self._flusher

    async def _flush(self) -> None:
        while self._waiting:
            batch, self._waiting = self._waiting, []
            failure: Exception | None = None
            try:
                await asyncio.to_thread(self._file.append, [line.fields() for line, _ in batch])
            except Exception as error:
                # Whatever it is, those who wait must hear of it, or they wait for ever.
                failure = error
            # A waiter that was cancelled has a future that is already done.
            for written in (future for _, future in batch if not future.done()):
                if failure is None:
                    written.set_result(None)
                else:
                    written.set_exception(failure)
        self._flusher = None
