"""The one retry layer: what is repeated, how often, how long, after which waits."""

from __future__ import annotations

import asyncio

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.errors import (
    ModelError,
    RefusedError,
    RetryableError,
    SampleError,
    StoreError,
    UnavailableError,
)
from phyblock.models.limits import Clock
from phyblock.models.retry import RetryPolicy, with_retries


class Script:
    """Raises the given errors one by one, each after `takes_s`, then answers; sleeps are jumps."""

    def __init__(self, *errors: Exception, takes_s: float = 0.0) -> None:
        self.errors = list(errors)
        self.takes_s = takes_s
        self.now_s = 0.0
        self.failed_at: list[float] = []
        self.calls = 0
        self.waits: list[float] = []
        self.told: list[float] = []

    async def send(self) -> str:
        self.calls += 1
        self.now_s += self.takes_s
        if self.errors:
            self.failed_at.append(self.now_s)
            raise self.errors.pop(0)
        return "answer"

    async def sleep(self, seconds: float) -> None:
        self.waits.append(seconds)
        self.now_s += seconds

    def run(self, **policy: float) -> str:
        clock = Clock(lambda: self.now_s, self.sleep)
        rules = RetryPolicy(clock=clock, **policy)  # type: ignore[arg-type]

        async def main() -> str:
            return await with_retries(self.send, rules, lambda _, wait_s: self.told.append(wait_s))

        return asyncio.run(main())


def test_errors_that_may_pass_are_repeated() -> None:
    script = Script(RetryableError("a"), RetryableError("b"))
    assert script.run() == "answer"
    assert script.calls == 3
    assert script.told == script.waits
    assert len(script.waits) == 2


@pytest.mark.parametrize(
    "error",
    [
        SampleError("bad"),
        RefusedError("no"),
        UnavailableError("gone"),
        StoreError([]),
        ModelError("x"),
        ZeroDivisionError(),
    ],
)
def test_all_others_are_not(error: Exception) -> None:
    script = Script(error)
    with pytest.raises(type(error)):
        script.run()
    assert script.calls == 1
    assert script.waits == []


def test_after_the_last_attempt_its_error_comes_out() -> None:
    errors = [RetryableError(str(n)) for n in range(20)]
    script = Script(*errors)
    with pytest.raises(RetryableError, match=r"^7$"):
        script.run(retry_for_s=0.0)
    assert script.calls == 8
    assert len(script.waits) == 7


statuses = st.sampled_from([None, 408, 429, 500, 502, 503])


@given(
    st.lists(statuses, min_size=1, max_size=8),
    st.integers(1, 12),
    st.floats(0, 600, allow_nan=False),
    st.floats(0, 400, allow_nan=False),
)
def test_a_request_is_given_up_when_both_number_and_time_are_over(
    found: list[int | None], attempts: int, retry_for_s: float, takes_s: float
) -> None:
    errors = (RetryableError("x", status=status) for status in found * 400)
    script = Script(*errors, takes_s=takes_s)
    with pytest.raises(RetryableError):
        script.run(attempts=attempts, retry_for_s=retry_for_s, base_s=2.0)
    lasted = [now_s - script.failed_at[0] for now_s in script.failed_at]
    is_over = [n >= attempts and s >= retry_for_s for n, s in enumerate(lasted, 1)]
    assert is_over[-1]
    assert not any(is_over[:-1])


@given(st.floats(0, 300, exclude_max=True, allow_nan=False))
def test_an_outage_of_less_than_five_minutes_is_outlasted_with_the_defaults(
    outage_s: float,
) -> None:
    script = Script()

    async def send() -> str:
        if script.now_s < outage_s:
            raise RetryableError("connection refused")
        return "answer"

    script.send = send  # type: ignore[method-assign]
    assert script.run() == "answer"


@pytest.mark.parametrize("status", [200, 201, 204])
def test_answers_that_were_paid_for_and_cannot_be_read_are_bounded_by_number_alone(
    status: int,
) -> None:
    script = Script(*(RetryableError("malformed", status=status) for _ in range(20)))
    with pytest.raises(RetryableError, match="malformed"):
        script.run(attempts=3)
    assert script.calls == 3


def test_a_fifth_of_faults_leaves_a_thousand_samples_unharmed() -> None:
    unanswered = 0.18 ** RetryPolicy().attempts
    assert 1000 * unanswered < 0.002


@given(st.lists(st.none() | st.floats(0, 500, allow_nan=False), min_size=1, max_size=7))
def test_waits_keep_to_retry_after_and_to_their_bounds(wishes: list[float | None]) -> None:
    script = Script(*(RetryableError("429", status=429, retry_after_s=wish) for wish in wishes))
    assert script.run() == "answer"
    assert len(script.waits) == len(wishes)
    for number, (wish, wait) in enumerate(zip(wishes, script.waits, strict=True)):
        floor = min(wish or 0.0, 120.0)
        assert floor <= wait <= floor + min(60.0, 0.5 * 2**number)


def test_waits_are_jittered() -> None:
    waits = set()
    for _ in range(20):
        script = Script(RetryableError("a"))
        script.run()
        waits.add(script.waits[0])
    assert len(waits) > 10
