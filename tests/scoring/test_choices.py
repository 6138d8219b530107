"""Questions: what letters and guesses come to, and the published averages recomputed."""

from __future__ import annotations

import math

import pytest
from hypothesis import strategies as st

from phyblock.domain import CATEGORIES, LETTERS
from phyblock.results.paper import published_table
from phyblock.scoring.counts import chance

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
answers = st.lists(st.tuples(letters, st.one_of(st.none(), letters)), max_size=40)


def published() -> dict[str, dict[tuple[str, str], float]]:
    table = published_table(2)
    return {
        str(model): {(row.category, row.subtask): row.value for row in rows.itertuples()}
        for model, rows in table.groupby("model")
    }


def test_every_published_category_average_is_the_mean_of_its_four_subtasks() -> None:
    for model, cells in published().items():
        for category, subtasks in CATEGORIES.items():
            mean = sum(cells[category, subtask] for subtask in subtasks) / len(subtasks)
            assert abs(mean - cells[category, "average"]) <= ROUNDING, (model, category)


def test_the_published_overall_is_the_mean_of_the_categories_but_in_five_rows() -> None:
    others = {}
    for model, cells in published().items():
        mean = sum(cells[category, "average"] for category in CATEGORIES) / len(CATEGORIES)
        if abs(mean - cells["overall", "average"]) > ROUNDING:
            others[model] = mean
    assert others == pytest.approx(OTHERWISE_AVERAGED)


def test_chance_of_an_order_is_one_in_all_permutations() -> None:
    assert chance("SH") == 0.25
    assert chance("OR") == pytest.approx(1 / math.factorial(4))
    assert chance("VP", 2) == 0.5
