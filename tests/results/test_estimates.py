"""What a run is loaded as, and estimates of every track: laws, and numbers counted by hand."""

import json
import math
from collections import defaultdict

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.data.official import match_published
from phyblock.domain.question import CATEGORIES, SUBTASKS
from phyblock.results.load import load_run
from phyblock.results.tables import beside_paper, published_frame
from phyblock.scoring.plan import Counts
from tests.web.factory import asked, laws, manifest, record, record_lists, run_of, score, write_run
from tests.workspace import csv_rows


@laws
@given(record_lists(), st.randoms())
def test_the_order_of_records_changes_nothing(records, random):
    shuffled = records.copy()
    random.shuffle(shuffled)
    left, right = (run_of(one, manifest()) for one in (records, shuffled))
    pd.testing.assert_frame_equal(left.records, right.records)
    pd.testing.assert_frame_equal(left.estimates, right.estimates)


@laws
@given(record_lists())
def test_columns_and_types_do_not_depend_on_the_records(records):
    some, none = (run_of(one, manifest()).records.dtypes for one in (records, []))
    pd.testing.assert_series_equal(some, none)


@laws
@given(st.data())
def test_a_cut_last_line_is_passed_over_and_counted(tmp_path_factory, data):
    folder = write_run(tmp_path_factory.mktemp("runs") / "run", [record()], manifest())
    line = json.dumps(record("beta"))
    kept = data.draw(st.integers(1, len(line) - 1))
    with (folder / "records.jsonl").open("a", encoding="utf-8") as file:
        file.write(line[:kept])
    run = load_run(folder)
    assert run.records["model"].tolist() == ["alpha"]
    assert run.is_cut


def value(run, measure, cell="overall", model="alpha", **way):
    """Return the one value of a measure; in setting A by the optimal matcher."""
    wanted = {"setting": ["", "A"], "matcher": ["", "optimal"], "measure": [measure]}
    wanted |= {name: [one] for name, one in {"cell": cell, "model": model, **way}.items()}
    frame = run.estimates[run.estimates[[*wanted]].isin(wanted).all(axis=1)]
    assert len(frame) <= 1
    return float(frame["value"].sum(min_count=1))


@laws
@given(record_lists(), st.sampled_from(["skip", "count"]))
def test_each_value_of_plans_is_the_micro_average_of_its_records(records, missing):
    left_out = {"missing", "api_error"} if missing == "skip" else set()
    frame = run_of(records, manifest(missing=missing)).estimates
    frame = frame[frame["measure"].isin(["precision", "recall", "f1"])]
    for row in frame.to_dict("records"):
        mine = [
            one
            for one in records
            if one["model"] == row["model"] and one["outcome"] not in left_out
            if row["cell"] == "overall" or int(row["cell"]) in one["levels"]
        ]
        counts = [
            Counts(one["tp"], one["fp"], one["fn"])
            for kept in mine
            for one in kept["scores"]
            if one["criterion"] == ("selection" if row["cell"] == "1" else "aov")
            if (one["matcher"] or "", one["setting"]) == (row["matcher"], row["setting"])
        ]
        assert row["n"] == len(counts)
        answered = any(one["outcome"] not in ("missing", "api_error") for one in mine)
        all_of = sum(counts, Counts())
        others = {"precision": all_of.fp, "recall": all_of.fn, "f1": (all_of.fp + all_of.fn) / 2}
        whole = all_of.tp + others[row["measure"]]
        wanted = all_of.tp / whole if answered and whole else None
        assert math.isnan(row["value"]) if wanted is None else row["value"] == pytest.approx(wanted)


@laws
@given(record_lists())
def test_seeds_alone_give_mean_and_deviation(records):
    keys = ["measure", "model", "setting", "matcher", "criterion", "cell"]
    pooled = run_of(records, manifest()).estimates.set_index(keys)
    alone = []
    for seed in (0, 1):
        mine = [one for one in records if one["seed"] == seed]
        frame = run_of(mine, manifest(seeds=[seed])).estimates
        alone.append(frame.set_index(keys)["value"].reindex(pooled.index).astype("float64"))
    values = pd.concat(alone, axis=1)
    assert (pooled["seeds"] == values.count(axis=1)).all()
    for name, wanted in (("mean", values.mean(axis=1)), ("sd", values.std(axis=1))):
        found = pooled[name].astype("float64")
        np.testing.assert_allclose(found, wanted, rtol=1e-6, atol=1e-12, equal_nan=True)


@laws
@given(record_lists())
def test_shares_of_wrong_steps_and_of_blocks_add_up_to_one(records):
    frame = run_of(records, manifest()).estimates
    ways = ["model", "setting", "matcher", "criterion", "cell"]
    for prefix, left_out in (("wrong_", ""), ("blocks_", "blocks_support")):
        shares = frame[frame["measure"].str.startswith(prefix) & (frame["measure"] != left_out)]
        sums = shares.dropna(subset=["value"]).groupby(ways)["value"].sum()
        assert np.allclose(sums, 1)


def test_level_1_alone_is_overall_and_a_criterion_without_a_single_plan_has_no_value():
    one = record(scene="004", scores=[score(2, 1, 2), score(3, 0, 1, criterion="selection")])
    assert value(run_of([one], manifest()), "recall") == 0.5
    assert value(run_of([one], manifest(levels=[1])), "recall") == 0.75
    membership = record(scores=[score(5, 0, -1, criterion="membership")])
    assert math.isnan(value(run_of([membership], manifest(level1="membership")), "f1", "1"))


def questions(right):
    """Return a run of four answers of every subtask that is named, so many of them right."""
    tracks = {"vqa": {"by_subtask": dict.fromkeys(SUBTASKS, 4)}}
    suite = {"tracks": ["vqa"], "vqa": {}}
    facts = manifest(seeds=(0,), missing="count", suite=suite, tracks=tracks)
    wanted = [(subtask, number) for subtask in right for number in range(4)]
    return run_of([asked(n, s, "A" if n < right[s] else "B") for s, n in wanted], facts)


RIGHT = {subtask: st.integers(0, 4) for subtask in SUBTASKS}


@given(st.fixed_dictionaries(RIGHT) | st.fixed_dictionaries({}, optional=RIGHT))
@laws
def test_averages_of_questions_are_unweighted_means_of_parts_that_were_all_answered(right):
    run, means = questions(right), []
    for category, subtasks in CATEGORIES.items():
        parts = [right[name] / 4 if name in right else math.nan for name in subtasks]
        means.append(np.mean(parts))
        for name, wanted in zip((*subtasks, category), (*parts, means[-1]), strict=True):
            assert value(run, "accuracy", name) == pytest.approx(wanted, nan_ok=True)
    assert value(run, "accuracy") == pytest.approx(np.mean(means), nan_ok=True)


def episode(model, scene, outcomes, ending):
    """Return an episode of a goal of four blocks; p is placed, o overflow, ? unread, d done."""
    names = {"p": "placed", "o": "overflow", "?": "no_move", "d": "done", "i": "invalid"}
    right, tried = outcomes.count("p"), sum(letter in "poi" for letter in outcomes)
    scores = [
        {"criterion": kind, "setting": setting, "matcher": None, "errors": None,
         "tp": right, "fp": fp, "fn": 4 - right}
        for setting in "AB"
        for kind, fp in (("placed", 0), ("attempted", tried - right))
    ]  # fmt: skip
    made = record(model, scene, 0, scores) | {"track": "step_planning", "ending": ending}
    made["sample"] = f"step_planning/{model}/{scene}/s0"
    return {**made, "outcomes": [names[letter] for letter in outcomes]}


def episodes():
    ended = [("alpha", "001", "pppop", "completed"), ("alpha", "002", "ppd", "done")]
    ended.append(("beta", "001", "o?oi?", "max_failures"))
    suite = {"tracks": ["step_planning"]}
    facts = manifest(items={"step_planning": 2}, seeds=[0], suite=suite)
    return run_of([episode(*one) for one in ended], facts)


def test_episodes_by_hand():
    run = episodes()
    wanted = {"completion": 0.5, "ended_done": 0.5, "detour": 1.25, "steps": 4}
    wanted |= {"step_placed": 0.75, "step_overflow": 0.125, "step_done": 0.125}
    assert {name: value(run, name) for name in wanted} == wanted
    wanted = {"step_unread": 0.4, "ended_max_failures": 1, "detour": math.nan}
    beta = {name: value(run, name, model="beta") for name in wanted}
    assert beta == pytest.approx(wanted, nan_ok=True)
    assert value(run, "precision", criterion="placed") == 1
    assert value(run, "precision", criterion="attempted") == pytest.approx(6 / 7)
    assert value(run, "recall", criterion="placed") == 0.75


def test_the_published_numbers_come_out_of_the_official_counts(official_dir):
    scenes, levels = defaultdict(list), defaultdict(set)
    for row in csv_rows(official_dir / "expected" / "assembly_counts.csv"):
        counts = (int(row[name]) for name in ("tp", "fp", "fn"))
        scenes[row["model"], row["scene"]].append(
            score(*counts, criterion=row["criterion"], matcher="paper", setting=row["setting"])
        )
        levels[row["scene"]].add(int(row["level"]))
    records = [
        record(model, scene, 0, scores) | {"levels": sorted(levels[scene])}
        for (model, scene), scores in scenes.items()
    ]
    rows = {model: match_published(model) for model, _ in scenes}
    models = [(model, str(row)) for model, row in sorted(rows.items())]
    facts = manifest(models=models, seeds=[0], matchers=["paper"], level1="membership")
    table = published_frame(run_of(records, facts))
    assert len(table) == 15 * sum(row is not None for row in rows.values()) >= 15 * 7
    assert table["difference"].abs().max() <= 0.065
    assert (table["difference"].abs() > 0.06).sum() <= 1


def test_each_published_model_has_15_cells_and_overall_where_its_levels_were_run():
    suite = {"dataset": {"format": "official", "path": "checkout"}}
    facts = manifest(models=[("mine", "GPT-4o"), "other"], seeds=[0], suite=suite)
    scores = [score(1, 1, 3), score(1, 3, 1, matcher="paper")]
    run = run_of([record("mine", "001", scores=scores)], facts)
    table = published_frame(run)
    assert set(zip(table["model"], table["published_name"], strict=True)) == {("mine", "GPT-4o")}
    assert len(table) == table["published"].notna().sum() == 15
    assert len(beside_paper(run).rows) == 3
    for levels, has_overall in (([1, 3, 4], False), ([2, 3, 4], True)):
        of_levels = manifest(models=[("mine", "GPT-4o")], seeds=[0], levels=levels)
        records = [record("mine", one, scores=scores) for one in ("001", "002", "003")]
        overall = published_frame(run_of(records, of_levels)).set_index("cell").loc["overall"]
        assert overall["ours"].notna().all() == has_overall
