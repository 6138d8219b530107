"""Models in batches without a run around them: a list for the disk, and kills."""

from __future__ import annotations

import asyncio
import itertools
import threading
from collections.abc import Callable, Collection, Coroutine, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from phyblock.config.models import ModelConfig
from phyblock.errors import BudgetReachedError, ModelError
from phyblock.models.batch import BatchFiles
from phyblock.models.cache import ReplyCache
from phyblock.models.costs import Budget
from phyblock.models.model import ModelEvent, RetryPolicy, build_model
from phyblock.models.request import Request
from phyblock.records.record import BatchLine, Reply
from tests.models.factory import QUICK

POLL_S = 0.01


@dataclass
class Disk:
    """The remains of a killed process: lines about batches, a folder, perhaps a cache."""

    folder: Path
    cache: Path | None = None
    lines: list[BatchLine] = field(default_factory=list)
    moment: Callable[[str], Any] | None = None

    async def put(self, line: BatchLine) -> None:
        """Write a line; a moment lies before and after it."""
        if self.moment is not None:
            await self.moment(f"before {line.event}")
        # As it is read again.
        self.lines.append(BatchLine.model_validate_json(line.as_json()))
        if self.moment is not None:
            await self.moment(f"after {line.event}")

    def files(self, recorded: Collection[str], expected: int) -> BatchFiles:
        return BatchFiles(tuple(self.lines), self.put, self.folder, POLL_S, recorded, expected)

    @property
    def events(self) -> list[str]:
        return [line.event for line in self.lines]


async def command(
    config: ModelConfig,
    disk: Disk,
    requests: Sequence[Request],
    *,
    budget: Budget | None = None,
    told: list[ModelEvent] | None = None,
    policy: RetryPolicy = QUICK,
    anew: bool = False,
) -> list[Reply | Exception]:
    """Ask all at once, as one command does; what stops the model stands where it was met."""
    cache = None if disk.cache is None else ReplyCache(disk.cache)
    model = build_model(
        config,
        cache=cache,
        budget=budget,
        observer=(told if told is not None else []).append,
        policy=policy,
        batches=disk.files({one.sample for one in requests} if anew else (), len(requests)),
    )

    async def ask(request: Request) -> Reply | Exception:
        try:
            reply = await model.ask(request)
            assert reply is not None
            return reply
        except (ModelError, BudgetReachedError) as error:
            return error

    try:
        ended = await asyncio.gather(*map(ask, requests))
        # Or others would wait for it.
        assert budget is None or not budget.holds
        return ended
    finally:
        await model.aclose()
        if cache is not None:
            cache.close()


def run_command(*args: Any, **options: Any) -> list[Reply | Exception]:
    return asyncio.run(command(*args, **options))


class Killing:
    """Kills a command at one of its moments: nothing of it goes on from there."""

    def __init__(self, at: int) -> None:
        self.at = at
        self.count = itertools.count()
        self.names: list[str] = []
        self._loop: asyncio.AbstractEventLoop | None = None
        self._killed = asyncio.Event()
        self._over = threading.Event()

    async def run(self, work: Coroutine[Any, Any, Any]) -> bool:
        """True if the work came to its end."""
        self._loop = asyncio.get_running_loop()
        task, killed = asyncio.create_task(work), asyncio.create_task(self._killed.wait())
        await asyncio.wait([task, killed], return_when=asyncio.FIRST_COMPLETED)
        is_over = task.done()
        others = asyncio.all_tasks() - {asyncio.current_task()}
        while others:
            for other in others:
                other.cancel()
            await asyncio.wait(others)
            others = asyncio.all_tasks() - {asyncio.current_task()}
        self._over.set()
        return is_over and not task.cancelled() and task.exception() is None

    def _is_now(self, name: str) -> bool:
        self.names.append(name)
        return next(self.count) == self.at

    async def here(self, name: str) -> None:
        """A moment on the client's side."""
        if self._is_now(name):
            self._killed.set()
            await asyncio.sleep(60)

    def there(self, _: int, name: str) -> None:
        """A moment on the server's side, which waits until the client is dead."""
        if self._is_now(name):
            assert self._loop is not None
            self._loop.call_soon_threadsafe(self._killed.set)
            self._over.wait(10)
