"""Text of others steers neither a terminal nor a spreadsheet."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.errors import ModelError
from phyblock.text import counted, csv_cell, one_line

STARTS = tuple("=+-@\t\r\n")
risky = st.text(alphabet="'=+-@\t\r\n1.a") | st.text()


def taken_back(cell: str) -> str:
    """Read a line as docs/results.md says a reader does."""
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


@given(st.text(alphabet=st.characters()))
def test_one_line_is_one_line_that_can_be_written(text: str) -> None:
    shown = one_line(text)
    assert len(shown) == len(text)
    assert shown.isprintable()
    shown.encode()


@pytest.mark.parametrize(
    ("number", "said"),
    [(0, "0 replies"), (1, "1 reply"), (2, "2 replies"), (1500, "1,500 replies")],
)
def test_one_thing_is_no_plural(number: int, said: str) -> None:
    assert counted(number, "reply", "replies") == said
    assert counted(number, "scene") == said.replace("replies", "scenes").replace("reply", "scene")


@given(st.text())
def test_what_a_server_says_steers_no_terminal(message: str) -> None:
    assert str(ModelError(message)).isprintable()
