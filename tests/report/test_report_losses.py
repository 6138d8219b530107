"""Plans as a whole and what became of the goals' blocks, as measures and as a table."""

from __future__ import annotations

from typing import Any

import pytest

from phyblock.scoring.plan import BLOCK_OUTCOMES
from phyblock.tables.load import Run
from phyblock.tracks.estimates import track_estimates
from phyblock.tracks.full_planning_results import BLOCK_NAMES, NAME, losses_frame, losses_view
from tests.report.factory import manifest, record, run_of, score

FACTS: dict[str, Any] = {"seeds": (0,), "settings": ("A",), "matchers": ("optimal",)}


def plan(scene: str, tp: int, fp: int, fn: int, kept: int, **blocks: int) -> dict[str, Any]:
    """A record of a plan, with the blocks lost to each outcome; of level 1 all is chosen."""
    counted = {**dict.fromkeys(BLOCK_OUTCOMES, 0), "placed": tp, **blocks}
    assert sum(counted.values()) == tp + fn
    chosen = score(tp + fn, 0, 0, criterion="selection")
    return record(
        scene=scene, scores=[{**score(tp, fp, fn), "blocks": counted, "kept": kept}, chosen]
    )


PLANS = [
    plan("000", 4, 0, 0, 4),
    plan("001", 1, 2, 3, 2, wrong_kind=1, support_turned=1, order=1),
    plan("002", 0, 0, 4, 0, left_out=4),
    plan("003", 2, 6, 2, 3, support_not_named=1, support_both=1),
]


def values(run: Run, cell: str = "overall") -> dict[str, float]:
    found = track_estimates(run, NAME)
    return dict(found[found["cell"] == cell].set_index("measure")["value"].dropna())


def test_measures_of_whole_plans_are_means_over_plans() -> None:
    run = run_of(PLANS, manifest(**FACTS))
    found = values(run)
    assert found["success"] == 1 / 4
    assert found["macro_f1"] == pytest.approx((1 + 2 / 7 + 0 + 4 / 12) / 4)
    assert found["distance"] == pytest.approx((0 + 3 / 7 + 1 + 6 / 12) / 4)
    assert found["f1"] == pytest.approx(14 / (14 + 8 + 9))
    level1 = values(run, "1")
    assert (level1["success"], level1["macro_f1"]) == (1, 1)
    assert not any(name == "distance" or name.startswith("blocks") for name in level1)


def test_no_plan_has_a_value_of_its_own_where_steps_count_over_again() -> None:
    records = [record(scores=[score(1, 1, 3), score(5, 0, -1, criterion="membership")])]
    run = run_of(records, manifest(**FACTS, level1="membership"))
    assert {"success", "macro_f1"}.isdisjoint(values(run, "1"))
    assert values(run)["success"] == 0


def test_losses_are_shares_of_all_blocks_and_sum_to_all() -> None:
    run = run_of(PLANS, manifest(**FACTS))
    table = losses_frame(run)
    assert list(dict.fromkeys(table["level"])) == ["2", "3", "4", "overall"]
    parts = table[table["outcome"] != "support"]
    assert parts.groupby("level")["value"].sum().tolist() == pytest.approx([100] * 4)
    overall = table[table["level"] == "overall"].set_index("outcome")
    assert list(overall.index) == [*BLOCK_OUTCOMES, "support"]
    assert overall.loc["placed", "value"] == pytest.approx(100 * 7 / 16)
    assert overall.loc["support", "value"] == pytest.approx(100 * 3 / 16)
    assert (overall["lo"] <= overall["value"]).all()
    assert (overall["value"] <= overall["hi"]).all()
    assert (overall["lo"] < overall["hi"]).all()
    view = losses_view(table, run)
    assert [row[:2] for row in view.rows][:2] == [("alpha", "Placed"), ("", "Left out")]
    assert len(view.rows) == len(BLOCK_NAMES)
    assert len(view.notes) == 1


def test_plans_that_an_earlier_version_scored_are_left_out_and_said() -> None:
    old = [record(scene=scene, scores=[score(0, 4, 4)]) for scene in ("000", "001")]
    for line in old:
        line["scores"] = [{**one, "blocks": None, "kept": None} for one in line["scores"]]
    run = run_of([*old, *PLANS[2:]], manifest(**FACTS))
    table = losses_frame(run)
    assert set(table[table["level"] == "overall"]["n"]) == {2}
    assert "2 plans were scored before" in losses_view(table, run).notes[1]
    assert losses_frame(run_of(old, manifest(**FACTS))).empty
