"""Accuracy of questions: laws, and the published averages recomputed."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.domain import CATEGORIES, LETTERS, SUBTASKS, Subtask
from phyblock.report import published_table
from phyblock.scoring import (
    Accuracy,
    Answered,
    chance,
    circular,
    letter_rates,
    macro_accuracy,
    subtask_accuracies,
)

ROUNDING = 0.05 + 1e-9
OTHERWISE_AVERAGED = {
    "Claude-3.7 Sonnet": 53.65,
    "Gemini-1.5-flash": 53.75,
    "Qwen-VL-Max": 51.45,
    "Qwen2.5-VL-72B-Instruct": 46.825,
    "Random": 23.90,
}
"""Rows whose printed overall number is not the mean of the printed categories, and that mean."""

letters = st.sampled_from(LETTERS)
answers = st.lists(
    st.builds(
        Answered,
        question=st.integers(0, 9).map(str),
        subtask=st.sampled_from(SUBTASKS),
        right=letters,
        given=st.one_of(st.none(), letters),
        rotation=st.integers(0, 3),
    ),
    max_size=40,
)


def published() -> dict[str, dict[tuple[str, str], float]]:
    table = published_table(2)
    return {
        str(model): {(row.category, row.subtask): row.value for row in rows.itertuples()}
        for model, rows in table.groupby("model")
    }


def test_every_published_category_average_is_the_mean_of_its_four_subtasks() -> None:
    for model, cells in published().items():
        values: dict[Subtask, float | None] = {
            subtask: cells[category, subtask]
            for category in CATEGORIES
            for subtask in CATEGORIES[category]
        }
        means = macro_accuracy(values).categories
        for category in CATEGORIES:
            mean = means[category]
            assert mean is not None
            assert abs(mean - cells[category, "average"]) <= ROUNDING, (model, category)


def test_the_published_overall_is_the_mean_of_the_categories_but_in_five_rows() -> None:
    others = {}
    for model, cells in published().items():
        mean = sum(cells[category, "average"] for category in CATEGORIES) / len(CATEGORIES)
        if abs(mean - cells["overall", "average"]) > ROUNDING:
            others[model] = mean
    assert others == pytest.approx(OTHERWISE_AVERAGED)


@given(answers)
def test_accuracies_count_every_answer_once_and_only_exact_ones_as_right(
    found: list[Answered],
) -> None:
    accuracies = subtask_accuracies(found)
    assert tuple(accuracies) == SUBTASKS
    assert sum(one.n for one in accuracies.values()) == len(found)
    assert sum(one.n_right for one in accuracies.values()) == sum(a.given == a.right for a in found)
    assert all((one.value is None) == (one.n == 0) for one in accuracies.values())


@given(answers, st.integers(1, 4))
def test_circular_scoring_never_gains_and_asks_for_every_rotation(
    found: list[Answered], rotations: int
) -> None:
    whole = circular(found, rotations)
    for subtask, accuracy in whole.items():
        mine = [answer for answer in found if answer.subtask == subtask]
        questions = {answer.question for answer in mine}
        assert accuracy.n == len(questions)
        for question in questions:
            right = {a.rotation for a in mine if a.question == question and a.is_correct}
            if len(right) < rotations:
                assert circular([a for a in mine if a.question == question], rotations)[
                    subtask
                ] == Accuracy(0, 1)


def test_one_wrong_rotation_of_four_makes_a_question_wrong() -> None:
    right = [Answered("q", "SH", LETTERS[i], LETTERS[i], i) for i in range(4)]
    assert circular(right, 4)["SH"] == Accuracy(1, 1)
    assert circular([*right[:3], Answered("q", "SH", "D", "A", 3)], 4)["SH"] == Accuracy(0, 1)
    assert circular(right[:3], 4)["SH"] == Accuracy(0, 1)


def test_an_unread_answer_is_wrong_and_no_question_is_no_value() -> None:
    assert subtask_accuracies([Answered("q", "CO", "A", None)])["CO"] == Accuracy(0, 1)
    assert subtask_accuracies([])["CO"].value is None
    means = macro_accuracy({"SH": 1.0, "CO": 1.0, "SI": 1.0})
    assert set(means.categories.values()) == {None}
    assert means.overall is None


def test_a_category_is_defined_by_its_own_subtasks_alone() -> None:
    means = macro_accuracy({"SH": 1.0, "CO": 0.5, "SI": 0.0, "NU": 0.5})
    assert means.categories["object_property"] == 0.5
    assert means.categories["dynamic_reasoning"] is None
    assert means.overall is None


def test_an_order_is_right_as_a_whole_or_not_at_all() -> None:
    assert Answered("q", "OR", "BADC", "BADC").is_correct
    assert not Answered("q", "OR", "BADC", "BACD").is_correct


@given(answers)
def test_letters_are_counted_where_one_is_right(found: list[Answered]) -> None:
    orders = [Answered("o", "OR", "BADC", "ABCD"), Answered("o", "OR", "BADC", None)]
    rates = letter_rates([*found, *orders])
    assert rates == letter_rates(found)
    assert rates.n == sum(rates.right.values()) == len(found)
    assert sum(rates.given.values()) == sum(answer.given is not None for answer in found)


def test_chance_of_an_order_is_one_in_all_permutations() -> None:
    assert chance("SH") == 0.25
    assert chance("OR") == pytest.approx(1 / math.factorial(4))
    assert chance("VP", 2) == 0.5
