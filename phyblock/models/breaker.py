"""A breaker for each server: while it cannot be reached, one request at a time finds out whether
it can again, and all others go elsewhere or wait.

What a server says itself, an error 500 or a 429 too, shows that it is there. No connection, a lost
one, or a gateway that finds nothing behind it (502, 503, 504) shows that it is not. So does a
success that holds no reply, as long as no reply ever came: a web server's page, or that of a proxy
while the model is loaded. An answer that does not come in time shows neither: some requests are
slow.
"""

from __future__ import annotations

import asyncio
import contextlib
import re
from collections.abc import Awaitable, Callable, Hashable, Iterator

from phyblock.config.models import ModelConfig
from phyblock.errors import ModelError, RetryableError
from phyblock.models.events import Tell, ignore_text
from phyblock.models.retry import RetryPolicy, backoff_s, is_success

__all__ = ["Breaker", "Breakers", "Changes", "server_of"]

FAILURES_TO_OPEN = 5
_REQUESTS_TO_OPEN = 2
_LONGEST_PROBE_WAIT_S = 15.0
_WORTH_A_WORD_S = 10.0
"""Waits for a probe that are so long are told, or a log would fall silent."""
_GATEWAY = (502, 503, 504)


class Changes:
    """Wakes all that wait for a server, whenever one is heard of or a probe has ended; asyncio, one
    loop.
    """

    def __init__(self) -> None:
        self._waiting: set[asyncio.Future[None]] = set()

    def tell(self) -> None:
        """Wake all that wait."""
        for change in self._waiting:
            if not change.done():
                change.set_result(None)

    async def wait(self, nap: Awaitable[None] | None = None) -> None:
        """Wait for the next change, at most until the nap is over."""
        change = asyncio.get_running_loop().create_future()
        waits = {change} if nap is None else {change, asyncio.ensure_future(nap)}
        self._waiting.add(change)
        try:
            await asyncio.wait(waits, return_when=asyncio.FIRST_COMPLETED)
        finally:
            self._waiting.discard(change)
            for wait in waits:
                wait.cancel()


class Breaker:
    """Open while its server cannot be reached; shared by all models and samples of the server.

    It opens after FAILURES_TO_OPEN failures in a row. They must be of two requests at least, so
    that one request which a server cannot survive is not taken for an outage. A probe that still
    fails when the outage has lasted `policy.retry_for_s` gives the server up: it is probed only as
    long as others of the model answer. So does the `policy.max_connection_failures`-th failure in a
    row where the server has never answered, or never with a reply. `changes` wakes those that wait.
    """

    def __init__(
        self,
        server: str,
        policy: RetryPolicy,
        tell: Tell = ignore_text,
        changes: Changes | None = None,
    ) -> None:
        self.server = server
        self._policy = policy
        self._tell = tell
        self._changes = changes or Changes()
        self._failures = 0
        self._requests: set[Hashable] = set()
        self._began_s = 0.0
        self._probes = 0
        self._probe_at_s = 0.0
        self._is_probed = False
        self._is_open = False
        self._was_heard = False
        self._has_replied = False
        self._end: str | None = None

    @property
    def is_open(self) -> bool:
        """Whether nothing but a probe is sent."""
        return self._is_open

    @property
    def probe_in_s(self) -> float | None:
        """Seconds until the next probe may be sent; None while one is under way."""
        if self._is_probed:
            return None
        return max(0.0, self._probe_at_s - self._policy.clock.now())

    @property
    def end(self) -> str | None:
        """Why the server is given up; None while it is not."""
        return self._end if self._is_open else None

    @contextlib.contextmanager
    def probing(self) -> Iterator[None]:
        """Be the one that probes."""
        self._is_probed = True
        try:
            yield
        finally:
            self._is_probed = False
            self._changes.tell()

    def heard(self) -> None:
        """The server answered, whatever it said: all that wait go on at once."""
        if self._is_open:
            lasted_s = self._policy.clock.now() - self._began_s
            self._tell(f"{self.server} answers again after {lasted_s:.0f} s: going on")
        self._is_open = False
        self._was_heard = True
        self._failures = 0
        self._requests.clear()
        self._changes.tell()

    def replied(self) -> None:
        """The server gave a reply."""
        self._has_replied = True
        self.heard()

    def is_outage(self, error: ModelError) -> bool:
        """Whether a failure shows that the server cannot be reached."""
        is_unreached = error.sent in ("no", "lost") or error.status in _GATEWAY
        return isinstance(error, RetryableError) and (is_unreached or self._is_page(error))

    def _is_page(self, error: ModelError) -> bool:
        """Whether it promised a reply and gave none, as the page of a web server does."""
        return (
            not self._has_replied and is_success(error.status) and isinstance(error, RetryableError)
        )

    def failed(self, error: ModelError, request: Hashable, *, is_probe: bool) -> None:
        """An attempt for `request` failed; counts it where the server was not reached.

        What becomes of attempts that were sent before the breaker opened says nothing new.
        """
        is_answer = error.sent == "answered" and not self.is_outage(error)
        # The server took the probe, so it can be reached, however long it thinks.
        is_slow_probe = is_probe and error.sent == "maybe" and isinstance(error, RetryableError)
        if is_answer or is_slow_probe:
            self.heard()
        # A gateway that finds nothing behind it is there: its address is right.
        is_there = error.status is not None and not self._is_page(error)
        self._was_heard = self._was_heard or is_there
        if not self.is_outage(error):
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
            self._tell(f"{self.server} {self._fault(error)}, trying now and then: {error}")

    def _is_new_outage(self) -> bool:
        return (
            not self._is_open
            and self._failures >= FAILURES_TO_OPEN
            and len(self._requests) >= _REQUESTS_TO_OPEN
        )

    def _probe_failed(self, error: RetryableError, now_s: float) -> None:
        self._probes += 1
        self._plan_probe(error, now_s)
        lasted_s = now_s - self._began_s
        is_page = self._is_page(error)
        if not is_page and self._policy.gives_up(error, self._probes, lasted_s):
            self._end = f"{self.server} could not be reached for {lasted_s:.0f} s: {error}"
        # Failures of requests that were sent together before it opened say no more than one.
        failures = FAILURES_TO_OPEN + self._probes
        is_new = is_page or not self._was_heard
        if is_new and failures >= self._policy.max_connection_failures:
            never = "never gave a reply that can be read" if is_page else "never answered"
            self._end = f"{self.server} {never}, {failures} times in a row: {error}"
        elif self._end is None and self._probe_at_s - now_s >= _WORTH_A_WORD_S:
            tries = f"{failures} times in a row, for {lasted_s:.0f} s"
            self._tell(f"{self.server} still {self._fault(error)}: tried {tries}")

    def _fault(self, error: RetryableError) -> str:
        return "gives no reply that can be read" if self._is_page(error) else "cannot be reached"

    def _plan_probe(self, error: RetryableError, now_s: float) -> None:
        """Wait longer with every probe, and as long as the server asks for."""
        most_s = min(_LONGEST_PROBE_WAIT_S, self._policy.max_wait_s)
        wait_s = backoff_s(self._policy.base_s, most_s, self._probes + 1)
        self._probe_at_s = now_s + max(wait_s, self._policy.followed_s(error))


class Breakers:
    """The breakers of a run, by server; `changes` is told by all of them."""

    def __init__(self, policy: RetryPolicy, tell: Tell = ignore_text) -> None:
        self.clock = policy.clock
        self.changes = Changes()
        self.tell = tell
        self._make: Callable[[str], Breaker] = lambda server: Breaker(
            server, policy, tell, self.changes
        )
        self._known: dict[str, Breaker] = {}

    def of(self, config: ModelConfig) -> Breaker:
        """The breaker of the server at a model's one address."""
        server = server_of(config)
        if server not in self._known:
            self._known[server] = self._make(server)
        return self._known[server]


def server_of(config: ModelConfig) -> str:
    """Scheme, host and port of a model's address; the provider where no address is given."""
    if config.api_base is None:
        return config.provider
    return re.split(r"(?<=[^/:])[/?#]", config.api_base, maxsplit=1)[0].lower()
