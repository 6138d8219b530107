from __future__ import annotations

import csv
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from phyblock.data.published_names import PUBLISHED_NAMES, match_published
from phyblock.report import NO_VALUE, published_table
from phyblock.tracks.full_planning_results import (
    comparison_notes,
    largest_differences,
    published_frame,
    published_view,
)
from tests.report.factory import manifest, record, run_of, score

LEVELS = ["1", "2", "3", "4", "overall"]


def test_the_published_table_1_is_whole_and_consistent() -> None:
    table = published_table(1)
    assert table["model"].unique().tolist() == list(PUBLISHED_NAMES)
    assert len(table) == 21 * 5 * 3
    wide = table.pivot(index=["model", "level"], columns="metric", values="value")
    harmonic = 2 * wide["precision"] * wide["recall"] / (wide["precision"] + wide["recall"])
    off = (harmonic - wide["f1"]).abs()
    assert off.median() < 0.1
    # Level-1 of LLaVa-OneVision-7B and few others are rounded twice in print.
    assert off.max() < 0.6


def test_only_the_random_row_was_printed_as_its_header_says() -> None:
    table = published_table(1).set_index(["model", "level", "metric"])["value"]
    assert table["GPT-4o", "1", "precision"] == 69.7
    assert table["GPT-4o", "1", "recall"] == 67.5
    assert table["Random", "overall", "recall"] == 6.1
    assert table["Random", "overall", "precision"] == 15.8


@pytest.mark.parametrize(("number", "rows"), [(2, 14 * 21), (3, 4 * 3), (5, 3 * 10)])
def test_the_other_published_tables_are_whole(number: int, rows: int) -> None:
    table = published_table(number)
    assert len(table) == rows
    assert table["value"].between(0, 100).all()


def test_published_macro_averages_are_means_of_their_subtasks() -> None:
    table = published_table(2)
    parts = table[table["subtask"] != "average"].groupby(["model", "category"])["value"].mean()
    printed = table[(table["subtask"] == "average") & (table["category"] != "overall")]
    printed = printed.set_index(["model", "category"])["value"]
    assert (parts - printed).abs().max() < 0.16


def test_each_published_model_has_15_cells() -> None:
    facts = manifest(models=[("mine", "GPT-4o"), "other"], seeds=[0])
    scores = [score(1, 1, 3), score(1, 3, 1, matcher="paper")]
    table = published_frame(run_of([record("mine", "001", scores=scores)], facts))
    assert table[["model", "published_name"]].drop_duplicates().values.tolist() == [
        ["mine", "GPT-4o"]
    ]
    assert table["level"].tolist() == [level for level in LEVELS for _ in range(3)]
    assert table["published"].notna().all()
    by_cell = table.set_index(["level", "metric"])
    cell = by_cell.loc[("2", "precision")]
    assert (cell["published"], cell["ours"], cell["matcher"]) == (50.2, 25, "paper")
    assert cell["difference"] == pytest.approx(-25.2)
    assert by_cell.loc["3", "ours"].isna().all()
    assert by_cell.loc["3", "n"].tolist() == [0, 0, 0]
    largest = largest_differences(table)
    assert largest.to_dict() == {"mine": pytest.approx(25.2)}


def test_the_headline_matcher_is_compared_where_the_paper_s_was_not_run() -> None:
    facts = manifest(models=[("mine", "GPT-4o")], matchers=["optimal"])
    table = published_frame(run_of([], facts))
    assert set(table.query("level != '1'")["matcher"]) == {"optimal"}
    assert np.isnan(largest_differences(table)["mine"])


def test_setting_a_is_compared_whatever_the_headline() -> None:
    scores = [score(1, 1, 3, matcher="paper"), score(4, 0, 0, matcher="paper", setting="B")]
    records = [record("mine", "001", scores=scores)]
    for settings, wanted in ((["B", "A"], 50), (["A", "B"], 50), (["B"], None)):
        facts = manifest(models=[("mine", "GPT-4o")], seeds=[0], settings=settings)
        table = published_frame(run_of(records, facts)).set_index(["level", "metric"])
        assert len(table) == 15
        if wanted is None:
            assert table["ours"].isna().all()
            assert table["difference"].isna().all()
            assert (table["n"] == 0).all()
        else:
            assert table.loc[("2", "precision"), "ours"] == wanted


@pytest.mark.parametrize(
    ("levels", "has_overall"),
    [([1, 2], False), ([3], False), ([1, 3, 4], False), ([2, 3, 4], True), ([1, 2, 3, 4], True)],
)
def test_overall_is_compared_where_the_paper_s_levels_were_run(
    levels: list[int], has_overall: bool
) -> None:
    facts = manifest(models=[("mine", "GPT-4o")], seeds=[0], levels=levels)
    records = [
        record("mine", scene, scores=[score(1, 1, 3, matcher="paper")])
        for scene in ("001", "002", "003")
    ]
    run = run_of(records, facts)
    table = published_frame(run)
    overall = table[table["level"] == "overall"]
    assert overall["ours"].notna().all() == has_overall
    note = "Overall is not compared: the paper's pools the levels 2, 3 and 4."
    assert (note in published_view(table, run).notes) != has_overall


def test_models_without_a_published_row_are_listed() -> None:
    facts = manifest(
        models=[("mine", "GPT-4o"), ("gpt-4.1", "GPT-4.1"), "my-claude"],
        settings=["B"],
    )
    run = run_of([], facts)
    table = published_frame(run)
    assert table["model"].unique().tolist() == ["mine"]
    view = published_view(table, run)
    assert len(view.rows) == 3
    assert view.notes[:3] == comparison_notes(table, run.design)
    assert view.notes[:3] == (
        f"Largest absolute difference of 0 cells: {NO_VALUE}.",
        "No published row: gpt-4.1, my-claude.",
        "The paper's setting, A, was not run.",
    )


def test_a_run_without_published_models_has_nothing_to_compare() -> None:
    run = run_of([record()], manifest())
    table = published_frame(run)
    assert table.empty
    assert largest_differences(table).empty
    assert comparison_notes(table, run.design)[1] == "No published row: alpha, beta."
    assert published_view(table, run).rows == ()


def test_the_published_numbers_come_out_of_the_official_counts(official_dir: Path) -> None:
    scenes: dict[tuple[str, str], list[dict[str, Any]]] = defaultdict(list)
    levels: dict[str, set[int]] = defaultdict(set)
    with (official_dir / "expected" / "assembly_counts.csv").open(newline="") as file:
        for row in csv.DictReader(file):
            counts = (int(row[name]) for name in ("tp", "fp", "fn"))
            scenes[row["model"], row["scene"]].append(
                score(*counts, criterion=row["criterion"], matcher="paper", setting=row["setting"])
            )
            levels[row["scene"]].add(int(row["level"]))
    records = [
        record(model, scene, 0, scores) | {"levels": sorted(levels[scene])}
        for (model, scene), scores in scenes.items()
    ]
    models = sorted({model for model, _ in scenes})
    facts = manifest(
        models=[(model, str(match_published(model))) for model in models],
        seeds=[0],
        matchers=["paper"],
        level1="membership",
    )
    table = published_frame(run_of(records, facts))
    with_row = [model for model in models if match_published(model)]
    assert len(table) == 15 * len(with_row) >= 15 * 7
    assert largest_differences(table).max() <= 0.06
