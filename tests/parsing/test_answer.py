"""Answers and orders: a table of replies with the letters that they say, and laws."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.parsing.answer import choice_form, parse_answer

TEXTS = ("a red cube", "a blue cube", "an arch", "a cylinder")
LENGTHS = ("5 cm", "7.5 cm", "10 cm", "15 cm")

READ: list[tuple[str, str | None, str | None]] = [
    ("Answer: C", "C", "answer_line"),
    ("The span is bridged by one block.\n\n**Answer:** (C)", "C", "answer_line"),
    ("Answer: c", "C", "answer_line"),
    ("Answer:\nC", "C", "answer_line"),
    ("The correct answer is option C, because it is round.", "C", "answer_line"),
    ("Answer: C) an arch", "C", "answer_line"),
    ("Answer: an arch", "C", "answer_line"),
    ("Answer: A\nWait, it is hollow.\nAnswer: C", "C", "answer_line"),
    ("\\boxed{C}", "C", "answer_line"),
    ("It is hollow. $\\boxed{\\text{C}}$", "C", "answer_line"),
    ("<answer>C</answer>", "C", "answer_line"),
    ("<think>Answer: A</think>Answer: C", "C", "answer_line"),
    ('{"reasoning": "hollow", "answer": "C"}', "C", "json"),
    ('Draft {"answer": "A"}, then:\n```json\n{"answer": "C"}\n```', "C", "json"),
    ("I choose C. A and B are solid.", "C", "stated"),
    ("A looks right at first, but it is solid. Therefore C.", "C", "stated"),
    ("B is wrong. C is the correct one.", "C", "stated"),
    ("C", "C", "line"),
    ("**C.** It is the only one with a hole.", "C", "line"),
    ("It has a hole.\n(C)", "C", "line"),
    ("An arch.", "C", "line"),
    ("Only option C has a hole in it.", "C", "only_named"),
    ("What the picture shows on the left is an arch.", "C", "only_named"),
    ("", None, None),
    ("I cannot tell from this picture.", None, None),
    ("Answer: none of them", None, None),
    ("Answer: A or B", None, None),
    ("Answer: X", None, None),
    ("Answer: E", None, None),
    ("A. a red cube\nB. a blue cube\nC. an arch\nD. a cylinder", None, None),
    ("It may be option A, it may be option B.", None, None),
]


@pytest.mark.parametrize(("text", "letter", "rule"), READ)
def test_a_choice_is_read_as_it_is_stated(text: str, letter: str | None, rule: str | None) -> None:
    parsed = parse_answer(text, TEXTS, is_ordering=False)
    assert (parsed.letters, parsed.rule) == (letter, rule)
    assert (parsed.problem is None) == (letter is not None)


@pytest.mark.parametrize(
    ("text", "letter"),
    [
        *(("Answer: 10 cm", "C"), ("Answer: 10", "C"), ("Answer: B (7.5 cm)", "B"), ("5 cm", "A")),
        *(("Answer: 75", None), ("It is 5 cm or 10 cm long.", None)),
    ],
)
def test_options_that_are_numbers_are_read_by_number(text: str, letter: str | None) -> None:
    assert parse_answer(text, LENGTHS, is_ordering=False).letters == letter


@pytest.mark.parametrize(
    ("text", "letters"),
    [
        ("Answer: C, A, D, B", "CADB"),
        ("First C, later D.\n**Answer: C → A → D → B**", "CADB"),
        ("CADB", "CADB"),
        ("The order is C > A > D > B.", "CADB"),
        ("1. C\n2. A\n3. D\n4. B", "CADB"),
        ("First I thought A, B, C, D, but it must be C, A, D, B.", "CADB"),
        ('{"reasoning": "", "answer": ["C", "A", "D", "B"]}', "CADB"),
        ('{"answer": "C, A, D, B"}', "CADB"),
        ("\\boxed{C, A, D, B}", "CADB"),
        ("picture C, then picture A, then picture D, then picture B", "CADB"),
        ("Answer: W, X, Y, Z", None),
        ("C, A, D", None),
        ("C, A, C, B", None),
        ("I cannot tell.", None),
    ],
)
def test_an_order_is_the_last_that_names_every_letter(text: str, letters: str | None) -> None:
    assert parse_answer(text, TEXTS, is_ordering=True).letters == letters


harmless = st.text(st.sampled_from("xyz ,.\n"), max_size=80)


@given(
    harmless,
    st.sampled_from("ABCD"),
    st.sampled_from(("Answer: {}", "**Answer: {}**", "\\boxed{{{}}}")),
)
def test_text_before_the_asked_line_changes_nothing(text: str, letter: str, form: str) -> None:
    whole = f"{text}\n{form.format(letter)}"
    assert parse_answer(whole, TEXTS, is_ordering=False).letters == letter


@given(st.permutations("ABCD"))
def test_the_json_form_is_read_as_it_is_written(order: list[str]) -> None:
    for value, is_ordering in ((order, True), (order[0], False)):
        form = choice_form(TEXTS, is_ordering)
        text = json.dumps({"reasoning": "It is {A}.", form.key: value})
        assert json.loads(text)["answer"] == value
        assert parse_answer(text, TEXTS, is_ordering).letters == "".join(value)
