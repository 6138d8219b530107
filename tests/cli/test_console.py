"""A terminal or a log shows tables of any width, names that others chose, and progress."""

import io

import pandas as pd
from hypothesis import given
from hypothesis import strategies as st
from rich.cells import cell_len

from phyblock.cli.console import make_console, print_table
from phyblock.cli.run import ProgressView
from phyblock.models.model import ModelEvent
from phyblock.results.load import load_run
from phyblock.results.tables import write_csv, write_tables
from phyblock.results.text import Column, TextTable
from phyblock.run.runner import RunStarted
from tests.web.factory import LEVELS, manifest, record, score, write_run
from tests.workspace import csv_rows

NAME = ":b: [red]x[/red]\n=2 \x1b[31m\u202e|&\r"
SHOWN = ":b: [red]x[/red] =2  [31m |&"
FORMULA = "=HYPERLINK(A1)"
WORDS = st.text("abc01%", min_size=1, max_size=9)
GROUPS = st.sampled_from(["", "Level", "A long name"])


@st.composite
def tables(draw):
    before, behind = (draw(st.lists(WORDS, max_size=1)) for _ in range(2))
    columns = (
        *(Column(name, is_text=True) for name in ("Model", *before)),
        *(Column(draw(WORDS), draw(GROUPS)) for _ in range(draw(st.integers(1, 8)))),
        *(Column(name, is_text=True) for name in behind),
    )
    # No two cells are alike, so that each can be found again.
    rows = tuple(
        tuple(f"{draw(WORDS)}.{row}.{column}" for column in range(len(columns)))
        for row in range(draw(st.integers(0, 4)))
    )
    note = st.lists(WORDS, min_size=1, max_size=30).map(" ".join)
    return TextTable(draw(note), columns, rows, tuple(draw(st.lists(note, max_size=2))))


@given(view=tables(), width=st.integers(60, 200))
def test_no_line_is_wider_than_the_terminal_and_every_cell_stands_whole(view, width):
    console = make_console()
    console.file, console.width = io.StringIO(), width
    print_table(console, view)
    lines = console.file.getvalue().splitlines()
    assert max(map(cell_len, lines)) <= width
    words = [word for line in lines for word in line.split()]
    pieces = sum(set(line) == {"─"} for line in lines)
    # Names are the columns before the first number; each piece of a table repeats them.
    n_names = next(n for n, column in enumerate(view.columns) if not column.is_text)
    for row in view.rows:
        assert [*map(words.count, row)] == [pieces] * n_names + [1] * (len(row) - n_names)


def test_tables_show_names_as_they_are():
    console = make_console()
    console.file = io.StringIO()
    columns = (Column("Model", is_text=True), Column("F1"))
    print_table(console, TextTable(NAME, columns, ((NAME, "1.0"), ("b", "2.0")), (NAME,)))
    console.print(NAME.replace("\n", " "))
    view = ProgressView(console)
    view(RunStarted(1, {NAME: ()}))
    console.print(view.make_tasks_table(view.tasks))
    view(ModelEvent(NAME, "stopped", NAME))
    shown = console.file.getvalue()
    assert shown.count(SHOWN) == 7
    assert "\x1b" not in shown
    assert any(SHOWN in line and line.rstrip().endswith("1.0") for line in shown.splitlines())


def test_no_cell_of_any_csv_is_a_formula(tmp_path):
    records = [
        record(FORMULA, scene, scores=[score(1, 1, 1)], text="-2+3+cmd|' /C calc'!A0")
        for scene in LEVELS
    ]
    facts = manifest(models=[FORMULA], seeds=[0], suite={"models": ["alpha"]})
    folder = write_run(tmp_path / "run", records, facts)
    written = write_tables(folder)
    exported = write_csv(load_run(folder), folder / "export")
    tables = [path for path in (*written.files, *exported) if path.suffix == ".csv"]
    cells = [cell for path in tables for row in csv_rows(path) for cell in row.values()]
    for cell in cells:
        if cell.startswith(("=", "+", "-", "@", "\t", "\r")):
            float(cell)
    assert cells.count(f"'{FORMULA}") > len(LEVELS)
    assert pd.read_csv(exported[0])["reply"][0] == "'-2+3+cmd|' /C calc'!A0"
