"""The one retry layer: RetryableError only, exponential backoff with full jitter."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import TypeVar

import tenacity

from phyblock.errors import RetryableError

__all__ = ["RetryPolicy", "with_retries"]

T = TypeVar("T")


@dataclass(frozen=True)
class RetryPolicy:
    """How often and how patiently a request is sent again.

    The wait before attempt n + 1 is uniform between 0 and min(`max_wait_s`, `base_s` * 2^(n-1)),
    and never less than the server's `Retry-After` (followed up to `max_retry_after_s`). Eight
    attempts leave one request in a million unanswered when 18 % of the requests fail.
    """

    attempts: int = 8
    base_s: float = 0.5
    max_wait_s: float = 60.0
    max_retry_after_s: float = 120.0
    sleep: Callable[[float], Awaitable[None]] = asyncio.sleep

    def wait(self) -> Callable[[tenacity.RetryCallState], float]:
        """The wait as tenacity asks for it."""
        jitter = tenacity.wait_random_exponential(multiplier=self.base_s, max=self.max_wait_s)

        def wait_s(state: tenacity.RetryCallState) -> float:
            error = state.outcome.exception() if state.outcome else None
            asked_s = error.retry_after_s if isinstance(error, RetryableError) else None
            floor_s = min(asked_s or 0.0, self.max_retry_after_s)
            return floor_s + jitter(state)

        return wait_s


async def with_retries(
    send: Callable[[], Awaitable[T]],
    policy: RetryPolicy,
    on_retry: Callable[[RetryableError, float], None],
) -> T:
    """Await `send()` until it gives a value, an error of another kind, or attempts run out.

    `on_retry` is told the error and the wait [s] before every further attempt. Raises what the
    last attempt raised.
    """

    def before_sleep(state: tenacity.RetryCallState) -> None:
        error = state.outcome.exception() if state.outcome else None
        if isinstance(error, RetryableError) and state.next_action is not None:
            on_retry(error, state.next_action.sleep)

    async def once() -> T:
        return await send()

    retrying = tenacity.AsyncRetrying(
        stop=tenacity.stop_after_attempt(policy.attempts),
        wait=policy.wait(),
        retry=tenacity.retry_if_exception_type(RetryableError),
        sleep=policy.sleep,
        before_sleep=before_sleep,
        reraise=True,
    )
    return await retrying(once)
