"""Tables of what the way of asking changes: each model by the items that it has, and no other."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from urllib.parse import parse_qs

import numpy as np
import pandas as pd
import pytest

from phyblock.config.suite import VarySpec
from phyblock.report import Run
from phyblock.report.compare import compare_models
from phyblock.report.compare_view import flipped_lines
from phyblock.report.figures.sensitivity import moved_dots
from phyblock.report.html.leads import table_leads
from phyblock.report.sensitivity import (
    components_frame,
    levels_frame,
    pairs_frame,
    ranks_frame,
)
from phyblock.report.sensitivity_view import components_view, levels_view, ranks_view
from phyblock.tables.text_table import NO_VALUE, number
from phyblock.tracks.estimates import all_estimates
from tests.report.factory import manifest, record, run_of, score

VARY = {"background": ["lawn", "white"], "view": ["oblique", "front", "top"]}
SEEDS = (0, 1)
ITEMS = 12


def facts(*models: str, vary: dict[str, Any] = VARY) -> dict[str, Any]:
    told = manifest(models=models, seeds=SEEDS, levels=(2,), settings=["A"], matchers=["optimal"])
    told["suite"]["vary"] = vary
    return told


def asked(
    models: dict[str, int], seed: int = 3, vary: dict[str, Any] = VARY
) -> list[dict[str, Any]]:
    """Records of the first so many scenes of each model, in every way; of one more, in one way."""
    rng, records = np.random.default_rng(seed), []
    variants = VarySpec(**vary).variants
    for model, n_items in models.items():
        skill = 1 + len(records) % 3
        for place in range(ITEMS):
            for s in SEEDS:
                for variant in variants if place < n_items else variants[:1]:
                    tp, fp = int(rng.integers(0, 2 + skill)), int(rng.integers(0, 4))
                    one = record(model, f"s{place:02}", s, [score(tp, fp, 4 - tp)])
                    one["variant"] = dict(variant.levels)
                    one["sample"] += f"/{variant.key}" if variant.key else ""
                    records.append(one)
    return records


MODELS = {"alpha": ITEMS, "beta": ITEMS, "gamma": ITEMS}


def with_level(records: list[dict[str, Any]], factor: str, level: str) -> Run:
    first = VARY[factor][0]
    kept = [one for one in records if one["variant"].get(factor, first) == level]
    return run_of(kept, facts(*MODELS))


def test_levels_show_the_estimate_of_the_samples_that_have_them() -> None:
    records = asked(MODELS)
    run = run_of(records, facts(*MODELS))
    table = levels_frame(run)
    assert len(table) == len(MODELS) * 5
    shown = {row[:3]: row[3:5] for row in levels_view(table, run).rows}
    for (factor, level), rows in table.groupby(["factor", "level"]):
        found = all_estimates(with_level(records, factor, level))
        found = found[(found["measure"] == "f1") & (found["cell"] == "overall")].set_index("model")
        wanted = 100 * found["value"]
        ranks = wanted.rank(ascending=False, method="min")
        for row in rows.to_dict("records"):
            model = row["model"]
            assert row["value"] == pytest.approx(wanted[model])
            assert row["rank"] == ranks[model]
            assert shown[model, factor, level] == (number(wanted[model]), number(ranks[model], 0))
    pairs = pairs_frame(run)
    values = table.set_index(["model", "factor", "level"])["value"]
    for row in pairs.to_dict("records"):
        a, b = (values[row[side], row["factor"], row["level"]] for side in "ab")
        assert row["here"] == pytest.approx(a - b)
    ranked = ranks_frame(run)
    assert int(ranked["flips"].sum()) == int(pairs["flips"].sum())


def test_the_figure_and_the_table_show_the_same_components() -> None:
    run = run_of(asked(MODELS), facts(*MODELS))
    table = components_frame(run).set_index(["factor", "model"])
    figure = moved_dots(run, track="full_planning")
    assert figure is not None
    models = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    for ax, factor in zip(figure.axes, VARY, strict=True):
        for line, part in zip(ax.lines, ("shift", "single"), strict=True):
            drawn = dict(zip(models, line.get_xdata(), strict=True))
            assert drawn == pytest.approx({m: table.loc[(factor, m), part] for m in models})
    for row in components_view(components_frame(run), run).rows:
        if row[1] in VARY:
            wanted = table.loc[(row[1], row[0])]
            assert (row[2], row[4]) == (number(wanted["shift"]), number(wanted["single"]))


def test_two_scenes_bound_no_difference_beyond_what_the_measure_allows() -> None:
    few = run_of(asked(dict.fromkeys(MODELS, 2), seed=8), facts(*MODELS))
    for table, most in ((levels_frame(few), 100.0), (pairs_frame(few), 200.0)):
        ends = table[["lo", "hi"]].to_numpy(float)
        assert np.nanmax(np.abs(ends)) == most
        assert not (table["detectable"] > most).any()
    assert not (components_frame(few)[["shift_hi", "single_hi"]] > 100).any(axis=None)


def of_model(frame: Callable[[Run], pd.DataFrame], run: Run, model: str) -> pd.DataFrame:
    """Rows of a model, without what its neighbours decide."""
    table = frame(run)
    mine = table[table["model"] == model].reset_index(drop=True)
    return mine.drop(columns=["rank", "p_holm"], errors="ignore")


@pytest.mark.parametrize("frame", [components_frame, levels_frame])
def test_a_model_that_was_barely_asked_changes_nothing_of_others(
    frame: Callable[[Run], pd.DataFrame],
) -> None:
    records = asked({**MODELS, "barely": 2})
    run = run_of(records, facts(*MODELS, "barely"))
    alone = run_of([r for r in records if r["model"] != "barely"], facts(*MODELS))
    for model in MODELS:
        pd.testing.assert_frame_equal(of_model(frame, run, model), of_model(frame, alone, model))
    assert set(of_model(frame, run, "barely")["n_items"]) == {2}
    pd.testing.assert_frame_equal(ranks_frame(run), ranks_frame(alone))


def test_models_are_ranked_on_the_items_they_have_in_common_and_the_rest_is_named() -> None:
    models = {**MODELS, "most": ITEMS - 1, "barely": 2}
    run = run_of(asked(models), facts(*models))
    assert set(ranks_frame(run)["n_items"]) == {ITEMS - 1}
    assert set(ranks_frame(run)["models"]) == {4}
    levels = levels_frame(run)
    assert set(levels.loc[levels["rank"].isna(), "model"]) == {"barely"}
    shown = levels_view(levels, run)
    assert {row[4] for row in shown.rows if row[0] == "barely"} == {NO_VALUE}
    for view in (shown, ranks_view(ranks_frame(run), run)):
        assert any("too few items" in note and "barely" in note for note in view.notes)
    notes = components_view(components_frame(run), run).notes
    assert any("2 to 12 items" in note for note in notes)


def test_what_flipped_says_in_which_way_it_was_asked() -> None:
    records = [
        {**one, "scores": [score(4 if one["model"] == "alpha" and i == 1 else 2, 0, 0)]}
        for model in ("alpha", "beta")
        for i, one in enumerate(asked({model: 1}))
    ]
    for one in records:
        tp = one["scores"][0]["tp"]
        one["scores"] = [score(tp, 0, 4 - tp)]
    found = compare_models(run_of(records, facts("alpha", "beta")))
    variant = records[1]["variant"]
    (row,) = found.flipped.to_dict("records")
    named = ",".join(f"{name}={level}" for name, level in variant.items())
    assert row["variant"] == named != ""
    assert flipped_lines(found) == (f"alpha is right where beta is not, 1: s00 ({named})",)


def way_of(one: dict[str, Any]) -> str:
    return ",".join(f"{factor}={level}" for factor, level in one["variant"].items())


@pytest.mark.parametrize(
    ("vary", "linked"),
    [
        # Alone, or beside references, a level is one way of asking; crossed, it is several.
        ({"view": VARY["view"]}, {"view": VARY["view"]}),
        ({**VARY, "design": "one_at_a_time"}, VARY),
        (VARY, {}),
        ({"view": VARY["view"], "repeats": 2}, {}),
    ],
)
def test_a_level_leads_to_the_samples_that_its_value_is_of_or_nowhere(
    vary: dict[str, Any], linked: dict[str, list[str]]
) -> None:
    records = asked({"alpha": ITEMS}, vary=vary)
    run = run_of(records, facts("alpha", vary=vary))
    view = levels_view(levels_frame(run), run)
    leads = table_leads(run, "sensitivity_levels", view).rows
    assert {row[1:3] for row, lead in zip(view.rows, leads, strict=True) if lead} == {
        (factor, level) for factor, levels in linked.items() for level in levels
    }
    for row, lead in zip(view.rows, leads, strict=True):
        if lead:
            words = {name: word for name, (word,) in parse_qs(lead).items()}
            assert (words["track"], words["model"]) == ("full_planning", "alpha")
            way = "" if words["variant"] == "reference" else words["variant"]
            of_way = [one for one in records if way_of(one) == way]
            found = all_estimates(run_of(of_way, facts("alpha", vary=vary)))
            found = found[(found["measure"] == "f1") & (found["cell"] == "overall")]
            assert row[3] == number(100 * float(found["value"].iloc[0]))


@pytest.mark.parametrize(
    ("design", "led"),
    [("crossed", {"background", "view", "between items"}), ("one_at_a_time", {"between items"})],
)
def test_what_all_ways_of_asking_gave_leads_to_all_samples(design: str, led: set[str]) -> None:
    vary = {**VARY, "design": design}
    run = run_of(asked({"alpha": 4}, vary=vary), facts("alpha", vary=vary))
    view = components_view(components_frame(run), run)
    leads = dict(
        zip((row[1] for row in view.rows), table_leads(run, "sensitivity", view).rows, strict=True)
    )
    assert {name for name, lead in leads.items() if lead} == led
    assert {lead for lead in leads.values() if lead} == {"track=full_planning&model=alpha"}
