"""A breaker for each server: while it cannot be reached, one request at a time finds out whether
it can again, and all others wait.

What a server says itself, an error 500 or a 429 too, shows that it is there. No connection, a lost
one, or a gateway that finds nothing behind it (502, 503, 504) shows that it is not. An answer that
does not come in time shows neither: some requests are slow.
"""

from __future__ import annotations

import asyncio
import contextlib
import re
from collections.abc import AsyncIterator, Callable, Hashable

from phyblock.errors import ModelError, RetryableError, UnavailableError
from phyblock.models.config import ModelConfig
from phyblock.models.events import Tell, ignore_text
from phyblock.models.retry import RetryPolicy, backoff_s

__all__ = ["Breaker", "Breakers", "server_of", "shows_outage"]

FAILURES_TO_OPEN = 5
_REQUESTS_TO_OPEN = 2
_LONGEST_PROBE_WAIT_S = 15.0
_GATEWAY = (502, 503, 504)


class Breaker:
    """Open while its server cannot be reached; shared by all models and samples of the server.

    It opens after FAILURES_TO_OPEN failures in a row. They must be of two requests at least, so
    that one request which a server cannot survive is not taken for an outage. A probe that still
    fails when the outage has lasted `policy.retry_for_s` ends it: nothing more is sent. So does the
    `policy.max_connection_failures`-th failure in a row where the server has never answered.
    """

    def __init__(self, server: str, policy: RetryPolicy, tell: Tell = ignore_text) -> None:
        self._server = server
        self._policy = policy
        self._tell = tell
        self._failures = 0
        self._requests: set[Hashable] = set()
        self._began_s = 0.0
        self._probes = 0
        self._probe_at_s = 0.0
        self._probing = asyncio.Lock()
        self._nap: asyncio.Future[None] | None = None
        self._is_open = False
        self._was_heard = False
        self._end: str | None = None

    @property
    def is_open(self) -> bool:
        """Whether requests wait."""
        return self._is_open

    @contextlib.asynccontextmanager
    async def passing(self) -> AsyncIterator[bool]:
        """Wait until a request may be sent; yields whether it is the one that probes.

        Raises UnavailableError once the outage has lasted too long.
        """
        async with contextlib.AsyncExitStack() as stack:
            if self._is_open:
                await stack.enter_async_context(self._probing)
                await self._wait_to_probe()
            is_probe = self._is_open
            if not is_probe:
                await stack.aclose()
            yield is_probe

    def heard(self) -> None:
        """The server answered, whatever it said: all that wait go on at once."""
        if self._is_open:
            lasted_s = self._policy.clock.now() - self._began_s
            self._tell(f"{self._server} answers again after {lasted_s:.0f} s: going on")
        self._is_open = False
        self._was_heard = True
        self._failures = 0
        self._requests.clear()
        if self._nap is not None:
            self._nap.cancel()

    def failed(self, error: ModelError, request: Hashable, *, is_probe: bool) -> None:
        """An attempt for `request` failed; counts it where the server was not reached.

        What becomes of attempts that were sent before the breaker opened says nothing new.
        """
        is_answer = error.sent == "answered" and error.status not in _GATEWAY
        # The server took the probe, so it can be reached, however long it thinks.
        is_slow_probe = is_probe and error.sent == "maybe" and isinstance(error, RetryableError)
        if is_answer or is_slow_probe:
            self.heard()
        if not shows_outage(error):
            return
        assert isinstance(error, RetryableError)
        now_s = self._policy.clock.now()
        self._began_s = self._began_s if self._failures else now_s
        self._failures += 1
        self._requests.add(request)
        if is_probe and self._is_open:
            self._probe_failed(error, now_s)
        elif self._is_new_outage():
            self._is_open = True
            self._end = None
            self._probes = 0
            self._plan_probe(error, now_s)
            self._tell(f"{self._server} cannot be reached, trying now and then: {error}")

    def raise_if_ended(self) -> None:
        """Raise UnavailableError when the outage has lasted so long that nothing more is sent."""
        if self._is_open and self._end is not None:
            raise UnavailableError(self._end, sent="no")

    def _is_new_outage(self) -> bool:
        return (
            not self._is_open
            and self._failures >= FAILURES_TO_OPEN
            and len(self._requests) >= _REQUESTS_TO_OPEN
        )

    async def _wait_to_probe(self) -> None:
        """Wait for the time of the next probe, or until the server is heard of; whoever holds
        `_probing` is the only one here.
        """
        self.raise_if_ended()
        clock = self._policy.clock
        while self._is_open and (wait_s := self._probe_at_s - clock.now()) > 0:
            self._nap = asyncio.ensure_future(clock.sleep(wait_s))
            try:
                await asyncio.wait({self._nap})
            finally:
                self._nap.cancel()
                self._nap = None

    def _probe_failed(self, error: RetryableError, now_s: float) -> None:
        self._probes += 1
        self._plan_probe(error, now_s)
        lasted_s = now_s - self._began_s
        if self._policy.gives_up(error, self._probes, lasted_s):
            self._end = f"{self._server} could not be reached for {lasted_s:.0f} s: {error}"
        # Failures of requests that were sent together before it opened say no more than one.
        failures = FAILURES_TO_OPEN + self._probes
        if not self._was_heard and failures >= self._policy.max_connection_failures:
            self._end = f"{self._server} never answered, {failures} times in a row: {error}"

    def _plan_probe(self, error: RetryableError, now_s: float) -> None:
        """Wait longer with every probe, and as long as the server asks for."""
        most_s = min(_LONGEST_PROBE_WAIT_S, self._policy.max_wait_s)
        wait_s = backoff_s(self._policy.base_s, most_s, self._probes + 1)
        self._probe_at_s = now_s + max(wait_s, self._policy.followed_s(error))


def shows_outage(error: ModelError) -> bool:
    """Whether a failure shows that the server cannot be reached."""
    is_unreached = error.sent in ("no", "lost") or error.status in _GATEWAY
    return is_unreached and isinstance(error, RetryableError)


class Breakers:
    """The breakers of a run, by server."""

    def __init__(self, policy: RetryPolicy, tell: Tell = ignore_text) -> None:
        self._make: Callable[[str], Breaker] = lambda server: Breaker(server, policy, tell)
        self._known: dict[str, Breaker] = {}

    def of(self, config: ModelConfig) -> Breaker:
        """The breaker of a model's server."""
        server = server_of(config)
        if server not in self._known:
            self._known[server] = self._make(server)
        return self._known[server]


def server_of(config: ModelConfig) -> str:
    """Scheme, host and port of a model's address; the provider where no address is given."""
    if config.api_base is None:
        return config.provider
    return re.split(r"(?<=[^/:])[/?#]", config.api_base, maxsplit=1)[0].lower()
