"""What each scene is worth: how hard it is, and how well it tells models apart."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from phyblock.scoring.counts import Floats
from phyblock.scoring.statistics import LEAST_MODELS, discrimination, explained, least_correlation
from phyblock.tables.headline import headline_rows
from phyblock.tables.load import Run
from phyblock.tables.measures import CELL, Measure
from phyblock.tables.text_table import Column, TextTable, number
from phyblock.tracks.estimates import counted_samples, track_measures
from phyblock.tracks.headline import main_column

__all__ = ["SceneCounts", "scene_counts", "scenes_frame", "scenes_view"]

_COLUMNS = (
    *("scene", "level", "n_blocks", "n_models", "mean", "sd"),
    *("discrimination", "is_negative"),
)
_GROUPS = {"level": "level", "n_blocks": "number of blocks"}
"""What may explain how hard a scene is, in words."""


@dataclass(frozen=True, eq=False)
class SceneCounts:
    """Counts of what a track ranks models by, by model and scene, summed over seeds.

    `counts` has shape (models, scenes, columns), `present` (models, scenes). Models that said
    nothing at all are left out. `levels` and `n_blocks` are of the scenes.
    """

    measure: Measure
    models: tuple[str, ...]
    scenes: tuple[str, ...]
    levels: tuple[int, ...]
    n_blocks: tuple[int, ...]
    counts: Floats
    present: np.ndarray[Any, np.dtype[np.bool_]]

    def scores(self, counts: Floats | None = None) -> Floats:
        """The value of each model in each scene, (models, scenes); NaN where there is none."""
        return self.measure.value(self.counts if counts is None else counts)


def scene_counts(run: Run, track: str) -> SceneCounts:
    """Counts of a track in a run, of what models are ranked by, counted in the headline way."""
    main = main_column(run, track)
    (measure,) = (one for one in track_measures(track) if one.name == main.measure)
    columns = list(measure.counted.columns)
    rows = headline_rows(counted_samples(run, track, measure.counted), run.design)
    rows = rows[rows[CELL] == main.cell]
    if main.criterion:
        rows = rows[rows["criterion"] == main.criterion]
    replied = set(rows.loc[rows["replied"].astype(bool), "model"])
    models = tuple(name for name in run.design.model_names if name in replied)
    rows = rows[rows["model"].isin(models)]
    about = run.records[run.records["track"] == track].drop_duplicates("scene")
    known = about.set_index("scene")
    scenes = tuple(sorted(set(rows["scene"])))
    summed = rows.groupby(["model", "scene"])[columns].sum()
    counts = np.zeros((len(models), len(scenes), len(columns)))
    present = np.zeros(counts.shape[:2], dtype=bool)
    at = [
        [names.index(name) for name in summed.index.get_level_values(place)]
        for place, names in enumerate((models, scenes))
    ]
    counts[at[0], at[1]] = summed.to_numpy(np.float64)
    present[at[0], at[1]] = True
    return SceneCounts(
        measure,
        models,
        scenes,
        tuple(max(known["levels"][scene]) for scene in scenes),
        tuple(int(known["n_blocks"][scene]) for scene in scenes),
        counts,
        present,
    )


def scenes_frame(track: str, run: Run) -> pd.DataFrame:
    """One row a scene, those first that tell models apart the wrong way round.

    `mean` and `sd` (ddof = 1) are over the `n_models` models' values of what the
    track ranks them by [%], each pooled over seeds; `discrimination` is the correlation of these
    with the mean of the models' values on all other scenes, missing where all are alike;
    `is_negative` where it is below 0. `level` is the highest of the scene. Empty for a run in which
    fewer than four models said anything.
    """
    known = scene_counts(run, track)
    if len(known.models) < LEAST_MODELS:
        return pd.DataFrame(columns=list(_COLUMNS))
    scores = np.where(known.present, known.scores(), np.nan)
    worth = discrimination(scores)
    table = pd.DataFrame(known.measure.scale * scores.T, index=list(known.scenes))
    frame = pd.DataFrame(
        {
            "scene": known.scenes,
            "level": known.levels,
            "n_blocks": known.n_blocks,
            "n_models": table.notna().sum(axis=1).to_numpy(),
            "mean": table.mean(axis=1).to_numpy(),
            "sd": table.std(axis=1).to_numpy(),
            "discrimination": worth,
            "is_negative": worth < 0,
        }
    )
    return frame.sort_values("discrimination", kind="stable", ignore_index=True)


def scenes_view(table: pd.DataFrame, run: Run) -> TextTable:
    """The scenes out of `scenes_frame` that discriminate negatively, with notes on all of them."""
    negative = table[table["is_negative"].astype(bool)]
    rows = tuple(_row(row) for row in negative.to_dict("records"))
    return TextTable(
        f"Scenes in which better models do worse{run.design.of_suite}",
        (
            Column("Scene", is_text=True),
            *(Column(name) for name in ("Level", "Blocks", "Models", "Mean", "sd")),
            Column("Discrimination"),
        ),
        rows,
        tuple(_notes(table)),
    )


def _row(row: Mapping[Any, Any]) -> tuple[str, ...]:
    return (
        row["scene"],
        *(str(row[name]) for name in ("level", "n_blocks", "n_models")),
        *(number(row[name]) for name in ("mean", "sd")),
        number(row["discrimination"], 2),
    )


def _notes(table: pd.DataFrame) -> list[str]:
    if not len(table):
        return [f"A correlation over models needs {LEAST_MODELS} that replied."]
    worth, models = table["discrimination"], int(table["n_models"].max())
    least = least_correlation(models)
    parts = {name: 100 * explained(table["mean"], list(table[name])) for name in _GROUPS}
    return [
        "Discrimination: correlation of the models' values in a scene with their mean on all other "
        f"scenes. Over {models} models, one of less than {number(least, 2)} either way may be none "
        f"(5 %); {int((worth < -least).sum())} of {len(table)} scenes are below, "
        f"{int((worth > least).sum())} above, {int(worth.isna().sum())} tell no two models apart.",
        "Of the variance of scenes' means, "
        + ", ".join(f"{word} explains {number(parts[name])} %" for name, word in _GROUPS.items())
        + ".",
        "The CSV file has all scenes.",
    ]
