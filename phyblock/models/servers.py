"""The servers of one model: the least loaded is asked, one that fails rests for a while.

What a server says itself, an error 500 or a 429 too, shows that it is there. No connection, a lost
one, or a gateway that finds nothing behind it (502, 503, 504) shows that it is not. An answer that
does not come in time shows neither: some requests are slow.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from phyblock.errors import ModelError, RetryableError, UnavailableError

if TYPE_CHECKING:
    from phyblock.models.client import Client
    from phyblock.models.model import RetryPolicy

FAILURES_TO_REST = 5
_REQUESTS_TO_REST = 2
"""One request that a server cannot survive is no outage."""
_LONGEST_REST_S = 15.0
_GATEWAY = (502, 503, 504)
_TOO_MUCH = (429, 529)


@dataclass(eq=False)
class Server:
    """One server: `failures` in a row, of the requests `failed`, show that it is away, since
    `away_since_s`; it has rested `rests` times since. `refusal` is why it is asked no more.
    """

    name: str
    client: Client
    under_way: int = 0
    sent: int = 0
    failures: int = 0
    failed: set[Hashable] = field(default_factory=set)
    away_since_s: float = 0.0
    rests: int = 0
    rested_at_s: float = float("-inf")
    rests_until_s: float = float("-inf")
    was_heard: bool = False
    refusal: UnavailableError | None = None


class Servers:
    """Chooses among the servers of a model; asyncio, one loop. `tell` is called with what happens
    to them."""

    def __init__(
        self, servers: Sequence[Server], policy: RetryPolicy, tell: Callable[[str], None]
    ) -> None:
        self.all = tuple(servers)
        self._policy = policy
        self._tell = tell

    def usable(self) -> list[Server]:
        """List the servers that are not given up; raises UnavailableError when there is none."""
        usable = [server for server in self.all if server.refusal is None]
        if not usable and (refusal := self.all[-1].refusal) is not None:
            raise UnavailableError(str(refusal), status=refusal.status, sent=refusal.sent)
        return usable

    def rest_s(self) -> float:
        """Return the seconds until some server may be asked; UnavailableError when none is left."""
        return max(0.0, min(s.rests_until_s for s in self.usable()) - self._policy.clock.now())

    def pick(self, failed: Server | None = None) -> Server:
        """Return the server to ask: one that does not rest and has the fewest requests under way.

        One that just `failed` the request is asked only where there is no other. One that was away
        is asked by a single request at a time, until it answers.
        """
        now_s = self._policy.clock.now()
        chosen = min(
            self.usable(),
            key=lambda s: (max(0.0, s.rests_until_s - now_s), s is failed, s.under_way, s.sent),
        )
        if chosen.rests:
            chosen.rests_until_s = now_s + self._rest_of(chosen)
        return chosen

    def heard(self, server: Server) -> None:
        """Note that a server answered."""
        if server.rests:
            lasted_s = self._policy.clock.now() - server.away_since_s
            self._tell(f"{server.name} answers again after {lasted_s:.0f} s")
            server.rests_until_s = float("-inf")
        server.was_heard, server.failures, server.rests = True, 0, 0
        server.failed.clear()

    def failed(self, server: Server, error: ModelError, request: Hashable, sent_s: float) -> bool:
        """Note that a request that was sent at `sent_s` failed; True if that is the server's fault,
        so that another attempt is free.

        Requests that were sent before a server began to rest tell nothing new when they fail.
        """
        if isinstance(error, UnavailableError):
            self._refuse(server, error)
            return True
        if error.sent not in ("no", "lost") and error.status not in _GATEWAY:
            if error.sent == "answered":
                self.heard(server)
            return False
        server.was_heard |= error.status is not None
        if server.rests and sent_s <= server.rested_at_s:
            return True
        now_s = self._policy.clock.now()
        server.away_since_s = server.away_since_s if server.failures else now_s
        server.failures += 1
        server.failed.add(request)
        if server.failures < FAILURES_TO_REST or len(server.failed) < _REQUESTS_TO_REST:
            return False
        server.rests += 1
        server.rested_at_s = now_s
        wait_s = max(self._rest_of(server), self._policy.followed_s(error))
        server.rests_until_s = now_s + wait_s
        lasted_s, name = now_s - server.away_since_s, server.name
        tries = FAILURES_TO_REST + server.rests - 1
        if self._policy.gives_up(error, server.rests, lasted_s):
            why = f"{name} could not be reached for {lasted_s:.0f} s: {error}"
            self._refuse(server, UnavailableError(why, sent="no"))
        elif not server.was_heard and tries >= self._policy.max_connection_failures:
            why = f"{name} never answered, {tries} times in a row: {error}"
            self._refuse(server, UnavailableError(why, sent="no"))
        elif server.rests == 1:
            self._tell(f"{name} cannot be reached, trying now and then: {error}")
        return True

    def pause(self, server: Server, error: RetryableError, wait_s: float) -> None:
        """Stop using a server that reports overload, for a while."""
        if error.status in _TOO_MUCH:
            until_s = self._policy.clock.now() + wait_s
            server.rests_until_s = max(server.rests_until_s, until_s)

    def _refuse(self, server: Server, error: UnavailableError) -> None:
        is_first, server.refusal = server.refusal is None, error
        if is_first and any(other.refusal is None for other in self.all):
            self._tell(f"{server.name} is asked no more: {error}")

    def _rest_of(self, server: Server) -> float:
        doubled_s = self._policy.base_s * 2.0 ** min(server.rests, 60)
        return min(_LONGEST_REST_S, self._policy.max_wait_s, doubled_s)
