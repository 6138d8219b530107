"""Models in batches without a run around them: a list for the disk, and a run's rounds."""

from __future__ import annotations

import asyncio
import itertools
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from phyblock.config.models import ModelConfig
from phyblock.errors import BudgetReachedError, ModelError
from phyblock.models import (
    AskLaterError,
    BatchFiles,
    Budget,
    GatheringModel,
    ModelEvent,
    Reply,
    ReplyCache,
    Request,
    RetryPolicy,
    build_model,
)
from phyblock.records.record import BatchLine
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

    def files(self) -> BatchFiles:
        return BatchFiles(tuple(self.lines), self.put, self.folder, POLL_S)

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
    """Ask as one command does, in rounds; what stops the model stands where it was met."""
    cache = None if disk.cache is None else ReplyCache(disk.cache)
    model = build_model(
        config,
        cache=cache,
        budget=budget,
        observer=(told if told is not None else []).append,
        policy=policy,
        batches=disk.files(),
    )
    assert isinstance(model, GatheringModel)
    ended: dict[int, Reply | Exception] = {}
    left = list(range(len(requests)))
    try:
        while left:
            await model.begin()
            taken = [n for n in left if await model.gather(requests[n], anew=anew)]
            await model.dispatch()
            if not taken:
                await model.begin()
                raise BudgetReachedError("none fits")
            for n in taken:
                try:
                    reply = await model.ask(requests[n])
                    assert reply is not None
                    ended[n] = reply
                except AskLaterError:
                    continue
                except ModelError as error:
                    ended[n] = error
            left = [n for n in left if n not in ended]
    except (ModelError, BudgetReachedError) as error:
        ended |= dict.fromkeys(left, error)
    else:
        # Or others would wait for it.
        assert budget is None or not budget.holds
    finally:
        await model.aclose()
        if cache is not None:
            cache.close()
    return [ended[n] for n in range(len(requests))]


def run_command(*args: Any, **options: Any) -> list[Reply | Exception]:
    return asyncio.run(command(*args, **options))


class Killing:
    """Kills a command at one of its moments: nothing of it goes on from there."""

    def __init__(self, at: int) -> None:
        self.at = at
        self.count = itertools.count()
        self.names: list[str] = []
        self._loop: asyncio.AbstractEventLoop | None = None
        self._task: asyncio.Task[Any] | None = None
        self._over = threading.Event()

    async def run(self, work: Any) -> bool:
        """True if the work came to its end."""
        self._loop = asyncio.get_running_loop()
        self._task = asyncio.create_task(work)
        try:
            await self._task
        except asyncio.CancelledError:
            return False
        finally:
            self._over.set()
        return True

    def _is_now(self, name: str) -> bool:
        self.names.append(name)
        return next(self.count) == self.at

    async def here(self, name: str) -> None:
        """A moment on the client's side."""
        if self._is_now(name):
            assert self._task is not None
            self._task.cancel()
            await asyncio.sleep(60)

    def there(self, _: int, name: str) -> None:
        """A moment on the server's side, which waits until the client is dead."""
        if self._is_now(name):
            assert self._loop is not None
            assert self._task is not None
            self._loop.call_soon_threadsafe(self._task.cancel)
            self._over.wait(10)
