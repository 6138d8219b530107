"""Setting A against setting B: what orientation costs a model, on the same replies."""

from __future__ import annotations

from collections.abc import Hashable
from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from phyblock.scoring.counts import Floats, f1_of
from phyblock.scoring.statistics import Clusters, bounded, jackknife
from phyblock.tables.cells import cell_scores, measured
from phyblock.tables.intervals import base_scenes, grouped, parents_of, summed
from phyblock.tables.load import Run, made_once_copied
from phyblock.tables.measures import CELL
from phyblock.tables.text_table import Column, TextTable, between, level_name, number
from phyblock.tracks.estimates import track_estimates
from phyblock.tracks.full_planning.measures import NAME

__all__ = ["settings_frame", "settings_view"]

_ENDS = {"value": "", "lo": "_lo", "hi": "_hi"}
_F1 = {
    f"f1_{setting.lower()}{end}": (setting, name)
    for setting, (name, end) in product("AB", _ENDS.items())
}
"""Columns of F1: its setting, and the column of estimates that it is taken from."""
_COLUMNS = ("model", "level", *_F1, "difference", "lo", "hi", "n_scenes", "n_clusters")
_UNKNOWN = {"n_scenes": 0, "n_clusters": 0}


@made_once_copied
def settings_frame(run: Run) -> pd.DataFrame:
    """One row a model and level: F1 in A and in B, B minus A, all with 95 % intervals; in [0, 1].

    Headline matcher, the criterion of each level. Paired: a reply is scored
    under both. Empty where the run has one setting.
    """
    design = run.design
    if not {"A", "B"} <= set(design.suite.settings):
        return pd.DataFrame(columns=list(_COLUMNS))
    estimates = _estimates(run)
    scores, parents = _scores(run), parents_of(run)
    by_cell: dict[tuple[str, str], dict[str, Any]] = {}
    for level in design.levels:
        matcher = design.matchers(design.criterion(level))[0]
        part = scores[(scores["level"] == level) & (scores["matcher"] == matcher)]
        scenes, known, settings = (grouped(part, by) for by in ("scene", "model", "setting"))
        if settings.values != ["A", "B"]:
            continue
        models = [model for model in design.model_names if model in known.values]
        order = [known.values.index(model) for model in models]
        counts, samples = summed(part, ["tp", "fp", "fn"], (scenes, known, settings))
        present = samples[:, order, 0] > 0
        clusters = Clusters.of(base_scenes(parents, scenes.values))
        n_clusters = clusters.behind(present)
        paired = jackknife(
            counts[:, order],
            clusters,
            _both_and_difference,
            n_clusters=np.repeat(n_clusters[:, None], 3, axis=1),
        )
        paired = bounded(paired, 1.0)
        for n, model in enumerate(models):
            f1 = [estimates[model, setting, level, matcher] for setting in "AB"]
            by_cell[model, level] = {
                **{name: f1["AB".index(of)][end] for name, (of, end) in _F1.items()},
                **{"difference": paired.value[n, 2], "lo": paired.lo[n, 2], "hi": paired.hi[n, 2]},
                "n_scenes": int(present[:, n].sum()),
                "n_clusters": int(n_clusters[n]),
            }
    answered = {model for model, _ in by_cell}
    rows = [
        {"model": model, "level": level, **(by_cell.get((model, level)) or _UNKNOWN)}
        for model in design.model_names
        if model in answered
        for level in design.levels
    ]
    return pd.DataFrame(rows, columns=list(_COLUMNS))


def _estimates(run: Run) -> dict[Hashable, Any]:
    """F1 by model, setting, level and matcher."""
    estimates = track_estimates(run, NAME)
    estimates = estimates[estimates["measure"] == "f1"].set_index(
        ["model", "setting", CELL, "matcher"]
    )
    return dict(estimates[list(_ENDS)].astype("float64").to_dict("index"))


def _scores(run: Run) -> pd.DataFrame:
    """Scores of the plans that were asked for, by the levels of their scenes."""
    scores = cell_scores(run)
    return measured(scores[scores["track"] == NAME], ["level", "model"])


def _both_and_difference(sums: Floats) -> Floats:
    f1 = f1_of(sums)
    return np.concatenate([f1, np.diff(f1, axis=-1)], axis=-1)


def settings_view(table: pd.DataFrame, run: Run) -> TextTable:
    """F1 in A, in B and the difference with its interval out of `settings_frame`, by level."""
    design = run.design
    cells = {(row["model"], row["level"]): row for row in table.to_dict("records")}
    rows = []
    for model in dict.fromkeys(table["model"]):
        row = [model]
        for level in design.levels:
            cell = cells[model, level]
            row += [number(100 * cell["f1_a"]), number(100 * cell["f1_b"])]
            row.append(between(100 * cell["lo"], 100 * cell["hi"], signed=True))
        rows.append(tuple(row))
    columns = [
        Column(name, level_name(level))
        for level in design.levels
        for name in ("A", "B", "B - A, 95 % CI")
    ]
    note = f"Matcher {design.matcher}; the difference is paired"
    if len(table):
        note += f", its interval from leaving out each of {table['n_clusters'].max()} base scenes"
    return TextTable(
        "F1 in setting A (with orientation) and in setting B (without), in percent",
        (Column("Model", is_text=True), *columns),
        tuple(rows),
        (f"{note}.",),
    )
