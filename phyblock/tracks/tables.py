"""How much the order of the candidates matters: the spread over seeds, plans that stay, poses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd

from phyblock.scoring.counts import Floats
from phyblock.scoring.statistics import LEAST_MODELS, discrimination, explained, least_correlation
from phyblock.tables.headline import headline_rows
from phyblock.tables.load import Run
from phyblock.tables.measures import CELL, Measure
from phyblock.tables.shares import shares_of
from phyblock.tables.text_table import Column, TextTable, between, number
from phyblock.tables.track_report import WHOLE
from phyblock.tracks.estimates import counted_samples, main_column, track_estimates, track_measures
from phyblock.tracks.plans import POSE_COUNTS, POSE_MEASURES

_INTERVAL = {"value": "", "lo": "_lo", "hi": "_hi"}
_ENDS = {**_INTERVAL, **{end: f"_{end}" for end in ("mean", "sd", "least", "most")}}
_SPREAD = ("f1_mean", "f1_sd", "f1_least", "f1_most")
_SAME = {"_share": "", "_lo": "_lo", "_hi": "_hi"}
_HOW = {
    "shuffled": "Each seed draws another order of the candidates.",
    "file": "Candidates stand in the order of the file with every seed.",
    "varied": "The order of the candidates is varied; plans are compared within a way of asking.",
}
_POSES = tuple(measure.name for measure in POSE_MEASURES)


def order_frame(track: str, criterion: str, run: Run) -> pd.DataFrame:
    """One row a model: what another order of the candidates changes; shares in [0, 1].

    `order` is that of the run (or `varied`); shuffled, each of the `seeds` is another one, and in
    the file's they are repeats, to hold the others against. `f1` pools seeds; over single seeds it
    has `f1_mean`, `f1_sd` (ddof = 1), `f1_least` and `f1_most`; of all scenes in the headline
    setting, counted by `criterion`. `same_plan` is the share of `plan_pairs` (a scene with two
    seeds) in which the plan names the same blocks in the same order. `pose_first` is the share of
    `pose_first_n` kinds that were named in the right pose where that is listed first among several,
    `pose_later` of `pose_later_n` where a wrong one is; `pose_gap` is their difference. `*_lo` and
    `*_hi` bound 95 % intervals. Empty where the run has no samples of the track.
    """
    design = run.design
    records = run.records[run.records["track"] == track]
    estimates = headline_rows(track_estimates(run, track), design)
    estimates = estimates[
        (estimates[CELL] == WHOLE.name) & estimates["criterion"].isin(["", criterion])
    ]
    known = estimates.set_index(["measure", "model"]).to_dict("index")
    plans = _same_plans(records)
    same = shares_of(run, plans, ("same",), whole="pairs").droplevel(CELL).to_dict("index")
    named = counted_samples(run, track, POSE_COUNTS)
    counts = named[named[CELL] == WHOLE.name].groupby("model")[list(POSE_COUNTS.columns)].sum()
    rows = []
    for model in design.model_names if len(records) else ():
        row: dict[str, Any] = {"model": model, "order": _order(run)}
        row["seeds"] = len(design.suite.seeds)
        estimate = known.get(("f1", model), {})
        row |= {f"f1{name}": estimate.get(end, np.nan) for end, name in _ENDS.items()}
        mine = same.get(model, {})
        row |= {f"same_plan{name}": mine.get(f"same{end}", np.nan) for end, name in _SAME.items()}
        row["plan_pairs"] = int(mine.get("whole", 0))
        for name in _POSES:
            estimate = known.get((name, model), {})
            row |= {f"{name}{of}": estimate.get(end, np.nan) for end, of in _INTERVAL.items()}
        for name in ("first_n", "later_n"):
            row[f"pose_{name}"] = int(counts[name].get(model, 0))
        rows.append(row)
    return pd.DataFrame(rows)


def _order(run: Run) -> str:
    """The order of the candidates, `varied` where ways of asking differ in it."""
    suite = run.design.suite
    return "varied" if "candidate_order" in suite.vary.factors else suite.candidates.order


def _same_plans(records: pd.DataFrame) -> pd.DataFrame:
    """How many pairs of plans are the `same`, of how many `pairs`: a row a model and scene."""
    read = records[records["rule"].notna() | records["ending"].notna()]
    rows = []
    for (model, scene, _), plans in read.groupby(["model", "scene", "variant"])["file_plan"]:
        alike = [one == other for one, other in combinations(plans, 2)]
        rows.append((model, scene, 0, True, sum(alike), len(alike)))
    return pd.DataFrame(rows, columns=["model", "scene", "seed", "replied", "same", "pairs"])


def order_view(table: pd.DataFrame, run: Run) -> TextTable:
    """A row a model out of `order_frame`, in percent."""
    columns = (
        Column("Model", is_text=True),
        *(Column(name, "F1") for name in ("%", "95 % CI")),
        *(Column(name, "F1 over seeds") for name in ("mean", "sd", "least", "most")),
        *(Column(name, "Same plan") for name in ("%", "95 % CI")),
        *(Column(name, "Right pose listed first") for name in ("%", "95 % CI", "n")),
        *(Column(name, "listed later") for name in ("%", "95 % CI", "n")),
        *(Column(name, "First less later") for name in ("%", "95 % CI")),
    )
    rows = tuple(_row(row) for row in table.to_dict("records"))
    how = _HOW[_order(run)]
    suite = f", suite {run.design.suite.name}" if run.design.suite.name else ""
    return TextTable(
        f"What the order of the candidates changes (%){suite}",
        columns,
        rows,
        (
            f"{how} Setting {run.design.setting}, all scenes.",
            "Same plan: of two seeds for one scene, how often the same blocks in the same order.",
            "Right pose: of kinds that are offered in wrong poses too, how often the one that is "
            "named first is right, where a right one is listed first and where a wrong one is.",
        ),
    )


def _row(row: Any) -> tuple[str, ...]:
    return (
        row["model"],
        *_with_interval(row, "f1"),
        *(number(100 * row[name]) for name in _SPREAD),
        *_with_interval(row, "same_plan"),
        *_with_interval(row, "pose_first"),
        str(row["pose_first_n"]),
        *_with_interval(row, "pose_later"),
        str(row["pose_later_n"]),
        *_with_interval(row, "pose_gap", signed=True),
    )


def _with_interval(row: Any, name: str, *, signed: bool = False) -> tuple[str, str]:
    interval = between(100 * row[f"{name}_lo"], 100 * row[f"{name}_hi"], signed=signed)
    return number(100 * row[name]), interval


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
    rows = tuple(_row_scenes(row) for row in negative.to_dict("records"))
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


def _row_scenes(row: Mapping[Any, Any]) -> tuple[str, ...]:
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
