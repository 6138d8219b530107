"""Figures: drawn from estimates, the same bytes each time, with captions."""

from collections import Counter
from itertools import product

import pytest

from phyblock.results import figures
from phyblock.results.estimates import Headline
from phyblock.results.load import load_run
from tests.web.factory import LEVELS, manifest, record, run_of, score, write_run

TRACK = "full_planning"
MODELS = ("alpha", "beta", "gamma")


def records(n_models=3):
    made = []
    for n, model in enumerate(MODELS[:n_models]):
        for place, scene in enumerate(LEVELS):
            right = (place + n) % 4
            scores = [score(1 + right, n, 3 - right), score(2, n, 1, criterion="selection")]
            made.append(record(model, scene, 0, scores, cost_usd=0.01 * (n + 1)))
    return made


def run_with(n_models=3):
    return run_of(records(n_models), manifest(models=MODELS[:n_models], seeds=[0]))


def test_lines_show_the_headline_shares_fill_a_bar_and_a_forest_has_a_row_a_pair():
    run = run_with()
    values = Headline(run, TRACK).values
    drawn = figures.levels(run, track=TRACK)
    for line in drawn.axes[0].lines:
        wanted = [values[str(line.get_label()), f"Level {n}"].value for n in (1, 2, 3, 4)]
        assert list(line.get_ydata()) == pytest.approx(wanted)
    drawn = figures.cost(run, track=TRACK)
    points = {round(line.get_xdata()[0], 6): line.get_ydata()[0] for line in drawn.axes[0].lines}
    assert points == pytest.approx(
        {n + 1.0: values[model, "Overall F1"].value for n, model in enumerate(MODELS)}
    )
    for table in ("errors", "losses"):
        drawn = figures.shares(run, track=TRACK, table=table)
        widths = Counter()
        for bar in drawn.axes[0].patches:
            widths[round(bar.get_y(), 3)] += bar.get_width()
        assert [*widths.values()] == pytest.approx([100] * len(widths))
    # Of two models a row a part.
    for n, rows in ((3, 3), (2, 5)):
        assert len(figures.forest(run_with(n), track=TRACK).axes[0].get_yticks()) == rows
    assert figures.forest(run_with(1), track=TRACK) is None


def test_a_run_without_an_answer_draws_nothing_and_does_not_fail(tmp_path):
    failed = [record(*one, outcome="api_error") for one in product(MODELS, LEVELS)]
    write_run(tmp_path, failed, manifest(models=MODELS, seeds=[0]))
    assert figures.write_paper_figures(load_run(tmp_path)) == ()


def test_files_are_the_same_each_time_in_three_formats_with_captions(tmp_path):
    folder = write_run(tmp_path / "run", records(), manifest(models=MODELS, seeds=[0]))
    run = load_run(folder)
    first = {file: file.read_bytes() for file in figures.write_paper_figures(run)}
    assert {file.stem for file in first} == {
        *("levels-full-planning", "errors", "losses", "cost-full-planning", "forest-full-planning")
    }
    again = figures.write_paper_figures(run, ["levels-full-planning", "errors"])
    assert len(again) == 8
    assert all(file.read_bytes() == first[file] for file in again)
    assert {file.stem for file in first} <= set(figures.figures_of(run))
    assert not any(b"mathdefault" in data for file, data in first.items() if file.suffix == ".svg")
    files = figures.write_paper_figures(run, ["errors"], width_in=figures.COLUMN_IN, titled=False)
    assert sorted(file.suffix for file in files) == [".pdf", ".png", ".svg", ".txt"]
    caption = (folder / "paper" / "errors.txt").read_text("utf-8")
    assert caption.startswith("Wrong steps by type.")
    assert "Wrong steps" not in (folder / "paper" / "errors.svg").read_text("utf-8")
