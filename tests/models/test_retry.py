"""The one retry layer: what is repeated, how often, after which waits."""

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
from phyblock.models.retry import RetryPolicy, with_retries


class Script:
    """Raises the given errors one by one, then answers."""

    def __init__(self, *errors: Exception) -> None:
        self.errors = list(errors)
        self.calls = 0
        self.waits: list[float] = []
        self.told: list[float] = []

    async def send(self) -> str:
        self.calls += 1
        if self.errors:
            raise self.errors.pop(0)
        return "answer"

    async def sleep(self, seconds: float) -> None:
        self.waits.append(seconds)

    def run(self, **policy: float) -> str:
        rules = RetryPolicy(sleep=self.sleep, **policy)  # type: ignore[arg-type]

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
        script.run()
    assert script.calls == 8
    assert len(script.waits) == 7


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
