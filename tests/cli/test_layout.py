"""Tables in narrow terminals: broken into pieces, no cell ever cut."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from phyblock.cli.layout import lay_out, width_of
from phyblock.tables.text_table import Column, TextTable

WORDS = st.text("abc01%", min_size=1, max_size=9)
GROUPS = st.sampled_from(["", "Level", "A long name"])


@st.composite
def tables(draw: st.DrawFn) -> TextTable:
    columns = (
        Column("Model", is_text=True),
        *(Column(name, is_text=True) for name in draw(st.lists(WORDS, max_size=1))),
        *(Column(draw(WORDS), draw(GROUPS)) for _ in range(draw(st.integers(1, 8)))),
        *(Column(name, is_text=True) for name in draw(st.lists(WORDS, max_size=1))),
    )
    # No two cells are alike, so that each can be found again.
    rows = tuple(
        tuple(f"{draw(WORDS)}.{row}.{column}" for column in range(len(columns)))
        for row in range(draw(st.integers(0, 4)))
    )
    return TextTable("", columns, rows)


@given(view=tables(), width=st.integers(1, 120))
def test_every_cell_stands_whole_once_beside_its_names(view: TextTable, width: int) -> None:
    pieces = lay_out(view, width)
    for position, row in enumerate(view.rows):
        shown = [lines[len(lines) - len(view.rows) + position].split() for lines in pieces]
        names = [cell for cell in row if all(cell in line for line in shown)]
        assert row[0] in names
        assert [cell for line in shown for cell in line[len(names) :]] == (
            list(row[len(names) :]) if len(pieces) > 1 else []
        )
        assert len(pieces) > 1 or shown == [list(row)]


@given(view=tables(), width=st.integers(60, 120))
def test_pieces_fit_where_names_and_any_column_do(view: TextTable, width: int) -> None:
    names = [column.is_text for column in view.columns].index(False)
    if width_of(view) <= width:
        assert len(lay_out(view, width)) == 1
    # A column is at most 13 wide, a heading of a group 12, and two spaces stand between.
    if 15 * (names + 1) <= width:
        assert max(len(line) for lines in lay_out(view, width) for line in lines) <= width


def test_groups_stay_together_under_their_heading() -> None:
    columns = (
        Column("Model", is_text=True),
        *(Column(name, level) for level in ("Level-1", "Level-2") for name in ("Prec", "Rec")),
    )
    view = TextTable("", columns, (("a-model", "12.5", "1.0", "100.0", "7.0"),))
    assert lay_out(view, 30) == [
        [
            "           Level-1",
            " Model    Prec  Rec",
            " ──────────────────",
            " a-model  12.5  1.0",
        ],
        [
            "            Level-2",
            " Model     Prec  Rec",
            " ───────────────────",
            " a-model  100.0  7.0",
        ],
    ]
