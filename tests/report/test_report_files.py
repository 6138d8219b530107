from __future__ import annotations

import csv
import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.errors import StoreError
from phyblock.files import LIST
from phyblock.report import Column, TextTable, load_run, to_latex, to_markdown, write_tables
from phyblock.report.compare import compare_models
from phyblock.report.compare_view import write_comparison
from phyblock.report.figures import Wanted, write_paper_figures
from phyblock.tables.drawing import Look
from phyblock.tables.text_table import NO_VALUE, number, spread
from tests.report.factory import laws, manifest, record, record_lists, score, write_run

TABLE = TextTable(
    "Precision & recall (%)",
    (Column("Model", is_text=True), Column("Prec", "Level-1"), Column("F1", "Level-1")),
    (("gpt_4o|x", "9.5", "100.0 ± 12.5"), ("[b]*", NO_VALUE, "7.0 ± 0.5")),
    ("100 % of <all>.",),
)


def test_markdown_by_hand() -> None:
    assert to_markdown(TABLE) == (
        "**Precision &amp; recall (%)**\n"
        "\n"
        "| Model      | Level-1 Prec |   Level-1 F1 |\n"
        "| ---------- | -----------: | -----------: |\n"
        "| gpt\\_4o\\|x |          9.5 | 100.0 ± 12.5 |\n"
        "| \\[b\\]\\*    |            \N{EN DASH} |    7.0 ± 0.5 |\n"
        "\n"
        "- 100 % of \\<all\\>.\n"
    )


def test_latex_by_hand() -> None:
    assert to_latex(TABLE, "x").splitlines()[6:-2] == [
        r"\resizebox{\ifdim\width>\linewidth\linewidth\else\width\fi}{!}{%",
        r"\begin{tabular}{@{}lrr@{}}",
        r"\toprule",
        r" & \multicolumn{2}{c}{Level-1} \\",
        r"\cmidrule(lr){2-3}",
        r"Model & \multicolumn{1}{c}{Prec} & \multicolumn{1}{c}{F1} \\",
        r"\midrule",
        r"gpt\_4o\textbar{}x & 9.5 & 100.0 \\[-2pt]",
        r" &  & {\scriptsize$\pm$12.5} \\",
        r"\addlinespace",
        r"{[}b{]}{*} & \textendash{} & 7.0 \\[-2pt]",
        r" &  & {\scriptsize$\pm$0.5} \\",
        r"\bottomrule",
        r"\end{tabular}}",
        r"\par\smallskip\raggedright\footnotesize",
    ]


def test_a_long_latex_table_goes_on_in_further_floats_at_whole_blocks() -> None:
    columns = (Column("Model", is_text=True), Column("n"))
    rows = tuple((f"m{n // 5}" if n % 5 == 0 else "", str(n)) for n in range(105))
    text = to_latex(TextTable("Long", columns, rows), "long")
    floats = text.split(r"\begin{table*}")[1:]
    assert len(floats) == 3
    assert [text.count(r" \\") - 1 for text in floats] == [40, 40, 25]
    assert ["(continued)" in text for text in floats] == [False, True, True]
    assert text.count(r"\label") == 1


cells = st.text(st.characters(min_codepoint=32, max_codepoint=126), min_size=1, max_size=8)


@given(st.lists(st.tuples(cells, cells), max_size=4))
def test_markdown_rows_have_as_many_cells_as_the_table_has_columns(
    rows: list[tuple[str, str]],
) -> None:
    columns = (Column("Model", is_text=True), Column("n"))
    text = to_markdown(TextTable("Any", columns, tuple(rows)))
    lines = [line for line in text.splitlines() if line.startswith("|")]
    assert len(lines) == 2 + len(rows)
    for line in lines:
        assert line.replace("\\\\", "").replace("\\|", "").count("|") == 3


@pytest.mark.parametrize(
    ("shown", "text"),
    [
        (number(float("nan")), NO_VALUE),
        (number(47.06), "47.1"),
        (number(-0.004, 2, signed=True), "0.00"),
        (number(0.06, 2, signed=True), "+0.06"),
        (number(-1, 1, signed=True), "-1.0"),
        (spread(47.06, 1.25), "47.1 ± 1.2"),
        (spread(47.06, float("nan")), "47.1"),
        (spread(float("nan"), float("nan")), NO_VALUE),
    ],
)
def test_numbers_as_they_are_shown(shown: str, text: str) -> None:
    assert shown == text


def records_of(model: str) -> list[dict[str, Any]]:
    return [
        record(
            model,
            scene,
            seed,
            [
                score(seed + 1, 1, 1),
                score(seed + 2, 1, 0, setting="B"),
                score(3, 0, 1, criterion="selection"),
                score(4, 0, 0, criterion="selection", setting="B"),
            ],
        )
        for scene in ("000", "002", "003")
        for seed in (0, 1)
    ]


def test_all_tables_are_written(tmp_path: Path) -> None:
    facts = manifest(models=[("alpha", "GPT-4o"), "beta"])
    written = write_tables(write_run(tmp_path / "run", records_of("alpha"), facts))
    viewed = ["table1", "intervals", "table5", "settings", "errors", "losses", "orders"]
    viewed += ["published", "measures", "coverage", "cost"]
    assert list(written.frames) == ["assembly", *viewed[:8], "estimates", *viewed[8:]]
    assert list(written.views) == viewed
    assert {file.name for file in written.folder.iterdir()} == {
        *(f"{name}.csv" for name in written.frames),
        *(f"{name}.md" for name in viewed),
        *(f"{name}.tex" for name in viewed),
    }
    assert set(written.files) == set(written.folder.iterdir())


def test_only_the_tables_that_the_suite_asks_for_are_written(tmp_path: Path) -> None:
    facts = manifest(models=[("alpha", "GPT-4o")])
    facts["suite"]["tables"] = ["errors"]
    written = write_tables(write_run(tmp_path / "run", [], facts))
    assert {file.stem for file in written.files} == {"errors", "estimates", "coverage", "cost"}


@pytest.mark.parametrize(
    ("asked", "made"), [(["table1"], {"table1", "intervals", "table5"}), ([], set())]
)
def test_tables_asked_for_by_name_are_written_whatever_the_suite_says(
    tmp_path: Path, asked: list[str], made: set[str]
) -> None:
    folder = write_run(tmp_path / "run", [], manifest(models=[("alpha", "GPT-4o")]))
    written = write_tables(folder, asked)
    always = {"estimates", "coverage", "cost"}
    assert set(written.frames) == always | made
    assert {file.stem for file in written.folder.iterdir()} == always | made


def test_csv_files_hold_numbers_and_empty_cells(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run", records_of("alpha"), manifest())
    written = write_tables(folder)
    with (written.folder / "assembly.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(written.frames["assembly"])
    alpha, beta = (
        next(row for row in rows if row["model"] == model and row["level"] == "2")
        for model in ("alpha", "beta")
    )
    assert (alpha["n"], alpha["tp"], alpha["precision"]) == ("2", "3", "0.600000")
    assert (beta["n"], beta["tp"], beta["precision"], beta["f1_sd"]) == ("0", "0", "", "")
    with (written.folder / "table1.csv").open(newline="") as file:
        table1 = {row["model"]: row for row in csv.DictReader(file)}
    assert table1["alpha"]["level2_precision"] == "60.0"
    assert table1["alpha"]["level2_precision_mean"] == "58.3"
    assert table1["alpha"]["level2_precision_sd"] == "11.8"
    assert table1["beta"]["overall_f1"] == ""


def test_table1_says_how_it_was_made(tmp_path: Path) -> None:
    records = [*records_of("alpha"), record("beta", outcome="missing", scores=[score(0, 0, 4)])]
    records[0]["reply"]["seed_sent"] = False
    text = to_markdown(
        write_tables(write_run(tmp_path / "run", records, manifest())).views["table1"]
    )
    assert re.search(r"alpha +\|.* 60.0 \|", text)
    assert "- Values pool the samples of 2 seeds." in text
    assert "- Setting A, matcher optimal, Level 1 by selection;" in text
    assert "- Scored of 10 samples: alpha 6, beta 0." in text
    assert "- alpha: seed unsupported: 2 independent repeats." in text
    assert "only its Random row is as that header says" in text


def test_the_largest_difference_is_said(tmp_path: Path) -> None:
    facts = manifest(models=[("alpha", "GPT-4o")], matchers=["optimal"])
    written = write_tables(write_run(tmp_path / "run", records_of("alpha"), facts))
    largest = written.frames["published"]["difference"].abs().max()
    text = (written.folder / "published.md").read_text("utf-8")
    assert f"Largest absolute difference of 15 cells: {largest:.3f}." in text


@laws
@given(record_lists())
def test_writing_again_changes_nothing(
    tmp_path_factory: pytest.TempPathFactory, records: list[dict[str, Any]]
) -> None:
    folder = write_run(tmp_path_factory.mktemp("runs") / "run", records, manifest())
    first = {file: file.read_bytes() for file in write_tables(folder).files}
    assert {file: file.read_bytes() for file in write_tables(folder).files} == first
    assert {file.name for file in folder.iterdir()} == {
        *("run.yaml", "records.jsonl", "tables", LIST),
    }


def test_a_folder_that_cannot_be_written_is_said_so(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run", [], manifest())
    (folder / "tables").write_text("in the way")
    with pytest.raises(StoreError, match="cannot be written"):
        write_tables(folder)


def test_a_file_that_cannot_be_replaced_leaves_no_rest_behind(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run", [], manifest())
    (folder / "tables" / "assembly.csv" / "in-the-way").mkdir(parents=True)
    with pytest.raises(StoreError, match="cannot be written"):
        write_tables(folder)
    assert [file.name for file in (folder / "tables").iterdir()] == ["assembly.csv"]


def test_a_cut_line_is_said_in_the_coverage(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run", [], manifest())
    (folder / "records.jsonl").write_text(json.dumps(record())[:50])
    view = write_tables(folder).views["coverage"]
    assert "The last line of records.jsonl was cut off and is ignored." in view.notes


LATEX = next(filter(shutil.which, ("pdflatex", "lualatex")), None)


@pytest.mark.skipif(LATEX is None, reason="neither pdflatex nor lualatex is installed")
def test_latex_compiles_inside_any_document(tmp_path: Path) -> None:
    models = [r"all & % $ # _ { } ~ ^ \ < > | \" ` ' -- [x] *", "[first]", "*star", "Ünïcode"]
    folder = write_run(
        tmp_path / "run",
        [one for model in models for one in records_of(model)],
        manifest(models=[(models[0], "GPT-4.1"), *models[1:]]),
    )
    written = write_tables(folder)
    write_comparison(compare_models(load_run(folder)), folder / "tables")
    write_paper_figures(load_run(folder), Wanted(("f1-levels", "forest-full-planning")), Look())
    files = sorted(file.relative_to(folder) for file in folder.glob("*/*.tex"))
    assert {"tables/comparison.tex", "tables/table1.tex", "paper/f1-levels.tex"} <= {
        file.as_posix() for file in files
    }
    inputs = "".join(rf"\input{{{file.with_suffix('')}}}" for file in files)
    for number_of_columns in ("onecolumn", "twocolumn"):
        document = (
            rf"\documentclass[{number_of_columns}]{{article}}"
            rf"\usepackage{{booktabs}}\usepackage{{graphicx}}\graphicspath{{{{paper/}}}}"
            rf"\begin{{document}}"
            rf"{inputs}\end{{document}}"
        )
        (folder / "paper.tex").write_text(document)
        command = [str(LATEX), "-interaction=nonstopmode", "-halt-on-error", "paper.tex"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, errors="replace")
        assert done.returncode == 0, done.stdout
        assert "Overfull" not in done.stdout
        assert "too large" not in done.stdout
    assert written.folder == folder / "tables"
