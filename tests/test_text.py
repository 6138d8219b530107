from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.text import counted, csv_cell, one_line

STARTS = tuple("=+-@\t\r\n")
risky = st.text(alphabet="'=+-@\t\r\n1.a") | st.text()


def taken_back(cell: str) -> str:
    """What docs/results.md says a reader does."""
    return cell[1:] if cell.startswith("'") and cell.lstrip("'").startswith(STARTS) else cell


@given(risky)
def test_no_cell_begins_a_formula_and_what_it_held_can_be_had_back(text: str) -> None:
    cell = csv_cell(text)
    assert isinstance(cell, str)
    if cell.startswith(STARTS):
        float(cell)
    assert taken_back(cell) == text


@given(st.integers() | st.floats() | st.none())
def test_numbers_stay_numbers(value: float | None) -> None:
    assert csv_cell(value) is value
    text = str(value)
    assert csv_cell(text) == text or text == "-inf"


@pytest.mark.parametrize("text", ["=1+1", "@SUM(A1)", "-2+3+cmd|' /C calc'!A0", "\t=1", "+a"])
def test_formulas_become_text(text: str) -> None:
    assert csv_cell(text) == f"'{text}"


@given(st.text(alphabet=st.characters()))
def test_one_line_is_one_line_that_can_be_written(text: str) -> None:
    shown = one_line(text)
    assert len(shown) == len(text)
    assert shown.isprintable()
    shown.encode()


def test_one_line_leaves_printable_text_alone() -> None:
    assert one_line("a ± b – 模型") == "a ± b – 模型"  # noqa: RUF001
    assert one_line("a\nb\x1b[31m\u202ec\ud800") == "a b [31m c\ufffd"


@pytest.mark.parametrize(
    ("number", "said"),
    [(0, "0 replies"), (1, "1 reply"), (2, "2 replies"), (1500, "1,500 replies")],
)
def test_one_thing_is_no_plural(number: int, said: str) -> None:
    assert counted(number, "reply", "replies") == said
    assert counted(number, "scene") == said.replace("replies", "scenes").replace("reply", "scene")
