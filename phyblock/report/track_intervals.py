"""95 % intervals of accuracies of questions and of step planning, by resampling base scenes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from phyblock.domain import CATEGORIES, SUBTASKS
from phyblock.report.intervals import CountCube, parents_of, resampler
from phyblock.report.load import Run, once_per_run
from phyblock.report.questions import CELLS
from phyblock.report.text_table import Column, TextTable, between, number
from phyblock.scoring.uncertainty import Floats, bootstrap, f1_of, ratio_of

__all__ = ["step_intervals", "track_intervals_view", "vqa_intervals"]

_COLUMNS = ("model", "cell", "value", "lo", "hi", "se", "n", "n_scenes", "n_clusters")


@once_per_run
def vqa_intervals(run: Run) -> pd.DataFrame:
    """One row a model and cell of Table 2: value, lo, hi, se [%], n, n_scenes, n_clusters.

    Values are those of `questions_frame`; with rotations a question counts as right where each is.
    Means over subtasks are taken anew in every resample.
    """
    records = run.records
    kept = records[
        (records["track"] == "vqa") & ~records["outcome"].isin(run.design.outcomes_left_out)
    ]
    right = kept.assign(correct=kept["given"].eq(kept["right"]).fillna(False).astype("int64"))
    keys = ["model", "scene", "subtask", "question", "seed"]
    asked = right.groupby(keys, sort=True)["correct"].min().reset_index().assign(n=1)
    if asked.empty:
        return pd.DataFrame(columns=list(_COLUMNS))
    cube = CountCube(asked, parents_of(run), ["model", "subtask"], ["correct", "n"])
    models = [name for name in run.design.model_names if any(name == m for m, _ in cube.cells)]
    place = {cell: number for number, cell in enumerate(cube.cells)}
    counts = np.zeros((len(cube.scenes), len(models), len(SUBTASKS), 2))
    present = np.zeros((len(cube.scenes), len(models)), dtype=bool)
    for row, model in enumerate(models):
        for column, subtask in enumerate(SUBTASKS):
            if (model, subtask) in place:
                counts[:, row, column] = cube.counts[:, place[model, subtask]]
                present[:, row] |= cube.present[:, place[model, subtask]]
    n_clusters = cube.clusters_of(present)
    found = bootstrap(
        counts,
        cube.clusters,
        _cells_of,
        resampler(),
        n_clusters=np.repeat(n_clusters[:, None], len(CELLS), axis=1),
    )
    parts = [
        pd.DataFrame(
            {
                "model": model,
                "cell": CELLS,
                **_percent(found.value[row], found.lo[row], found.hi[row], found.se[row]),
                "n": _numbers(counts[:, row, :, 1].sum(axis=0)),
                "n_scenes": present[:, row].sum(),
                "n_clusters": n_clusters[row],
            }
        )
        for row, model in enumerate(models)
    ]
    return pd.concat(parts, ignore_index=True)[list(_COLUMNS)]


def _cells_of(sums: Floats) -> Floats:
    """Accuracies (..., cells) out of counts (..., subtasks, [right, n])."""
    accuracy = dict(zip(SUBTASKS, np.moveaxis(ratio_of(sums), -1, 0), strict=True))
    cells = dict(accuracy)
    for category, subtasks in CATEGORIES.items():
        cells[category] = np.mean([accuracy[name] for name in subtasks], axis=0)
    cells["overall"] = np.mean([cells[category] for category in CATEGORIES], axis=0)
    return np.stack([cells[cell] for cell in CELLS], axis=-1)


def _numbers(by_subtask: Floats) -> list[int]:
    """Questions behind each of `CELLS`."""
    of = dict(zip(SUBTASKS, by_subtask, strict=True))
    of |= {name: sum(of[one] for one in subtasks) for name, subtasks in CATEGORIES.items()}
    of["overall"] = by_subtask.sum()
    return [int(of[cell]) for cell in CELLS]


@once_per_run
def step_intervals(run: Run) -> pd.DataFrame:
    """One row a model and way of counting: F1 of step planning, columns as `vqa_intervals`.

    `cell` is `placed` or `attempted`, in the headline setting, pooled over seeds.
    """
    scores = run.scores
    kept = scores[
        (scores["track"] == "step_planning")
        & (scores["setting"] == run.design.setting)
        & ~scores["outcome"].isin(run.design.outcomes_left_out)
    ]
    if kept.empty:
        return pd.DataFrame(columns=list(_COLUMNS))
    cube = CountCube(kept, parents_of(run), ["model", "criterion"], ["tp", "fp", "fn"])
    n_clusters = cube.clusters_of(cube.present)
    found = bootstrap(cube.counts, cube.clusters, f1_of, resampler(), n_clusters=n_clusters)
    table = pd.DataFrame(list(cube.cells), columns=["model", "cell"])
    for name, values in _percent(found.value, found.lo, found.hi, found.se).items():
        table[name] = values
    table["n"] = kept.groupby(["model", "criterion"], sort=True).size().to_numpy()
    table["n_scenes"], table["n_clusters"] = cube.present.sum(axis=0), n_clusters
    order = {name: place for place, name in enumerate(run.design.model_names)}
    return table.sort_values("model", key=lambda names: names.map(order), kind="stable")[
        list(_COLUMNS)
    ].reset_index(drop=True)


def _percent(value: Floats, lo: Floats, hi: Floats, se: Floats) -> dict[str, Floats]:
    return {"value": 100 * value, "lo": 100 * lo, "hi": 100 * hi, "se": 100 * se}


def track_intervals_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Averages with their intervals out of `vqa_intervals`, or F1 out of `step_intervals`."""
    wanted = [cell for cell in (*CATEGORIES, "overall") if cell in set(table["cell"])]
    cells: Sequence[str] = wanted or list(dict.fromkeys(table["cell"]))
    rows = []
    for model, part in table.groupby("model", sort=False):
        by_cell = part.set_index("cell").to_dict("index")
        texts = [
            text
            for cell in cells
            for text in (
                number(by_cell[cell]["value"]),
                between(by_cell[cell]["lo"], by_cell[cell]["hi"]),
            )
        ]
        rows.append((str(model), *texts))
    what = "Right answers" if wanted else "F1 of step planning"
    columns = [
        Column(name, cell.replace("_", " ").capitalize())
        for cell in cells
        for name in ("%", "95 % CI")
    ]
    suite = f", suite {run.design.suite.name}" if run.design.suite.name else ""
    note = f"Intervals: base scenes resampled, at most {table['n_clusters'].max()} of them."
    return TextTable(
        f"{what} with 95 % intervals{suite}",
        (Column("Model", is_text=True), *columns),
        tuple(rows),
        (note,),
    )
