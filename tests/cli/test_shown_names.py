"""Names that others chose are shown as they are, on one line, whatever stands in them."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import pandas as pd
import pytest

from phyblock.cli.console import make_console, plain_table, print_view
from phyblock.cli.progress import ProgressView
from phyblock.report import Column, TextTable, load_run, to_latex, to_markdown, write_tables
from phyblock.report.export.write import export_run
from phyblock.run.events import RunStarted
from phyblock.tables.csv_text import to_csv
from tests.report.factory import LEVELS, manifest, record, score, write_run

NAME = ":b: [red]x[/red]\n=2 \x1b[31m\u202e|&\r"
SHOWN = ":b: [red]x[/red] =2  [31m |&"
FORMULA = "=HYPERLINK(A1)"


def lines(text: str) -> list[str]:
    return text.replace("│", " ").splitlines()


def test_tables_show_names_as_they_are(capsys: pytest.CaptureFixture[str]) -> None:
    console = make_console()
    columns = (Column("Model", is_text=True), Column("F1"))
    print_view(console, TextTable(NAME, columns, ((NAME, "1.0"), ("b", "2.0")), (NAME,)))
    console.print(plain_table(("model", NAME), [(NAME, "3.0")], numbers=1))
    console.print(NAME.replace("\n", " "))
    shown = capsys.readouterr().out
    assert shown.count(SHOWN) == 5
    assert "\x1b" not in shown
    assert any(SHOWN in line and line.endswith("1.0") for line in lines(shown))
    assert any(SHOWN in line and line.rstrip().endswith("3.0") for line in lines(shown))


def test_the_panel_shows_names_as_they_are() -> None:
    console = make_console()
    console.file = io.StringIO()
    view = ProgressView(console, NAME)
    view(RunStarted({NAME: 1}, {NAME: ()}))
    console.print(view._panel())
    shown = console.file.getvalue()
    assert shown.count(SHOWN) == 2
    assert "\x1b" not in shown


def test_files_hold_names_on_one_line() -> None:
    columns = (Column("Model", is_text=True), Column("F1"))
    view = TextTable("caption", columns, ((NAME, "1.0"), ("b", "2.0")))
    table_lines = [line for line in to_markdown(view).splitlines() if line.startswith("|")]
    assert len(table_lines) == 4
    assert all(line.count("|") - line.count("\\|") == 3 for line in table_lines)
    rows = [line for line in to_latex(view, "x").splitlines() if line.endswith("\\\\")]
    assert len(rows) == 3
    assert all(row.count("&") - row.count("\\&") == 1 for row in rows)


def test_no_cell_of_any_csv_is_a_formula(tmp_path: Path) -> None:
    records = [
        record(FORMULA, scene, scores=[score(1, 1, 1)], text="-2+3+cmd|' /C calc'!A0")
        for scene in LEVELS
    ]
    folder = write_run(tmp_path / "run", records, manifest(models=[FORMULA], seeds=[0]))
    written = write_tables(folder)
    exported = export_run(load_run(folder), "csv")
    checked = 0
    for path in (*written.files, *exported):
        if path.suffix == ".csv":
            with path.open(newline="", encoding="utf-8") as file:
                for cell in (cell for row in csv.reader(file) for cell in row):
                    checked += f"'{FORMULA}" == cell
                    if cell.startswith(("=", "+", "-", "@", "\t", "\r")):
                        float(cell)
    assert checked > len(LEVELS)
    assert pd.read_csv(exported[0])["reply"][0] == "'-2+3+cmd|' /C calc'!A0"


def test_numbers_and_gaps_in_a_csv_stay() -> None:
    frame = pd.DataFrame(
        {
            "a": [1, None, "=x"],
            "b": [-1.5, 2.0, None],
            "c": pd.array(["-x", None, "-2"], dtype="string"),
        }
    )
    assert to_csv(frame, "%.1f") == "a,b,c\n1,-1.5,'-x\n,2.0,\n'=x,,-2\n"
    assert frame["a"][2] == "=x"
