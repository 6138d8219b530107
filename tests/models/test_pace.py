"""Laws of how many requests are under way at once; no law speaks of time that passes."""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.errors import ModelError, RetryableError, SampleError, UnreachableError
from phyblock.models.pace import FixedPace, Mark, Pace, is_late, says_too_much

CAPS = st.integers(1, 100)
PACES = st.tuples(st.just(FixedPace), CAPS)
EVENTS = st.lists(
    st.tuples(st.sampled_from(["answered"] * 8 + ["refused", "late"]), st.floats(0.01, 100)),
    max_size=300,
)


class Loop:
    """A pace with as many requests under way as it allows: the oldest is answered, or late, the
    newest refused.
    """

    def __init__(self, pace: Pace) -> None:
        self.pace = pace
        self.under_way: deque[Mark] = deque()
        self.fill()

    def fill(self) -> None:
        while len(self.under_way) < self.pace.width:
            self.under_way.append(self.pace.begin(len(self.under_way) + 1))

    def end(self, how: str, latency_s: float = 1.0) -> None:
        mark = self.under_way.pop() if how == "refused" else self.under_way.popleft()
        if how == "answered":
            self.pace.answered(mark, latency_s)
        else:
            getattr(self.pace, how)(mark)
        self.fill()

    def answer(self, count: int, latency_s: Callable[[int], float]) -> list[int]:
        """So many are answered, by what that takes with so many under way; the widths after."""
        widths = []
        for _ in range(count):
            self.end("answered", latency_s(len(self.under_way)))
            widths.append(self.pace.width)
        return widths


@settings(max_examples=60, deadline=None)
@given(PACES, EVENTS)
def test_a_width_keeps_its_bounds_and_only_answers_raise_it(
    made: tuple[type[Pace], int], events: list[tuple[str, float]]
) -> None:
    kind, cap = made
    loop = Loop(kind(cap))
    for how, latency_s in events:
        before = loop.pace.width
        loop.end(how, latency_s)
        assert 1 <= loop.pace.width <= cap
        assert how == "answered" or loop.pace.width <= before


@settings(max_examples=40, deadline=None)
@given(PACES, EVENTS)
def test_what_was_under_way_together_cuts_once(
    made: tuple[type[Pace], int], events: list[tuple[str, float]]
) -> None:
    kind, cap = made
    loop = Loop(kind(cap))
    for how, latency_s in events:
        loop.end(how, latency_s)
    together = [loop.pace.begin(loop.pace.width) for _ in range(5)]
    before = loop.pace.width
    assert loop.pace.refused(together[0])
    after = loop.pace.width
    assert after < before or before == 1
    for mark in together:
        assert not loop.pace.refused(mark)
        assert not loop.pace.late(mark)
    assert loop.pace.width == after


@pytest.mark.parametrize("width", [2, 7, 64])
def test_a_fixed_number_is_halved_by_each_round_of_refusals(width: int) -> None:
    pace = FixedPace(width)
    first, second = pace.begin(1), pace.begin(2)
    assert pace.refused(first)
    assert not pace.refused(second)
    assert pace.width == width // 2
    assert pace.refused(pace.begin(1))
    assert pace.width == max(1, width // 4)


@pytest.mark.parametrize("width", [1, 2, 7, 64])
def test_a_fixed_number_comes_back_in_small_steps(width: int) -> None:
    pace = FixedPace(width)
    for _ in range(10):
        pace.refused(pace.begin(1))
    widths = [pace.width]
    for _ in range(10 * width):
        pace.answered(pace.begin(1), 1.0)
        widths.append(pace.width)
    assert widths[0] == 1
    assert widths[-1] == width
    assert all(0 <= b - a <= max(1, width // 8) for a, b in itertools.pairwise(widths))


def test_which_failures_say_that_it_is_too_much() -> None:
    def kinds(error: ModelError) -> tuple[bool, bool]:
        return says_too_much(error), is_late(error)

    assert kinds(RetryableError("", status=429)) == (True, False)
    assert kinds(RetryableError("", status=529)) == (True, False)
    assert kinds(RetryableError("", sent="maybe")) == (False, True)
    for error in (
        RetryableError("", status=500),
        RetryableError("", status=503),
        RetryableError("", sent="lost"),
        UnreachableError(""),
        SampleError("", status=400),
    ):
        assert kinds(error) == (False, False)
