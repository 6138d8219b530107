from __future__ import annotations

import csv
from collections import defaultdict
from typing import Any

import pytest

from phyblock.data.official import match_published
from phyblock.results.paper import beside_paper, published_frame
from tests.results.test_estimates import answered, episode
from tests.web.factory import manifest, record, run_of, score


@pytest.mark.parametrize(
    ("levels", "has_overall"),
    [([1, 2], False), ([3], False), ([1, 3, 4], False), ([2, 3, 4], True), ([1, 2, 3, 4], True)],
)
def test_overall_is_compared_where_the_paper_s_levels_were_run(levels, has_overall):
    facts = manifest(models=[("mine", "GPT-4o")], seeds=[0], levels=levels)
    records = [
        record("mine", scene, scores=[score(1, 1, 3, matcher="paper")])
        for scene in ("001", "002", "003")
    ]
    table = published_frame(run_of(records, facts), 1)
    overall = table[table["cell"] == "overall"]
    assert overall["ours"].notna().all() == has_overall


def test_ours_stands_beside_the_published_number_of_the_same_cell():
    facts = manifest(models=[("mine", "GPT-4o"), ("seeded", "GPT-4.1")], seeds=[0, 1])
    plans = [record("seeded", scene, seed, [score(2 + seed, 1, 1)])
             for scene in ("000", "001") for seed in (0, 1)]  # fmt: skip
    five = published_frame(run_of(plans, facts), 5).set_index(["model", "cell", "metric"])
    f1 = [100 * 2 * tp / (2 * tp + 2) for tp in (2, 3)]
    assert five.loc[("seeded", "2", "f1_mean"), "ours"] == pytest.approx(sum(f1) / 2)
    assert five.loc[("seeded", "2", "f1_mean"), "published"] == 46.26
    assert five.loc[("seeded", "2", "f1_sd"), "ours"] == pytest.approx((f1[1] - f1[0]) / 2**0.5)
    facts = manifest(models=[("alpha", "GPT-4o")], seeds=[0])
    facts["suite"]["tracks"] = ["step_planning"]
    played = run_of([episode("alpha", "001", "pod", "done")], facts)
    three = published_frame(played, 3).set_index("model").loc["alpha"]
    assert (three["published"], three["ours"], three["difference"]) == (13.0, 25.0, 12.0)
    facts["suite"]["tracks"] = ["vqa"]
    asked = run_of([answered("SH", 0, "A"), answered("SH", 1, "B")], facts)
    two = published_frame(asked, 2).set_index("cell")
    assert (two.loc["SH", "published"], two.loc["SH", "ours"]) == (82.0, 50)
    # A mean over a part of what the paper averages is not the same number.
    assert two.loc[["object_property", "overall"], "ours"].isna().all()


def test_the_published_numbers_come_out_of_the_official_counts(official_dir):
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
    table = published_frame(run_of(records, facts), 1)
    with_row = [model for model in models if match_published(model)]
    assert len(table) == 15 * len(with_row) >= 15 * 7
    assert table["difference"].abs().max() <= 0.065
    assert (table["difference"].abs() > 0.06).sum() <= 1


def test_each_published_model_has_15_cells():
    facts = manifest(models=[("mine", "GPT-4o"), "other"], seeds=[0])
    scores = [score(1, 1, 3), score(1, 3, 1, matcher="paper")]
    run = run_of([record("mine", "001", scores=scores)], facts)
    table = published_frame(run, 1)
    assert table[["model", "published_name"]].drop_duplicates().values.tolist() == [
        ["mine", "GPT-4o"]
    ]
    assert sorted(table["cell"].unique()) == LEVELS
    assert len(table) == 15
    assert table["published"].notna().all()
    by_cell = table.set_index(["cell", "metric"])
    cell = by_cell.loc[("2", "precision")]
    assert (cell["published"], cell["ours"]) == (50.2, 25)
    assert cell["difference"] == pytest.approx(-25.2)
    assert by_cell.loc["3", "ours"].isna().all()
    assert by_cell.loc["3", "n"].tolist() == [0, 0, 0]
    assert beside_paper(run, 1) is None  # of other scenes than the paper's
    facts["suite"]["dataset"] = {"format": "official", "path": "checkout"}
    beside = beside_paper(run_of([record("mine", "001", scores=scores)], facts), 1)
    assert beside is not None
    assert len(beside.rows) == 3
    assert beside.notes[0] == "Largest absolute difference of 6 cells: 25.200."


LEVELS = ["1", "2", "3", "4", "overall"]
