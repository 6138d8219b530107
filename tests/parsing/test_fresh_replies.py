"""Readers against replies that were written before they were read, and laws of what they doubt."""

from __future__ import annotations

from hypothesis import assume, given, settings
from hypothesis import strategies as st

from phyblock.parsing import parse_plan
from tests.parsing.fresh_replies import KINDS, fresh_replies, tally

PLANS = st.lists(st.integers(1, 16), min_size=3, max_size=12)
BLOCKS = st.integers(1, 16)
MOST_FAILED = {1: 8, 2: 15, 3: 7, 4: 11, 5: 12, 6: 20, 7: 8, 8: 12}
"""Of each round, how many replies are not read."""


def asked_form(steps: list[int]) -> str:
    return "\n".join(f"Step{i}: Move block with index {n}" for i, n in enumerate(steps, 1))


def reading(text: str) -> list[int] | None:
    parsed = parse_plan(text, 16)
    return None if parsed.rule is None else list(parsed.plan.steps)


def test_every_round_holds_all_kinds_and_replies_without_an_answer() -> None:
    replies = list(fresh_replies())
    assert {reply.kind for reply in replies} == set(KINDS)
    for number in MOST_FAILED:
        meant = [reply.meant for reply in replies if reply.round == number]
        assert len(meant) >= 40
        assert None in meant


def test_no_reply_is_silently_misread_and_few_are_not_read() -> None:
    now = {number: counts["now"] for number, counts in tally().items()}
    assert {number: counts["wrong"] for number, counts in now.items()} == dict.fromkeys(now, 0)
    assert {number: counts["failed"] for number, counts in now.items()} == MOST_FAILED


@settings(deadline=None, max_examples=40)
@given(
    steps=PLANS,
    block=BLOCKS,
    at=st.integers(1, 12),
    word=st.sampled_from(["Wait", "Correction", "Oops"]),
)
def test_a_plan_that_is_corrected_behind_it_is_not_read_as_it_stands(
    steps: list[int], block: int, at: int, word: str
) -> None:
    assume(at <= len(steps) and steps[at - 1] != block)
    read = reading(f"{asked_form(steps)}\n\n{word}: step {at} should be block {block}.")
    meant = [*steps[: at - 1], block, *steps[at:]]
    assert read in (None, meant)


@settings(deadline=None, max_examples=40)
@given(steps=PLANS, block=BLOCKS)
def test_a_block_that_is_added_in_words_is_not_lost(steps: list[int], block: int) -> None:
    assume(block not in steps)
    read = reading(f"{asked_form(steps)}\n\nOn top of all that goes block {block}.")
    assert read in (None, [*steps, block])


@settings(deadline=None, max_examples=40)
@given(steps=PLANS, support=BLOCKS)
def test_a_block_that_carries_another_is_one_of_the_plan(steps: list[int], support: int) -> None:
    assume(len(steps) > 3)
    text = f"{asked_form(steps)} on top of block {support}"
    assert reading(text) == (steps if support in steps else None)


@settings(deadline=None, max_examples=40)
@given(steps=PLANS, left_out=st.integers(1, 2))
def test_a_list_without_its_beginning_is_not_a_plan(steps: list[int], left_out: int) -> None:
    lines = asked_form([1, *steps]).splitlines()[left_out:]
    assert reading("\n".join(lines)) is None
