"""The one retry layer: RetryableError only, by number and by time, with jitter between attempts."""

from __future__ import annotations

import random
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from typing import TypeVar

from phyblock.errors import RetryableError
from phyblock.models.limits import Clock

__all__ = ["RetryPolicy", "backoff_s", "is_success", "with_retries"]

T = TypeVar("T")


@dataclass(frozen=True)
class RetryPolicy:
    """How often, how long and how patiently a request is sent again.

    A request is given up when it has failed `attempts` times and `retry_for_s` have passed since
    it first failed, both: attempts that fail at once outlast an outage, attempts that each take
    long are bounded by their number. HTTP 2xx with an unreadable body is an answer that was paid
    for: there the number alone decides.

    The wait before attempt n + 1 is uniform between 0 and min(`max_wait_s`, `base_s` * 2^(n-1)),
    on top of the server's `Retry-After` (followed up to `max_retry_after_s`). Eight attempts leave
    one request in a million unanswered when 18 % of the requests fail.

    A server that has not answered once is given up after `max_connection_failures` tries already:
    its address is probably wrong.
    """

    attempts: int = 8
    retry_for_s: float = 300.0
    max_connection_failures: int = 20
    base_s: float = 0.5
    max_wait_s: float = 60.0
    max_retry_after_s: float = 120.0
    clock: Clock = field(default_factory=Clock)

    def gives_up(self, error: RetryableError, failures: int, failing_for_s: float) -> bool:
        """Whether a request that failed so often and so long is not sent again."""
        if failures < self.attempts:
            return False
        return is_success(error.status) or failing_for_s >= self.retry_for_s

    def wait_s(self, error: RetryableError, failures: int) -> float:
        """The wait before the next attempt [s]."""
        backoff = backoff_s(self.base_s, self.max_wait_s, failures)
        return self.followed_s(error) + random.uniform(0.0, backoff)

    def followed_s(self, error: RetryableError) -> float:
        """How much of the wait that the server asked for is followed [s]."""
        return min(error.retry_after_s or 0.0, self.max_retry_after_s)


def is_success(status: int | None) -> bool:
    """Whether the server promised a reply, and bills it, though it could not be read."""
    return status is not None and 200 <= status < 300


def backoff_s(base_s: float, most_s: float, failures: int) -> float:
    """`base_s` doubled with each failure after the first, `most_s` at most."""
    return min(most_s, base_s * 2.0 ** min(failures - 1, 60))


async def with_retries(
    send: Callable[[], Awaitable[T]],
    policy: RetryPolicy,
    on_retry: Callable[[RetryableError, float], None],
) -> T:
    """Await `send()` until it gives a value, an error of another kind, or the policy gives up.

    `on_retry` is told the error and the wait [s] before every further attempt. Raises what the
    last attempt raised.
    """
    failures = 0
    first_failure_s: float | None = None
    while True:
        try:
            return await send()
        except RetryableError as error:
            now_s = policy.clock.now()
            failures += 1
            first_failure_s = now_s if first_failure_s is None else first_failure_s
            if policy.gives_up(error, failures, now_s - first_failure_s):
                raise
            wait_s = policy.wait_s(error, failures)
            on_retry(error, wait_s)
        await policy.clock.sleep(wait_s)
