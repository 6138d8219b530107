"""Tables of what the way of asking changes: each model by the items that it has, and no other."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

from phyblock.config.suite import VarySpec
from phyblock.results.compare import (
    sensitivity_frame,
    sensitivity_table,
)
from phyblock.results.figures import sensitivity
from phyblock.results.load import Run
from phyblock.results.text import number
from tests.web.factory import manifest, record, run_of, score

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


def test_the_figure_and_the_table_show_the_same_components() -> None:
    run = run_of(asked(MODELS), facts(*MODELS))
    table = sensitivity_frame(run).set_index(["factor", "model"])
    figure = sensitivity(run, track="full_planning")
    assert figure is not None
    models = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    for ax, factor in zip(figure.axes, VARY, strict=True):
        for line, part in zip(ax.lines, ("shift", "single"), strict=True):
            drawn = dict(zip(models, line.get_xdata(), strict=True))
            assert drawn == pytest.approx({m: table.loc[(factor, m), part] for m in models})
    shown = sensitivity_table(run)
    assert shown is not None
    for row in shown.view.rows:
        if row[1] in VARY:
            wanted = table.loc[(row[1], row[0])]
            assert (row[2], row[4]) == (number(wanted["shift"]), number(wanted["single"]))


def of_model(run: Run, model: str) -> pd.DataFrame:
    table = sensitivity_frame(run)
    return table[table["model"] == model].reset_index(drop=True)


def test_a_model_that_was_barely_asked_changes_nothing_of_others() -> None:
    records = asked({**MODELS, "barely": 2})
    run = run_of(records, facts(*MODELS, "barely"))
    alone = run_of([r for r in records if r["model"] != "barely"], facts(*MODELS))
    for model in MODELS:
        pd.testing.assert_frame_equal(of_model(run, model), of_model(alone, model))
    assert set(of_model(run, "barely")["n_items"]) == {2}
    shown = sensitivity_table(run)
    assert shown is not None
    assert any("2 to 12 items" in note for note in shown.view.notes)
