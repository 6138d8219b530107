"""Laws of the answer parser: total on any text, bound to the options shown, linear."""

# ruff: noqa: RUF001 -- replies come in other scripts

from __future__ import annotations

import itertools

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from phyblock.parsing import parse_answer

FRAGMENTS = st.sampled_from(
    [
        "A", "B", "C", "D", "E", "a", "b", "1", "2", "4", "7", "(", ")", ".", ":", ",", "-", "\n",
        "Answer", "Final answer", "answer is", "The answer is", "option", "Option ", "picture ",
        "not", "I choose", "is correct", "cube", "arch", "the", "\\boxed{", "}", "<answer>",
        "</answer>", '{"answer": "', '"}', "**", "*", "`", "wait", "so", "答案是", "选",
        "Ответ:", "<think>", "</think>", "→", "or", "and", "must be", "\x00", "\u2028", "Ｂ", "½",
        "I cannot", "<img2>",
    ]
)  # fmt: skip
TEXTS = st.one_of(
    st.text(max_size=300),
    st.lists(st.one_of(FRAGMENTS, st.text(max_size=5)), max_size=40).map("".join),
    st.lists(FRAGMENTS, max_size=40).map(" ".join),
)
WORDS = ("cube", "arch", "cylinder", "cuboid", "triangle")
OPTION_LISTS = st.one_of(
    st.lists(st.sampled_from(WORDS), min_size=2, max_size=4, unique=True),
    st.lists(st.integers(0, 30).map(str), min_size=2, max_size=4, unique=True),
    st.lists(st.text(max_size=8), min_size=2, max_size=4, unique=True),
)
LETTERS = "ABCD"


@given(text=TEXTS, options=OPTION_LISTS)
@example(text="Answer: C", options=["cube", "arch"])
@example(text="**", options=["", " "])
def test_any_text_gives_one_of_the_options_shown_or_nothing(text: str, options: list[str]) -> None:
    parsed = parse_answer(text, options, False)
    assert parsed.letters is None or parsed.letters in set(LETTERS[: len(options)])
    assert (parsed.rule is None) == (parsed.letters is None)


@given(text=TEXTS, n=st.integers(2, 4))
def test_any_text_gives_an_order_of_all_options_shown_or_nothing(text: str, n: int) -> None:
    parsed = parse_answer(text, [f"<img{i}>" for i in range(1, n + 1)], True)
    assert parsed.letters is None or sorted(parsed.letters) == list(LETTERS[:n])
    assert (parsed.rule is None) == (parsed.letters is None)


@given(letter=st.sampled_from(LETTERS), preamble=TEXTS)
def test_the_asked_form_is_read_after_any_reasoning_section(letter: str, preamble: str) -> None:
    text = f"<think>{preamble}</think>\nAnswer: {letter}"
    assert parse_answer(text, WORDS[:4], False).letters == letter


@given(order=st.permutations(LETTERS), separator=st.sampled_from([", ", "-", " > ", "", "→", " "]))
def test_every_order_is_read_in_the_asked_form(order: list[str], separator: str) -> None:
    text = f"First I look at all of them.\nAnswer: {separator.join(order)}"
    assert parse_answer(text, ["<img1>"] * 4, True).letters == "".join(order)


@given(options=st.lists(st.sampled_from(WORDS), min_size=2, max_size=4, unique=True))
def test_letter_text_and_both_agree(options: list[str]) -> None:
    for letter, option in zip(LETTERS, options, strict=False):
        said = [
            f"{letter}",
            f"{letter}. {option}",
            option,
            f"The answer is {option}.",
            f"({letter})",
        ]
        assert {parse_answer(text, options, False).letters for text in said} == {letter}


@given(text=st.text(alphabet="efghijklmnopqrstuvwxyz ,.", max_size=200))
def test_small_words_without_an_option_are_a_parse_failure(text: str) -> None:
    assert parse_answer(text, ["17", "18", "19", "20"], False).letters is None


@pytest.mark.parametrize(("first", "second"), [*itertools.permutations(LETTERS, 2)])
def test_two_final_answers_are_a_parse_failure(first: str, second: str) -> None:
    assert parse_answer(f"Answer: {first}\nAnswer: {second}", WORDS[:4], False).letters is None


@pytest.mark.parametrize(
    "unit",
    [
        "A", "B ", "answer is ", "Answer: A\n", "\\boxed{", "<answer>", "(A) ", "A, B, C, D ", "**",
        '{"answer":', "\n", "option ", "1. A\n", "答案", "no ", "the ", "so B ", " A)", "order of ",
        "so the answer ", "order is A, B, C ", "The final ", "* ", "_", "[", "B is ",
    ],
)  # fmt: skip
@pytest.mark.parametrize("is_ordering", [False, True])
@pytest.mark.parametrize("n_chars", [50_000, pytest.param(1_000_000, marks=pytest.mark.slow)])
def test_a_megabyte_of_one_thing_is_read_to_the_end(
    unit: str, is_ordering: bool, n_chars: int
) -> None:
    answer = "B, A, D, C" if is_ordering else "B"
    text = unit * (n_chars // len(unit)) + f"\nSo this is wrong.\nFinal answer: {answer}\n"
    wanted = "BADC" if is_ordering else "B"
    assert parse_answer(text, WORDS[:4], is_ordering).letters == wanted
