"""The servers of one model: the one with the least to do is asked, one that is gone is left out and
tried now and then.
"""

from __future__ import annotations

import contextlib
from collections.abc import AsyncIterator, Callable, Iterator
from dataclasses import dataclass

from phyblock.config.models import ModelConfig
from phyblock.errors import UnavailableError
from phyblock.models.breaker import Breaker, Breakers
from phyblock.models.pace import FixedPace, Mark, Pace
from phyblock.models.transport import Transport

__all__ = ["Replica", "Replicas"]


@dataclass(eq=False)
class Replica:
    """A server of the model, how many requests it may have, has now and was ever sent, and why it
    is no use: what it said that it would say to every request.
    """

    transport: Transport
    breaker: Breaker
    pace: Pace
    under_way: int = 0
    sent: int = 0
    refusal: UnavailableError | None = None

    @contextlib.contextmanager
    def asked(self) -> Iterator[Mark]:
        """Count a request while it is under way; yields what its pace is told when it has ended."""
        self.under_way += 1
        self.sent += 1
        try:
            yield self.pace.begin(self.under_way)
        finally:
            self.under_way -= 1


class Replicas:
    """Chooses among the servers of a model; asyncio, one loop.

    `transport` makes what sends to the one address of a configuration.
    """

    def __init__(
        self,
        config: ModelConfig,
        transport: Callable[[ModelConfig], Transport],
        breakers: Breakers,
    ) -> None:
        self._config = config
        self._breakers = breakers
        self._together = FixedPace(config.max_concurrency)
        self._listed: list[Replica] = []
        for address in config.addresses or (None,):
            at = config.at(address)
            replica = Replica(transport(at), breakers.of(at), self._together)
            self._listed.append(replica)

    @property
    def width(self) -> int:
        """How many requests may be under way at all servers together, 1 at least."""
        usable = self._usable()
        there = [replica for replica in usable if not replica.breaker.is_open] or usable
        paces = {id(replica.pace): replica.pace for replica in there}
        width = sum(pace.width for pace in paces.values())
        return max(1, min(width, self._config.max_concurrency))

    @contextlib.asynccontextmanager
    async def passing(self) -> AsyncIterator[Replica | None]:
        """Wait until a request may be sent; yields the server that it shall probe, or None.

        Raises UnavailableError where none is left.
        """
        while True:
            self.raise_if_none_left()
            probed = self._due()
            if probed is not None or self.choose() is not None:
                break
            await self._wait()
        if probed is None:
            yield None
        else:
            with probed.breaker.probing():
                yield probed

    def choose(
        self, probed: Replica | None = None, failed: Replica | None = None
    ) -> Replica | None:
        """The server to probe, else the one that answers and has the fewest
        requests for its pace; the one that failed last only where there is no other. None where
        all are gone.
        """
        usable = self._usable()
        if probed in usable:
            return probed
        closed = (replica for replica in usable if not replica.breaker.is_open)
        return min(closed, key=lambda one: (one is failed, _load(one), one.sent), default=None)

    def leave_out(self, replica: Replica, refusal: UnavailableError) -> bool:
        """Ask a server no more that refuses whatever it is asked; whether others are left."""
        is_new = replica.refusal is None
        replica.refusal = refusal
        is_left = bool(self._usable())
        if is_new and is_left:
            server = replica.breaker.server
            self._breakers.tell(f"{server} is left out of {self._config.name}: {refusal}")
        return is_left

    def raise_if_none_left(self) -> None:
        """Raise UnavailableError where every server refuses, or was away for too long."""
        usable = self._usable()
        if not usable:
            refusal = self._listed[-1].refusal
            assert refusal is not None, "a list is never empty"
            raise UnavailableError(str(refusal), status=refusal.status)
        ends = [replica.breaker.end for replica in usable]
        if None not in ends:
            more = f" (so it is with all {len(ends)} servers)" if len(ends) > 1 else ""
            raise UnavailableError(f"{ends[-1]}{more}", sent="no")

    async def aclose(self) -> None:
        """Release the connections to all servers."""
        for replica in self._listed:
            await replica.transport.aclose()

    def _usable(self) -> list[Replica]:
        return [replica for replica in self._listed if replica.refusal is None]

    def _due(self) -> Replica | None:
        """A server that is gone and may be tried again now."""
        away = (replica for replica in self._usable() if replica.breaker.is_open)
        return next((one for one in away if one.breaker.probe_in_s == 0.0), None)

    async def _wait(self) -> None:
        """Wait until a server is heard of or may be probed."""
        waits_s = [replica.breaker.probe_in_s for replica in self._usable()]
        known_s = [wait_s for wait_s in waits_s if wait_s is not None]
        nap = self._breakers.clock.sleep(min(known_s)) if known_s else None
        await self._breakers.changes.wait(nap)


def _load(replica: Replica) -> float:
    """How much of what it may have a server would have with one request more."""
    return (replica.under_way + 1) / replica.pace.width
