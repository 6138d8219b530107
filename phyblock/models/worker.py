"""One thread that does what may block, in order, so that the event loop never does."""

from __future__ import annotations

import asyncio
import queue
import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

__all__ = ["Worker"]

T = TypeVar("T")
_Job = tuple[Callable[[], Any], "Future[Any]"]


class Worker:
    """Jobs one after the other, in a thread that starts with the first.

    It does not keep the process alive: a job that hangs for ever cannot hold up the end.
    """

    def __init__(self, name: str) -> None:
        self._jobs: queue.SimpleQueue[_Job | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._work, name=name, daemon=True)

    def run(self, job: Callable[[], T]) -> asyncio.Future[T]:
        """What the job returns or raises; one that has begun goes on when the wait is given up."""
        if not self._thread.is_alive():
            self._thread.start()
        done: Future[T] = Future()
        self._jobs.put((job, done))
        return asyncio.wrap_future(done)

    def stop(self) -> None:
        """End the thread once its jobs are done; nothing is run afterwards."""
        self._jobs.put(None)

    def _work(self) -> None:
        while (given := self._jobs.get()) is not None:
            job, done = given
            if not done.set_running_or_notify_cancel():
                continue
            try:
                result = job()
            except BaseException as error:
                # Whatever it is, the one who waits must hear of it, or waits for ever.
                done.set_exception(error)
            else:
                done.set_result(result)
