"""Setting A against setting B: what orientation costs a model, on the same replies."""

from __future__ import annotations

from collections.abc import Hashable
from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from phyblock.scoring.ratios import Floats, f1_of
from phyblock.scoring.uncertainty import jackknife
from phyblock.tables.cells import cell_scores, measured
from phyblock.tables.intervals import CountCube, parents_of
from phyblock.tables.load import Run, made_once_copied
from phyblock.tables.measures import CELL
from phyblock.tables.text_table import Column, TextTable, between, level_name, number
from phyblock.tracks.estimates import track_estimates
from phyblock.tracks.full_planning.measures import NAME

__all__ = ["settings_frame", "settings_view"]

_ENDS = {"value": "", "lo": "_lo", "hi": "_hi"}
_F1 = tuple(f"f1_{setting}{end}" for setting in "ab" for end in _ENDS.values())
_COLUMNS = ("model", "level", *_F1, "difference", "lo", "hi", "n_scenes", "n_clusters")


@made_once_copied
def settings_frame(run: Run) -> pd.DataFrame:
    """One row a model and level: F1 in A and in B, B minus A, all with 95 % intervals; in [0, 1].

    Headline matcher, the criterion of each level. Paired: a reply is scored
    under both. Empty where the run has one setting.
    """
    design = run.design
    parts = []
    for level in design.levels if {"A", "B"} <= set(design.suite.settings) else ():
        cube = _counts(run, level)
        matcher = design.matchers(design.criterion(level))[0]
        kept = {
            (model, setting): place
            for place, (by, model, setting) in enumerate(cube.cells)
            if by == matcher
        }
        models = [m for m in design.model_names if (m, "A") in kept and (m, "B") in kept]
        if not models:
            continue
        both = np.array([[kept[model, setting] for setting in "AB"] for model in models])
        n_clusters = cube.clusters.behind(cube.present[:, both[:, 0]])
        found = jackknife(
            cube.counts[:, both],
            cube.clusters,
            _both_and_difference,
            n_clusters=np.repeat(n_clusters[:, None], 3, axis=1),
        )
        part = pd.DataFrame({"model": models, "level": level})
        part["difference"] = found.value[:, 2]
        part["lo"], part["hi"] = found.lo[:, 2], found.hi[:, 2]
        f1 = _estimates(run, level, matcher)
        for name, (setting, end) in zip(_F1, product("AB", _ENDS), strict=True):
            part[name] = [f1[model, setting][end] for model in models]
        part["n_scenes"] = cube.present[:, both[:, 0]].sum(axis=0)
        part["n_clusters"] = n_clusters
        parts.append(part)
    if not parts:
        return pd.DataFrame(columns=list(_COLUMNS))
    known = pd.concat(parts).set_index(["model", "level"])
    models = [name for name in design.model_names if name in set(known.index.get_level_values(0))]
    cells = pd.MultiIndex.from_product([models, design.levels], names=["model", "level"])
    table = known.reindex(cells).reset_index()[list(_COLUMNS)]
    sizes = ["n_scenes", "n_clusters"]
    table[sizes] = table[sizes].fillna(0).astype("int64")
    return table


def _estimates(run: Run, level: str, matcher: str) -> dict[Hashable, Any]:
    """F1 of a level by model and setting."""
    found = track_estimates(run, NAME)
    found = found[(found["measure"] == "f1") & (found[CELL] == level)]
    mine = found[found["matcher"] == matcher].set_index(["model", "setting"])
    return dict(mine[list(_ENDS)].astype("float64").to_dict("index"))


def _counts(run: Run, level: str) -> CountCube:
    """Counts tp, fp, fn of every scene by matcher, model and setting."""
    scores = cell_scores(run)
    scores = scores[(scores["level"] == level) & (scores["track"] == NAME)]
    by = ["matcher", "model", "setting"]
    return CountCube(measured(scores, ["model"]), parents_of(run), by, ["tp", "fp", "fn"])


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
