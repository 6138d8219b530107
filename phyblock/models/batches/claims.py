"""Which requests are being asked in batches here, and which another run asks, on the same cache.

A request is claimed from when it is gathered until somebody here has its answer or its failure, or
nobody here will ask for it. Whoever waits for another's claims has given up all its own before: two
runs that share requests never wait for each other.
"""

from __future__ import annotations

from collections.abc import Collection
from contextlib import AsyncExitStack

from phyblock.models.events import Tell
from phyblock.models.halt import Halt
from phyblock.models.leases import LeaseGroup
from phyblock.models.shared_cache import SharedCache
from phyblock.text import counted

__all__ = ["Claims"]


class Claims:
    """The claims of one model; without a cache, or while it is set aside, all requests are free."""

    def __init__(
        self, cache: SharedCache | None, patience_s: float, halt: Halt, tell: Tell
    ) -> None:
        """`patience_s` is how long a single call of another run is waited for; `tell` hears what
        is waited for.
        """
        self._cache = cache
        self._patience_s = patience_s
        self._halt = halt
        self._tell = tell
        self._stack = AsyncExitStack()
        self._group: LeaseGroup | None = None
        self._others: set[str] = set()
        self._overdue: set[str] = set()

    async def begin(self, under_way: Collection[str]) -> None:
        """Claim what batches of earlier commands ask, whoever else does."""
        if self._cache is None:
            return
        self._group = await self._stack.enter_async_context(self._cache.group())
        if self._group is not None and under_way:
            await self._cache.join(self._group, under_way, by_force=True)

    async def take(self, key: str) -> bool:
        """Claim a request; where another asks it, `wait_for_others` will wait for that."""
        if self._cache is None or self._group is None:
            return True
        by_force = key in self._overdue
        is_free = await self._cache.join(self._group, [key], by_force=by_force)
        if not is_free:
            self._others.add(key)
        return is_free

    async def release(self, key: str) -> None:
        """The request is asked here no more."""
        await self._leave({key})

    async def release_all(self, but: Collection[str] = ()) -> None:
        """Nothing is asked here any more, except `but`."""
        if self._group is not None:
            await self._leave(self._group.keys.difference(but))

    async def _leave(self, keys: set[str]) -> None:
        if self._group is None or self._cache is None:
            return
        if held := keys & self._group.keys:
            await self._cache.leave(self._group, held)

    @property
    def must_wait(self) -> bool:
        """Whether another run asks what was wanted here."""
        return bool(self._others)

    async def wait_for_others(self) -> None:
        """Give up all claims and wait until nobody else asks what could not be claimed.

        HaltedError where the run ends.
        """
        others, self._others = self._others, set()
        if not others or self._cache is None:
            return
        await self.release_all()
        self._tell(f"waiting for {counted(len(others), 'request')} that another run is asking")
        with self._halt.giving_up():
            self._overdue |= await self._cache.await_all_others(others, self._patience_s)

    async def aclose(self) -> None:
        """Claim nothing any more."""
        await self._stack.aclose()
