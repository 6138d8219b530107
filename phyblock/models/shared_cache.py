"""The reply cache as a run uses it: off the event loop, shared with other processes, never waited
for long.

It is a cache: replies stand in the records of the run as well. A file that is locked or fails while
a run goes on is set aside, said once, and tried again later.
"""

from __future__ import annotations

import asyncio
import contextlib
import functools
import queue
import random
import time
from collections.abc import AsyncIterator, Callable, Collection, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, TypeVar

from phyblock.errors import StoreError
from phyblock.models.cache import CacheBusyError, ReplyCache
from phyblock.models.events import Tell, ignore_text
from phyblock.models.leases import LEASE_S, Lease, LeaseGroup
from phyblock.models.limits import Clock
from phyblock.models.worker import Worker
from phyblock.records.reply import Reply

__all__ = ["Known", "SharedCache", "Turn"]

T = TypeVar("T")

_BUSY_TIMEOUT_S = 0.5
_PATIENCE_S = 5.0
_TRY_AGAIN_AFTER_S = 60.0
_FIRST_LOOK_S = 0.05
_LONGEST_LOOK_S = 1.0
LONGEST_BATCH_S = 26 * 3600.0
"""Providers end a batch within a day."""


class Known(NamedTuple):
    """What is known of a question: its reply, whether it is being asked, and whether that is in a
    batch, which may take a day.
    """

    reply: Reply | None = None
    is_asked: bool = False
    is_batched: bool = False


@dataclass(frozen=True)
class Turn:
    """Whether it is ours to ask; if not, another asks, or has been answered meanwhile.

    `lease` keeps others from asking; there is none while the cache is set aside.
    """

    is_ours: bool
    reply: Reply | None = None
    lease: Lease | None = None


class SharedCache:
    """Replies by key, and who asks what; an async context manager.

    Nothing but `open` raises an error of the file: what fails is told to `tell`, and the cache is
    as good as empty until it works again.
    """

    def __init__(
        self,
        path: Path,
        tell: Tell = ignore_text,
        *,
        patience_s: float = _PATIENCE_S,
        clock: Clock | None = None,
    ) -> None:
        """`patience_s` is how long a locked file is waited for before it is set aside."""
        self.path = path
        self._tell = tell
        self._patience_s = patience_s
        self._clock = clock or Clock()
        self._worker = Worker("reply cache")
        self._file: ReplyCache | None = None
        self._aside_until_s: float | None = None
        self._is_told = False
        self._untold: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._keeping: set[asyncio.Future[None]] = set()
        self._held: set[Lease] = set()
        self._is_closing = False

    async def __aenter__(self) -> SharedCache:
        await self.open()
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.aclose()

    async def open(self) -> None:
        """Open the file; StoreError when it is foreign or broken. A locked one is set aside."""
        try:
            await self._worker.run(lambda: self._try(lambda _: None))
        except CacheBusyError as error:
            self._set_aside(error)

    async def look(self, key: str) -> Known:
        """What is known of the question that is asked under `key`."""
        return await self._do(lambda file: _look(file, key), Known())

    async def await_others(self, key: str, most_s: float) -> tuple[Reply | None, bool]:
        """Wait while another asks the same, `most_s` at most, in a batch somewhat above a day.

        The reply if there is one then, and whether the other is still asking.
        """
        known = await self._await(key, most_s, self._clock.now() + LONGEST_BATCH_S)
        return known.reply, known.is_asked

    async def await_all_others(self, keys: Iterable[str], most_s: float) -> set[str]:
        """Wait as `await_others` does for every one of the questions, but for all together no
        longer than for a batch; those that others are still asking.
        """
        until_s = self._clock.now() + LONGEST_BATCH_S
        return {key for key in keys if (await self._await(key, most_s, until_s)).is_asked}

    async def _await(self, key: str, most_s: float, until_s: float) -> Known:
        began_s, pause_s = self._clock.now(), _FIRST_LOOK_S
        while True:
            known = await self.look(key)
            now_s = self._clock.now()
            is_long = now_s >= until_s or (not known.is_batched and now_s >= began_s + most_s)
            if known.reply is not None or not known.is_asked or is_long:
                return known
            await self._clock.sleep(pause_s * random.uniform(0.5, 1.0))
            pause_s = min(_LONGEST_LOOK_S, 1.5 * pause_s)

    @contextlib.asynccontextmanager
    async def asking(self, key: str, *, by_force: bool = False) -> AsyncIterator[Turn]:
        """Keep others from asking the same meanwhile, if it is our turn to ask."""
        turn = await self._do(lambda file: _take(file, key, by_force=by_force), Turn(True))
        lease = turn.lease
        if lease is None:
            yield turn
            return
        renewing = asyncio.create_task(self._renew(lambda file: _renew(file, lease)))
        self._held.add(lease)
        try:
            yield turn
        finally:
            renewing.cancel()
            if lease in self._held:
                self._held.discard(lease)
                await self._do(lambda file: _give_back(file, lease), None)

    @contextlib.asynccontextmanager
    async def group(self) -> AsyncIterator[LeaseGroup | None]:
        """A lease for questions that are asked together; None while the cache is set aside.

        It holds until the end, also where the cache is set aside meanwhile or others cleared it
        away while this process stood still.
        """
        group = await self._do(_take_group, None)
        if group is None:
            yield None
            return
        renewing = asyncio.create_task(self._renew(lambda file: _hold(file, group)))
        try:
            yield group
        finally:
            renewing.cancel()
            await self._do(lambda file: _give_group_back(file, group), None)

    async def join(
        self, group: LeaseGroup, keys: Collection[str], *, by_force: bool = False
    ) -> bool:
        """Keep others from asking these questions for as long as the lease holds; False, and
        nothing is done, where another asks one of them.
        """
        add = functools.partial(_add, group=group, keys=keys, by_force=by_force)
        is_free = await self._do(add, None)
        if is_free is None:
            group.keys.update(keys)
            group.is_whole = False
        return is_free is not False

    async def leave(self, group: LeaseGroup, keys: Collection[str]) -> None:
        """Questions are no longer asked together with those of the lease."""
        if not await self._do(lambda file: _remove(file, group, keys), False):
            group.keys.difference_update(keys)
            group.is_whole = False

    async def keep(self, key: str, model_id: str, reply: Reply, lease: Lease | None = None) -> None:
        """Keep a reply, if it is whole and the file takes it, also when the wait is given up, and
        give back the lease of its question.
        """
        keeping = asyncio.ensure_future(self._keep(key, model_id, reply, lease))
        self._keeping.add(keeping)
        keeping.add_done_callback(self._keeping.discard)
        await asyncio.shield(keeping)

    async def _keep(self, key: str, model_id: str, reply: Reply, lease: Lease | None) -> None:
        is_kept = await self._do(lambda file: _keep(file, key, model_id, reply, lease), None)
        if lease is not None and is_kept is not None:
            self._held.discard(lease)
        # Not before it was written to: a full disk can be read all the same.
        if is_kept and self._is_told:
            self._is_told = False
            self._tell(f"reply cache {self.path}: is in use again")

    async def aclose(self) -> None:
        """Give back what is held and close the file."""
        self._is_closing = True
        # What cannot be given back runs out by itself.
        with contextlib.suppress(StoreError, asyncio.TimeoutError):
            await asyncio.wait_for(self._worker.run(self._close_file), 2 * _BUSY_TIMEOUT_S)
        self._worker.stop()

    async def _renew(self, renew: Callable[[ReplyCache], bool]) -> None:
        is_held = True
        while is_held:
            await asyncio.sleep(LEASE_S / 3)
            is_held = await self._do(renew, True)

    async def _do(self, operation: Callable[[ReplyCache], T], otherwise: T) -> T:
        """What the operation returns; `otherwise` while the cache is set aside."""
        if self._is_aside:
            return otherwise
        try:
            # The file may hang in a way that SQLite knows nothing of, as on a lost network disk.
            limit_s = self._patience_s + 2 * _BUSY_TIMEOUT_S
            job = self._worker.run(lambda: self._try(operation))
            return await asyncio.wait_for(job, limit_s)
        except _AsideError:
            return otherwise
        except (StoreError, asyncio.TimeoutError) as error:
            self._set_aside(error)
            return otherwise
        finally:
            self._pass_on()

    def _pass_on(self) -> None:
        """Tell, on the loop, what the worker found."""
        while not self._untold.empty():
            self._tell(self._untold.get())

    @property
    def _is_aside(self) -> bool:
        until_s = self._aside_until_s
        return until_s is not None and self._clock.now() < until_s

    def _set_aside(self, error: Exception) -> None:
        self._aside_until_s = self._clock.now() + _TRY_AGAIN_AFTER_S
        if not self._is_told and not self._is_closing:
            self._is_told = True
            said = str(error).partition("\n")[0] or f"reply cache {self.path}: does not answer"
            self._tell(f"{said}; going on without it, and trying again later")

    def _try(self, operation: Callable[[ReplyCache], T]) -> T:
        """In the worker: operate on the file, waiting for others to let go of it."""
        if self._is_aside:
            raise _AsideError(())
        was_aside = self._aside_until_s is not None
        until_s = time.monotonic() + (0.0 if was_aside else self._patience_s)
        try:
            result = self._wait_and_try(operation, until_s)
        except StoreError as error:
            # Here and not on the loop: the jobs that wait already must not try in their turn.
            self._aside_until_s = self._clock.now() + _TRY_AGAIN_AFTER_S
            if not isinstance(error, CacheBusyError):
                self._drop_file()
            raise
        self._aside_until_s = None
        return result

    def _wait_and_try(self, operation: Callable[[ReplyCache], T], until_s: float) -> T:
        while True:
            try:
                if self._file is None:
                    busy_timeout_s = min(_BUSY_TIMEOUT_S, self._patience_s)
                    self._file = ReplyCache(self.path, busy_timeout_s, self._untold.put)
                return operation(self._file)
            except CacheBusyError:
                if self._is_closing or time.monotonic() >= until_s:
                    raise

    def _close_file(self) -> None:
        if self._file is not None:
            try:
                with self._file.leases() as leases:
                    leases.give_all_back()
            finally:
                self._drop_file()

    def _drop_file(self) -> None:
        """Forget a file that failed; it may be another one when it is opened again."""
        if self._file is not None:
            self._file.close()
            self._file = None


class _AsideError(StoreError):
    """The cache was set aside while this operation waited for its turn."""


def _look(file: ReplyCache, key: str) -> Known:
    """Whether the question is being asked, and the reply. In this order: a reply is kept before
    its lease is given back.
    """
    with file.leases() as leases:
        asking = leases.asking(key)
    return Known(file.get(key), any(asking), asking.together)


def _keep(
    file: ReplyCache, key: str, model_id: str, reply: Reply, lease: Lease | None
) -> bool | None:
    is_kept = file.put(key, model_id, reply)
    if lease is not None:
        _give_back(file, lease)
    return is_kept


def _take(file: ReplyCache, key: str, *, by_force: bool) -> Turn:
    """Look for the reply once more with the lease in hand: then nobody can bring it meanwhile."""
    with file.leases() as leases:
        lease = leases.take(key, by_force=by_force)
        if lease is None:
            return Turn(False)
        reply = file.get(key)
        if reply is None:
            return Turn(True, lease=lease)
        leases.give_back(lease)
    return Turn(False, reply)


def _take_group(file: ReplyCache) -> LeaseGroup:
    with file.leases() as leases:
        return leases.take_group()


def _add(file: ReplyCache, group: LeaseGroup, keys: Collection[str], *, by_force: bool) -> bool:
    with file.leases() as leases:
        return leases.add(group, keys, by_force=by_force)


def _remove(file: ReplyCache, group: LeaseGroup, keys: Collection[str]) -> bool:
    with file.leases() as leases:
        for key in keys:
            leases.remove(group, key)
    return True


def _hold(file: ReplyCache, group: LeaseGroup) -> bool:
    with file.leases() as leases:
        leases.hold(group)
    return True


def _give_group_back(file: ReplyCache, group: LeaseGroup) -> None:
    with file.leases() as leases:
        leases.give_group_back(group)


def _renew(file: ReplyCache, lease: Lease) -> bool:
    with file.leases() as leases:
        return leases.renew(lease)


def _give_back(file: ReplyCache, lease: Lease) -> None:
    with file.leases() as leases:
        leases.give_back(lease)
