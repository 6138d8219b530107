"""Readers against replies that were written before they were read, and laws of what they doubt."""

from __future__ import annotations

from hypothesis import assume, given, settings
from hypothesis import strategies as st

from phyblock.parsing import parse_plan
from tests.parsing.fresh_replies import KINDS, fresh_replies

PLANS = st.lists(st.integers(1, 16), min_size=3, max_size=12)
BLOCKS = st.integers(1, 16)
ROUNDS = range(1, 19)
MOST_HARD = 0.12
"""The part of the replies that hold an answer of which a reader may admit that it fails."""


def asked_form(steps: list[int]) -> str:
    return "\n".join(f"Step{i}: Move block with index {n}" for i, n in enumerate(steps, 1))


def reading(text: str) -> list[int] | None:
    parsed = parse_plan(text, 16)
    return None if parsed.rule is None else list(parsed.plan.steps)


def test_every_round_holds_all_kinds_and_replies_without_an_answer() -> None:
    replies = list(fresh_replies())
    assert {reply.kind for reply in replies} == set(KINDS)
    for number in ROUNDS:
        meant = [reply.meant for reply in replies if reply.round == number]
        assert len(meant) >= 40
        assert None in meant


def test_every_reply_is_read_as_a_person_reads_it_but_for_hard_ones_that_may_fail() -> None:
    unlike = [
        (reply.round, reply.kind, reply.text, read, reply.meant)
        for reply in fresh_replies()
        if (read := reply.now()) != reply.meant and not (read is None and reply.hard)
    ]
    assert unlike == []


def test_few_replies_are_hard() -> None:
    held = [reply for reply in fresh_replies() if reply.meant is not None]
    assert sum(reply.hard for reply in held) <= MOST_HARD * len(held)


@settings(deadline=None, max_examples=40)
@given(steps=PLANS, block=BLOCKS, data=st.data())
def test_an_edit_behind_a_plan_is_done_or_the_reading_fails(
    steps: list[int], block: int, data: st.DataObject
) -> None:
    a, b = sorted(
        data.draw(st.lists(st.integers(1, len(steps)), min_size=2, max_size=2, unique=True))
    )
    swapped = [*steps[: a - 1], steps[b - 1], *steps[a : b - 1], steps[a - 1], *steps[b:]]
    edits = {
        f"Swap steps {a} and {b}.": swapped,
        f"Remove step {b}.": [*steps[: b - 1], *steps[b:]],
        f"Insert block {block} after step {a}.": [*steps[:a], block, *steps[a:]],
        f"Step {b} should be {block}, not {steps[b - 1]}.": [*steps[: b - 1], block, *steps[b:]],
    }
    for said, meant in edits.items():
        assert reading(f"{asked_form(steps)}\n\nWait. {said}") == meant, said
    behind = f"Replace block {block} by block 16."
    meant = [16 if step == block else step for step in steps]
    assert reading(f"{asked_form(steps)}\n\n{behind}") in (None, meant)


@settings(deadline=None, max_examples=40)
@given(steps=PLANS)
def test_a_plan_means_the_same_in_every_layout(steps: list[int]) -> None:
    numbered = list(enumerate(steps, 1))
    rows = "".join(f"<tr><td>{i}</td><td>{n}</td></tr>" for i, n in numbered)
    layouts = {
        "yaml": "plan:\n" + "\n".join(f"  - step: {i}\n    block: {n}" for i, n in numbered),
        "commas": "step,block\n" + "\n".join(f"{i},{n}" for i, n in numbered),
        "tabs": "Step\tBlock\n" + "\n".join(f"{i}\t{n}" for i, n in numbered),
        "html": f"<table><tr><th>Step</th><th>Block</th></tr>{rows}</table>",
        "calls": "\n".join(f"move_block({n}, on='floor')" for n in steps),
        "tools": "\n".join(f'{{"name": "move", "arguments": {{"index": {n}}}}}' for n in steps),
        "objects": "\n".join(f'{{"step": {i}, "block": {n}}}' for i, n in numbered),
        "a word that no pattern knows": "\n".join(f"Bước {i}: khối {n}" for i, n in numbered),
    }
    assert {name: reading(text) for name, text in layouts.items()} == dict.fromkeys(layouts, steps)


@settings(deadline=None, max_examples=40)
@given(
    layers=st.lists(st.lists(BLOCKS, min_size=2, max_size=3), min_size=2, max_size=4),
    is_down=st.booleans(),
)
def test_layers_are_built_from_the_ground_however_they_stand(
    layers: list[list[int]], is_down: bool
) -> None:
    lines = [f"Layer {i}: {', '.join(map(str, blocks))}" for i, blocks in enumerate(layers, 1)]
    headed = [
        "\n".join([f"**Layer {i}**", *(f"- Block {block}, lying" for block in blocks)]) + "\n"
        for i, blocks in enumerate(layers, 1)
    ]
    for parts in (lines, headed):
        text = "\n".join(parts[::-1] if is_down else parts)
        assert reading(text) == [block for blocks in layers for block in blocks]
    assert reading("Candidates:\n" + "\n".join(headed)) is None


@settings(deadline=None, max_examples=40)
@given(plans=st.lists(PLANS, min_size=2, max_size=2, unique_by=tuple), n=st.integers(1, 2))
def test_of_two_plans_that_is_read_which_a_sentence_chooses(plans: list[list[int]], n: int) -> None:
    lines = [f"Plan {i}: {', '.join(map(str, plan))}" for i, plan in enumerate(plans, 1)]
    place = ("first", "second")[n - 1]
    chooses = {
        f"I take plan {n}.": plans[n - 1],
        f"Plan {3 - n} is not stable, so plan {n}.": plans[n - 1],
        f"The {place} one fits the picture better.": plans[n - 1],
        f"I would take plan {n} if the block in the middle were a cube.": None,
        f"I cannot recommend plan {n}.": None,
        f"The {place} holds if the block is a cube; I cannot decide.": None,
    }
    for heading in ("", "Two plans come into question:\n\n"):
        for said, meant in chooses.items():
            assert reading(heading + "\n".join(lines) + f"\n\n{said}") == meant, said


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
