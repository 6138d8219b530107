from __future__ import annotations

import math
from random import Random
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.scoring.counts import Counts, micro
from phyblock.scoring.plan import ERROR_TYPES
from phyblock.tracks.full_planning_results import (
    ASSEMBLY_COLUMNS,
    assembly_frame,
    errors_frame,
    errors_view,
    settings_frame,
    table1_frame,
    table1_view,
)
from tests.report.factory import LEVELS, laws, manifest, record, record_lists, run_of, score

Records = list[dict[str, Any]]


def cell(table: pd.DataFrame, **wanted: str) -> pd.Series:
    keys = {"model": "alpha", "setting": "A", "matcher": "optimal", **wanted}
    mask = np.logical_and.reduce([table[name] == value for name, value in keys.items()])
    assert mask.sum() == 1, f"{mask.sum()} rows for {keys}"
    return table[mask].iloc[0]


@laws
@given(record_lists(), st.sampled_from(["skip", "count"]))
def test_each_cell_is_the_micro_average_of_its_records(records: Records, missing: str) -> None:
    facts = manifest(missing=missing)
    left_out = {"missing", "api_error"} if missing == "skip" else set()
    for row in assembly_frame(run_of(records, facts)).to_dict("records"):
        counts = [
            Counts(one["tp"], one["fp"], one["fn"])
            for kept in records
            if kept["model"] == row["model"] and kept["outcome"] not in left_out
            for one in kept["scores"]
            if row["level"] == "overall" or int(row["level"]) in kept["levels"]
            if one["criterion"] == ("selection" if row["level"] == "1" else "aov")
            if (one["matcher"] or "", one["setting"]) == (row["matcher"], row["setting"])
        ]
        total = micro(counts)
        assert row["n"] == len(counts)
        assert (row["tp"], row["fp"], row["fn"]) == (total.tp, total.fp, total.fn)
        answered = any(
            kept["outcome"] not in ("missing", "api_error")
            for kept in records
            if kept["model"] == row["model"]
            if row["level"] == "overall" or int(row["level"]) in kept["levels"]
        )
        for metric in ("precision", "recall", "f1"):
            wanted = getattr(total, metric) if answered else None
            found = row[metric]
            assert math.isnan(found) if wanted is None else found == pytest.approx(wanted)


@laws
@given(record_lists(), st.randoms())
def test_the_order_of_records_changes_no_table(records: Records, random: Random) -> None:
    shuffled = records.copy()
    random.shuffle(shuffled)
    run, other = run_of(records, manifest()), run_of(shuffled, manifest())
    for frame in (assembly_frame, table1_frame, errors_frame):
        pd.testing.assert_frame_equal(frame(run), frame(other))


@laws
@given(record_lists())
def test_pooling_the_seeds_agrees_with_the_seeds_alone(records: Records) -> None:
    pooled = assembly_frame(run_of(records, manifest()))
    alone = [
        assembly_frame(
            run_of([one for one in records if one["seed"] == seed], manifest(seeds=[seed]))
        )
        for seed in (0, 1)
    ]
    for name in ("n", "expected", "missing", "api_errors", "tp", "fp", "fn"):
        assert (pooled[name] == alone[0][name] + alone[1][name]).all()
    for metric in ("precision", "recall", "f1"):
        values = np.array([one[metric] for one in alone])
        for mean, sd, pair in zip(
            pooled[f"{metric}_mean"], pooled[f"{metric}_sd"], values.T, strict=True
        ):
            known = pair[~np.isnan(pair)]
            assert mean == pytest.approx(known.mean()) if len(known) else math.isnan(mean)
            assert (
                sd == pytest.approx(known.std(ddof=1), abs=1e-12)
                if len(known) > 1
                else math.isnan(sd)
            )


@laws
@given(record_lists())
def test_every_outcome_is_counted_whatever_the_policy(records: Records) -> None:
    for missing in ("skip", "count"):
        table = assembly_frame(run_of(records, manifest(missing=missing)))
        for model in ("alpha", "beta"):
            row = cell(table, model=model, level="overall")
            ends = [one["outcome"] for one in records if one["model"] == model]
            assert row["missing"] == ends.count("missing")
            assert row["api_errors"] == ends.count("api_error")
            assert row["parse_failures"] == ends.count("parse_failure")
            assert row["refusals"] == ends.count("refusal")
            assert row["truncated"] == ends.count("truncated")
            left = row["missing"] + row["api_errors"] if missing == "skip" else 0
            assert row["n"] == len(ends) - left


@laws
@given(record_lists())
def test_rows_and_columns_are_those_of_the_suite(records: Records) -> None:
    facts = manifest(models=["beta", "alpha"], settings=["B", "A"], matchers=["paper", "optimal"])
    table = assembly_frame(run_of(records, facts))
    assert tuple(table.columns) == ASSEMBLY_COLUMNS
    a_setting = [("", "selection", "1")] + [
        (matcher, "aov", level)
        for level in ("2", "3", "4", "overall")
        for matcher in ("paper", "optimal")
    ]
    assert table[["model", "setting", "matcher", "criterion", "level"]].values.tolist() == [
        [model, setting, *rest]
        for model in ("beta", "alpha")
        for setting in "BA"
        for rest in a_setting
    ]


def test_missing_replies_are_left_out_or_count_as_empty_plans() -> None:
    records = [
        record(scene="001", scores=[score(3, 1, 1)]),
        record(scene="002", scores=[score(0, 0, 4)], outcome="missing"),
        record(scene="003", scores=[score(0, 0, 8)], outcome="api_error"),
    ]
    skipped = cell(assembly_frame(run_of(records, manifest())), level="overall")
    assert (skipped["n"], skipped["tp"], skipped["fn"]) == (1, 3, 1)
    assert skipped["recall"] == 0.75
    counted = cell(assembly_frame(run_of(records, manifest(missing="count"))), level="overall")
    assert (counted["n"], counted["tp"], counted["fn"]) == (3, 3, 13)
    assert counted["recall"] == 3 / 16
    for row in (skipped, counted):
        assert (row["missing"], row["api_errors"], row["expected"]) == (1, 1, 10)
        assert row["precision"] == 0.75


@pytest.mark.parametrize("seeds", [[0], [0, 1]])
def test_a_cell_without_any_reply_has_no_value_where_empty_plans_count(seeds: list[int]) -> None:
    records = [
        record(scene="001", seed=seeds[-1], scores=[score(3, 1, 1)]),
        record(scene="002", scores=[score(0, 0, 4)], outcome="missing"),
        *(
            record("beta", scene, scores=[score(0, 0, 4)], outcome="api_error")
            for scene in ("001", "002")
        ),
    ]
    run = run_of(records, manifest(missing="count", seeds=seeds))
    table1 = table1_frame(run)
    values = table1.set_index("model").drop(columns=[c for c in table1 if c.endswith("_sd")])
    assert values.loc["beta"].isna().all()
    assert values.loc["alpha"].filter(like="level3").isna().all()
    assert values.loc["alpha", ["level2_recall", "overall_precision"]].tolist() == [75, 75]
    unanswered = cell(assembly_frame(run), model="beta", level="overall")
    assert (unanswered["n"], unanswered["fn"], unanswered["api_errors"]) == (2, 8, 2)
    notes = table1_view(table1, run).notes
    assert (
        "Counted as empty plans: alpha 1 of 2 (missing replies), beta 2 of 2 (API errors)." in notes
    )
    assert "No value stands where a model has no reply at all." in notes


def test_empty_plans_of_two_kinds_are_counted_apart_and_those_left_out_are_not_said() -> None:
    records = [
        record(scene="000", scores=[score(1, 0, 0)]),
        record(scene="001", scores=[score(0, 0, 4)], outcome="missing"),
        record(scene="001", seed=1, scores=[score(0, 0, 4)], outcome="api_error"),
    ]
    notes = {}
    for missing in ("count", "skip"):
        run = run_of(records, manifest(missing=missing))
        notes[missing] = table1_view(table1_frame(run), run).notes
    said = "Counted as empty plans: alpha 2 of 3 (API errors 1, missing replies 1)."
    assert said in notes["count"]
    assert "No value stands where a model has no reply at all." not in notes["count"]
    assert not any("empty plans:" in note for note in notes["skip"])


def test_what_is_undefined_has_no_value_and_is_not_zero() -> None:
    records = [record(scene="001", scores=[score(0, 0, 4)])]
    table = assembly_frame(run_of(records, manifest()))
    empty_plan = cell(table, level="2")
    assert empty_plan["n"] == 1
    assert math.isnan(empty_plan["precision"])
    assert (empty_plan["recall"], empty_plan["f1"]) == (0, 0)
    nothing = cell(table, level="3")
    assert (nothing["n"], nothing["expected"]) == (0, 2)
    assert all(math.isnan(nothing[metric]) for metric in ("precision", "recall", "f1", "f1_mean"))
    assert nothing["seeds"] == 0


def test_false_negatives_below_zero_stay_as_they_are() -> None:
    records = [record(scores=[score(5, 0, -1, criterion="membership")])]
    row = cell(
        assembly_frame(run_of(records, manifest(level1="membership"))), level="1", matcher=""
    )
    assert (row["criterion"], row["fn"]) == ("membership", -1)
    assert math.isnan(row["recall"])
    assert math.isnan(row["f1"])


def test_a_scene_of_two_levels_counts_once_overall() -> None:
    assert LEVELS["000"] == (1, 2)
    records = [record(scores=[score(2, 1, 2), score(3, 0, 1, criterion="selection")])]
    table = assembly_frame(run_of(records, manifest()))
    assert cell(table, level="1", matcher="")["tp"] == 3
    assert cell(table, level="2")["tp"] == 2
    overall = cell(table, level="overall")
    assert (overall["n"], overall["tp"]) == (1, 2)
    assert overall["expected"] == 10


def test_a_scene_of_level_1_alone_enters_overall_by_its_order() -> None:
    assert LEVELS["004"] == (1,)
    records = [record(scene="004", scores=[score(2, 1, 2), score(3, 0, 1, criterion="selection")])]
    table = assembly_frame(run_of(records, manifest()))
    assert cell(table, level="1", matcher="")["tp"] == 3
    assert cell(table, level="overall")["tp"] == 2


def test_overall_is_by_the_level_1_criterion_where_only_level_1_is_run() -> None:
    records = [record(scores=[score(2, 1, 2), score(3, 0, 1, criterion="selection")])]
    table = assembly_frame(run_of(records, manifest(levels=[1])))
    assert table["level"].unique().tolist() == ["1", "overall"]
    row = cell(table, level="overall", matcher="")
    assert (row["criterion"], row["tp"]) == ("selection", 3)


def test_level_1_by_order_has_a_row_for_each_matcher() -> None:
    records = [record(scores=[score(2, 1, 2), score(1, 2, 3, matcher="paper")])]
    table = assembly_frame(run_of(records, manifest(level1="aov")))
    assert cell(table, level="1")["tp"] == 2
    assert cell(table, level="1", matcher="paper")["tp"] == 1


def test_seeds_that_were_refused_are_said() -> None:
    records = [
        record("alpha", seed=0, seed_sent=True),
        record("alpha", seed=1, seed_sent=False),
        record("beta"),
    ]
    notes = assembly_frame(run_of(records, manifest())).groupby("model")["seed_note"].unique()
    assert notes["alpha"].tolist() == ["seed unsupported: 2 independent repeats"]
    assert notes["beta"].tolist() == [""]


def test_table1_is_the_headline_in_percent() -> None:
    facts = manifest(seeds=[0], models=["beta", "alpha"])
    records = [
        record(
            scene="001",
            scores=[
                score(1, 3, 1),
                score(4, 0, 0, matcher="paper"),
                score(4, 0, 0, setting="B"),
            ],
        )
    ]
    table = table1_frame(run_of(records, facts)).set_index("model")
    assert table.index.tolist() == ["beta", "alpha"]
    assert table.columns.tolist() == [
        f"{level}_{metric}"
        for level in ("level1", "level2", "level3", "level4", "overall")
        for metric in ("precision", "recall", "f1")
    ] + ["overall_f1_lo", "overall_f1_hi"]
    alpha = table.loc["alpha"]
    for level in ("level2", "overall"):
        assert alpha[f"{level}_precision"] == 25
        assert alpha[f"{level}_recall"] == 50
        assert alpha[f"{level}_f1"] == pytest.approx(100 / 3)
    assert table.loc["beta"].isna().all()


def test_table1_of_several_seeds_pools_them_and_has_means_and_deviations_beside() -> None:
    records = [
        record(scene="001", seed=0, scores=[score(1, 1, 0)]),
        record(scene="001", seed=1, scores=[score(3, 1, 0)]),
    ]
    alpha = table1_frame(run_of(records, manifest())).set_index("model").loc["alpha"]
    assert alpha["level2_precision"] == pytest.approx(100 * 4 / 6)
    assert alpha["level2_precision_mean"] == pytest.approx(62.5)
    assert alpha["level2_precision_sd"] == pytest.approx(25 / math.sqrt(2))
    assert alpha["level2_recall_sd"] == 0
    assert math.isnan(alpha["level3_f1_sd"])


@laws
@given(record_lists())
def test_error_types_add_up_to_the_wrong_steps(records: Records) -> None:
    run = run_of(records, manifest())
    errors = errors_frame(run)
    shares = [f"{name}_share" for name in ERROR_TYPES]
    assert (errors[list(ERROR_TYPES)].sum(axis=1) == errors["wrong_steps"]).all()
    wrong = errors["wrong_steps"] > 0
    assert np.allclose(errors.loc[wrong, shares].sum(axis=1), 1)
    assert errors.loc[~wrong, shares].isna().all(axis=None)
    assembly = assembly_frame(run)
    for row in errors.to_dict("records"):
        same = cell(assembly, model=row["model"], level=row["level"])
        assert (row["n"], row["wrong_steps"]) == (same["n"], same["fp"])


def test_error_types_by_hand() -> None:
    records = [
        record(scene="000", scores=[score(1, 4, 0, errors=(1, 0, 2, 1))]),
        record(scene="002", scores=[score(1, 4, 0, errors=(0, 4, 0, 0))]),
        record(scene="003", outcome="missing", scores=[score(0, 0, 4)]),
    ]
    table = errors_frame(run_of(records, manifest())).query("model == 'alpha'").set_index("level")
    assert table.loc["2", list(ERROR_TYPES)].tolist() == [1, 0, 2, 1]
    assert table.loc["overall", list(ERROR_TYPES)].tolist() == [1, 4, 2, 1]
    assert table.loc["overall", "overflow_share"] == 0.5
    assert table.loc["overall", "n"] == 2
    assert table.loc["4", "n"] == 0
    lo, share, hi = table.loc["overall", [f"overflow_{end}" for end in ("lo", "share", "hi")]]
    assert 0 <= lo < share < hi <= 1


@pytest.mark.parametrize(
    ("level1", "levels", "wanted"),
    [
        ("selection", [1, 2], ["2", "overall"]),
        ("aov", [1, 2], ["1", "2", "overall"]),
        ("selection", [1], []),
    ],
)
def test_a_level_that_asks_for_no_order_has_no_types_of_wrong_steps(
    level1: str, levels: list[int], wanted: list[str]
) -> None:
    records = [record(scenes, scores=[score(1, 4, 0)]) for scenes in ("000", "004")]
    run = run_of(records, manifest(models=["alpha"], level1=level1, levels=levels))
    table = errors_frame(run)
    assert table["level"].tolist() == wanted
    (note,) = errors_view(table, run).notes
    assert ("Level 1 asks for no order" in note) == (level1 == "selection")


def test_settings_are_not_compared_where_a_model_has_no_reply() -> None:
    both = [score(2, 1, 1), score(3, 1, 1, setting="B")]
    records = [record("alpha", scene, 0, both) for scene in LEVELS]
    records += [record("beta", scene, 0, both, outcome="api_error") for scene in LEVELS]
    frame = settings_frame(run_of(records, manifest(seeds=[0], missing="count")))
    assert set(frame["model"]) == {"alpha"}
    overall = frame.set_index("level").loc["overall"]
    assert (overall["f1_a"], overall["f1_b"]) == pytest.approx((2 / 3, 3 / 4))
