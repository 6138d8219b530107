"""Laws of the plan parsers: total on any text, and they invent nothing but what ranges hold."""

# ruff: noqa: RUF001 -- replies come in other scripts

from __future__ import annotations

import re

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from phyblock.parsing import PLAN_PROBLEMS, parse_plan
from phyblock.parsing.text_forms import number_of_word, plain_forms
from phyblock.types import PLAN_PARSERS, PlanParser

# Fragments that the rules look for, so that random texts reach deep into them.
FRAGMENTS = st.sampled_from(
    [
        "Step1:", "Step 2:", "Step 3 & 4:", "\nStep ", "step_1", '"Step1": "', "1.", "\n2)", "\n",
        "Move", "place", "block", "with", "index", "indices", "number", "#", "{", "}", "[", "]",
        ",", " and ", " or ", "/", ":", "：", '"', "'", "**", "```json", "</think>", "<think>",
        "Left structure", "Final answer", "Explanation", "0", "3", "16", "17", "007", "999999",
        "1000000", "9" * 5000, "٣", "１２", "²", "½", "Ⅷ", "三", "\x00", "\u2028", "\r", "-", "–",
    ]
)  # fmt: skip
TEXTS = st.one_of(
    st.text(max_size=300),
    st.lists(st.one_of(FRAGMENTS, st.text(max_size=5)), max_size=60).map("".join),
    st.lists(FRAGMENTS, max_size=60).map(" ".join),
)


RANGE = re.compile(r"(\d{1,6})\W{0,3}(?:-|–|—|~|\bto\b|through|thru|bis|至|到)\W{0,3}(\d{1,6})")


def said(text: str) -> set[int]:
    """The numbers that a text says: in digits, in words, and by its ranges."""
    plain = plain_forms(text)
    digits = {int(run) for run in re.findall(r"\d+", text + " " + plain) if len(run) <= 6}
    words = {number_of_word(word) for word in re.findall(r"[^\W\d_]{1,12}|[一-十]", plain)}
    ranges = [(int(a), int(b)) for a, b in RANGE.findall(plain)]
    between = {n for a, b in ranges if b - a < 22 for n in range(a, b)}
    return digits | between | {word for word in words if word is not None}


@pytest.mark.parametrize("parser", PLAN_PARSERS)
@settings(deadline=None)
@given(text=TEXTS, n_candidates=st.integers(0, 20))
@example(text="Step1: Move blocks 3-6 and block three", n_candidates=16)
@example(text="Step1: Move block with index " + "1" * 100_000, n_candidates=16)
@example(text="Step1: Move block with index ٣", n_candidates=16)
@example(text="Step1: Move block with index ²", n_candidates=16)
@example(text="\x00Step1: Move block with index 1\x00", n_candidates=16)
def test_every_number_read_is_said_in_the_text(
    parser: PlanParser, text: str, n_candidates: int
) -> None:
    parsed = parse_plan(text, n_candidates, parser)
    assert said(text).issuperset(parsed.plan.steps)
    assert said(text).issuperset(parsed.dropped)
    assert all(1 <= index <= n_candidates for index in parsed.plan.steps)
    assert not any(1 <= index <= n_candidates for index in parsed.dropped)
    assert (parsed.rule is None) == (not parsed.plan.steps and not parsed.dropped)
    assert parsed.problem in (PLAN_PROBLEMS if parsed.rule is None else (None,))


@settings(deadline=None)
@given(text=TEXTS, n_candidates=st.integers(0, 20))
def test_the_number_of_candidates_only_decides_what_is_dropped(
    text: str, n_candidates: int
) -> None:
    few = parse_plan(text, n_candidates)
    all_read = parse_plan(text, 999_999)
    assert few.plan.steps == tuple(n for n in all_read.plan.steps if n <= n_candidates)
    assert few.rule == all_read.rule


@given(text=st.text(alphabet=st.characters(exclude_categories=["Nd", "Cs"]), max_size=300))
def test_a_text_without_digits_is_a_parse_failure(text: str) -> None:
    assert parse_plan(text, 16).rule is None


@settings(deadline=None)
@given(steps=st.lists(st.integers(1, 16), min_size=1, max_size=30), preamble=TEXTS)
def test_the_asked_form_is_read_after_any_reasoning(steps: list[int], preamble: str) -> None:
    lines = "\n".join(f"Step{i}: Move block with index {n}" for i, n in enumerate(steps, 1))
    parsed = parse_plan(f"<think>{preamble}</think>\n{{\n{lines}\n}}", 16)
    assert parsed.plan.steps == tuple(steps)


@pytest.mark.parametrize(
    "unit",
    [
        "move ", "Step1: ", '"a step 1', "{ step1", "[1,", "[1 , ", "index 1, ", "\n\n1.", "*",
        "</think>", "1", "Step1: index 1\nStep1: index 2\n", "Step1: index 1\nRight structure:\n",
        "1. move index 1\n\nExplanation:\n", "Step 1-22: index 5\n", "index 1 or ", '"index":  ',
        "move block 1 a b cubes ", "move " + "x" * 118 + " ",
    ],
)  # fmt: skip
@pytest.mark.parametrize("parser", PLAN_PARSERS)
@pytest.mark.parametrize("n_chars", [50_000, pytest.param(1_000_000, marks=pytest.mark.slow)])
def test_a_megabyte_of_one_thing_is_read_to_the_end(
    unit: str, parser: PlanParser, n_chars: int
) -> None:
    text = unit * (n_chars // len(unit)) + "\nStep1: Move block with index 7\n"
    assert 7 in parse_plan(text, 16, parser).plan.steps
