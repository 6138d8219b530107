"""Comparisons of models and runs, and the effect of the presentation."""

from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given

from phyblock.config.suite import VarySpec
from phyblock.errors import SpecError
from phyblock.results.compare import compare, sensitivity_frame, sensitivity_table
from phyblock.results.figures import sensitivity
from phyblock.results.text import number
from tests.web.factory import LEVELS, laws, manifest, record, record_lists, run_of, score


def plans(model, right):
    """Plans of four steps of which `right[scene]` place a block; goals have four blocks."""
    return [record(model, scene, 0, [score(tp, 4 - tp, 4 - tp)]) for scene, tp in right.items()]


ONE_WAY = {"seeds": [0], "settings": ["A"], "matchers": ["optimal"]}


def one_seed(*records, **facts):
    return run_of(records, manifest(**ONE_WAY | facts))


def overall(*runs, **about):
    """Return what a comparison says of all parts together."""
    return compare(*runs, **about).table.set_index("part").loc["overall"]


@laws
@given(record_lists())
def test_turning_a_pair_round_turns_all_that_it_says_round(records):
    run = run_of(records, manifest())
    one, other = (
        compare(run, models=names).table for names in (["alpha", "beta"], ["beta", "alpha"])
    )
    assert (one["better"] == other["worse"]).all()
    for name, sign in (("difference", -1), ("se", 1), ("p_holm", 1), ("n_samples", 1)):
        pd.testing.assert_series_equal(one[name], sign * other[name], check_names=False)
    pd.testing.assert_series_equal(one["lo"], -other["hi"], check_names=False)
    # No two shares are further apart than 100 points, of however few scenes.
    bounded = one[["lo", "hi", "detectable_holm"]]
    assert not (bounded.abs() > 100).any(axis=None)


def test_only_samples_that_both_have_are_compared():
    run = one_seed(
        *plans("alpha", {"000": 4, "001": 2, "002": 0}),
        *plans("beta", {"001": 4, "002": 0, "003": 4}),
        record("beta", "000", outcome="missing", scores=[score(0, 0, 4)]),
    )
    wanted = {"n_samples": 2, "n_scenes": 2, "n_clusters": 2, "better": 0, "worse": 1, "same": 1}
    wanted |= {"value_a": 25, "value_b": 50, "difference": -25}
    assert overall(run)[[*wanted]].to_dict() == wanted


def test_a_model_without_any_reply_is_not_compared_though_empty_plans_count():
    silent = [
        record("beta", scene, outcome="api_error", scores=[score(0, 0, 4)]) for scene in LEVELS
    ]
    run = one_seed(*plans("alpha", dict.fromkeys(LEVELS, 3)), *silent, missing="count")
    assert set(compare(run).table["verdict"]) == {"nothing to compare"}
    some = record("beta", "000", scores=[score(3, 1, 1)])
    run = one_seed(*plans("alpha", dict.fromkeys(LEVELS, 3)), some, *silent[1:], missing="count")
    assert overall(run)[["n_samples", "better", "same"]].tolist() == [5, 4, 1]


def test_what_cannot_be_told_is_said():
    for n, verdict in ((12, "cannot tell"), (4, "too few base scenes to tell")):
        right = {f"{scene:03}": 1 + scene % 3 for scene in range(n)}
        other = {scene: 4 - tp for scene, tp in right.items()}
        size = {"scenes_by_level": {2: n}, "scenes": n, "levels": [2]}
        run = one_seed(*plans("alpha", right), *plans("beta", other), **size)
        assert overall(run)["verdict"] == verdict


def test_a_gap_is_found_among_many_models_and_ranks_say_what_is_sure():
    scenes = [f"{n:03}" for n in range(60)]
    draw = np.random.default_rng(7)
    strength = {"best": 0.75, **{f"model-{n:02}": 0.5 for n in range(25)}}
    records = [
        one
        for model, share in strength.items()
        for one in plans(model, {scene: int(draw.binomial(4, share)) for scene in scenes})
    ]
    size = {"scenes_by_level": {2: 60}, "items": {"full_planning": 60}, "scenes": 60}
    found = compare(one_seed(*records, models=list(strength), levels=[2], **size))
    assert len(found.table) == 26 * 25 // 2
    against_best = found.table[found.table["a"] == "best"]
    assert (against_best["verdict"] == "best is better").all()
    ranks = found.ranks.set_index("model")
    assert tuple(ranks.loc["best", ["best", "worst"]]) == (1, 1)
    assert (ranks.loc[ranks.index != "best", "best"] > 1).all()


def test_two_runs_are_compared_by_the_models_they_share_or_by_two_named():
    first = one_seed(*plans("alpha", {"000": 4, "001": 2}), models=["alpha"])
    records = [*plans("alpha", {"000": 1, "001": 1}), *plans("beta", {"000": 4, "001": 4})]
    second = replace(run_of(records, manifest(seeds=[0])), path=Path("other"))
    shared = overall(first, second)[["a", "b", "difference"]].tolist()
    assert shared == ["alpha (run)", "alpha (other)", 50]
    assert overall(first, second, models=["alpha", "beta"])["difference"] == -25
    with pytest.raises(SpecError, match="has no such model"):
        compare(first, second, ["beta", "alpha"])


@pytest.mark.parametrize(
    ("other", "said"),
    [
        (one_seed(record("alpha", "000") | {"n_blocks": 9}), "blocks of scene 000"),
        (one_seed(matchers=["paper"]), r"scoring\.matchers: cannot be compared with run"),
        (one_seed(level1="membership"), r"scoring\.level1: cannot be compared with run"),
        (one_seed(models=["beta"]), "no model in common"),
        (one_seed(suite={"tracks": ["vqa"]}), "no track in common"),
    ],
)
def test_runs_that_cannot_be_compared_are_refused(other, said):
    first = one_seed(*plans("alpha", {"000": 4}), models=["alpha"])
    with pytest.raises(SpecError, match=said):
        compare(first, other)
    with pytest.raises(SpecError, match=r"found: vqa(?s:.*)allowed: full_planning"):
        compare(run_of([], manifest()), track="vqa")
    with pytest.raises(SpecError, match="needs two models"):
        compare(first)


def test_the_first_runs_policy_on_missing_replies_holds_for_both():
    def of(missing, failed):
        lost = record("alpha", failed, outcome="missing", scores=[score(0, 0, 4)])
        right = {scene: 4 for scene in ("000", "001", "002") if scene != failed}
        return one_seed(*plans("alpha", right), lost, models=["alpha"], missing=missing)

    for missing, samples in (("skip", 1), ("count", 3)):
        other = of("count" if missing == "skip" else "skip", "001")
        row = overall(of(missing, "000"), other)
        assert (row["n_samples"], row["difference"]) == (samples, 0)


VARY = {"background": ["lawn", "white"], "view": ["oblique", "front", "top"]}
ITEMS = 12
ASKED = {"alpha": ITEMS, "beta": ITEMS, "gamma": ITEMS}


def test_what_two_runs_asked_differently_is_named():
    def asked(**images):
        suite = {"images": {"size_px": 512, **images}, "name": f"n{len(images)}"}
        return one_seed(*plans("alpha", {"000": 4, "001": 2}), suite=suite)

    assert "differ" not in compare(asked(), asked()).how
    how = compare(asked(), asked(size_px=256)).how
    assert "The runs differ in images.size_px (512, 256)." in how


def varied(models):
    """Return a run of the first so many scenes of each model in every way, of others in one way."""
    told = manifest(**ONE_WAY | {"seeds": (0, 1)}, models=models, levels=(2,), suite={"vary": VARY})
    rng, records, variants = np.random.default_rng(3), [], VarySpec(**VARY).variants
    for model, place, seed, variant in product(models, range(ITEMS), (0, 1), variants):
        if place < models[model] or variant is variants[0]:
            tp, fp = int(rng.integers(0, 5)), int(rng.integers(0, 4))
            one = record(model, f"s{place:02}", seed, [score(tp, fp, 4 - tp)])
            one["variant"] = dict(variant.levels)
            one["sample"] += f"/{variant.key}" if variant.key else ""
            records.append(one)
    return run_of(records, told)


def test_the_figure_and_the_table_show_the_same_components():
    run = varied(ASKED)
    table = sensitivity_frame(run).set_index(["factor", "model"])
    figure = sensitivity(run, track="full_planning")
    models = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    for ax, factor in zip(figure.axes, VARY, strict=True):
        (line,) = ax.lines
        drawn = dict(zip(models, line.get_xdata(), strict=True))
        assert drawn == pytest.approx({m: table.loc[(factor, m), "shift"] for m in models})
    for row in sensitivity_table(run).rows:
        assert row[2] == number(table.loc[(row[1], row[0]), "shift"])


def test_a_model_that_was_barely_asked_changes_nothing_of_others():
    run, alone = varied({**ASKED, "barely": 2}), varied(ASKED)
    table = sensitivity_frame(run)
    pd.testing.assert_frame_equal(table[table["model"] != "barely"], sensitivity_frame(alone))
    assert set(table.loc[table["model"] == "barely", "n_items"]) == {2}
