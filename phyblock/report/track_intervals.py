"""95 % intervals of accuracies of questions and of step planning, by resampling base scenes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from phyblock.domain import CATEGORIES, SUBTASKS
from phyblock.report.cells import METRICS, measured
from phyblock.report.intervals import CountCube, all_metrics, parents_of, resampler
from phyblock.report.load import Run, once_per_run
from phyblock.report.questions import CELLS, questions_counted, subtasks_of
from phyblock.report.text_table import Column, TextTable, between, number
from phyblock.scoring.uncertainty import Floats, bootstrap, ratio_of

__all__ = ["step_intervals", "step_metric_intervals", "track_intervals_view", "vqa_intervals"]

_COLUMNS = ("model", "cell", "value", "lo", "hi", "se", "n", "n_scenes", "n_clusters")


@once_per_run
def vqa_intervals(run: Run) -> pd.DataFrame:
    """One row a model and cell of Table 2: value, lo, hi, se [%], n, n_scenes, n_clusters.

    Values are those of `questions_frame`; means over subtasks are taken anew in every resample.
    `n_scenes` and `n_clusters` are behind the cell; a mean has no interval where one of its
    subtasks has none.
    """
    asked = questions_counted(run)
    if asked.empty:
        return pd.DataFrame(columns=list(_COLUMNS))
    cube = CountCube(asked, parents_of(run), ["model", "subtask"], ["correct", "n"])
    models = [name for name in run.design.model_names if any(name == m for m, _ in cube.cells)]
    counts = np.zeros((len(cube.scenes), len(models), len(SUBTASKS), 2))
    for place, (model, subtask) in enumerate(cube.cells):
        counts[:, models.index(model), SUBTASKS.index(subtask)] = cube.counts[:, place]
    present = np.asarray(np.any(_of_cells(counts[..., 1] > 0), axis=-1))
    n_clusters = _clusters_behind(cube, present)
    least = _clusters_behind(cube, counts[..., 1] > 0)
    weakest = np.where(_PARTS, least[:, None, :], n_clusters.max()).min(axis=-1)
    found = bootstrap(
        counts,
        cube.clusters,
        _cells_of,
        resampler(),
        n_clusters=np.where(weakest < 2, weakest, n_clusters),
    )
    parts = [
        pd.DataFrame(
            {
                "model": model,
                "cell": CELLS,
                **_percent(found.value[row], found.lo[row], found.hi[row], found.se[row]),
                "n": _of_cells(counts[:, row, :, 1].sum(axis=0)).sum(axis=-1).astype("int64"),
                "n_scenes": present[:, row].sum(axis=0),
                "n_clusters": n_clusters[row],
            }
        )
        for row, model in enumerate(models)
    ]
    return pd.concat(parts, ignore_index=True)[list(_COLUMNS)]


_PARTS = np.array([[name in subtasks_of(cell) for name in SUBTASKS] for cell in CELLS])
"""Which subtasks a cell is made of, shape (cells, subtasks)."""


def _of_cells(by_subtask: np.ndarray) -> np.ndarray:
    """What is known by subtask (..., subtasks) as (..., cells, subtasks), zero where not of it."""
    return np.asarray(by_subtask[..., None, :] * _PARTS)


def _clusters_behind(cube: CountCube, present: np.ndarray) -> np.ndarray:
    """Base scenes behind each of the columns of `present`, whose first axis are scenes."""
    flat = present.reshape(len(present), -1)
    return cube.clusters.behind(flat).reshape(present.shape[1:])


def _cells_of(sums: Floats) -> Floats:
    """Accuracies (..., cells) out of counts (..., subtasks, [right, n])."""
    accuracy = dict(zip(SUBTASKS, np.moveaxis(ratio_of(sums), -1, 0), strict=True))
    cells = dict(accuracy)
    for category, subtasks in CATEGORIES.items():
        cells[category] = np.mean([accuracy[name] for name in subtasks], axis=0)
    cells["overall"] = np.mean([cells[category] for category in CATEGORIES], axis=0)
    return np.stack([cells[cell] for cell in CELLS], axis=-1)


def step_intervals(run: Run) -> pd.DataFrame:
    """One row a model and way of counting: F1 of step planning, columns as `vqa_intervals`.

    `cell` is `placed` or `attempted`, in the headline setting, pooled over seeds.
    """
    table = step_metric_intervals(run)
    table = table[table["cell"].str.endswith("_f1")].reset_index(drop=True)
    return table.assign(cell=table["cell"].str.removesuffix("_f1"))


@once_per_run
def step_metric_intervals(run: Run) -> pd.DataFrame:
    """As `step_intervals`, for every metric: `placed_precision`, ... `attempted_f1`."""
    scores = run.scores
    kept = scores[
        (scores["track"] == "step_planning")
        & (scores["setting"] == run.design.setting)
        & ~scores["outcome"].isin(run.design.outcomes_left_out)
    ]
    kept = measured(kept, ["model"])
    if kept.empty:
        return pd.DataFrame(columns=list(_COLUMNS)).astype({"cell": "str"})
    cube = CountCube(kept, parents_of(run), ["model", "criterion"], ["tp", "fp", "fn"])
    n_clusters = cube.clusters.behind(cube.present)
    found = bootstrap(
        cube.counts,
        cube.clusters,
        all_metrics,
        resampler(),
        n_clusters=np.repeat(n_clusters[:, None], len(METRICS), axis=1),
    )
    cells = pd.DataFrame(list(cube.cells), columns=["model", "criterion"])
    cells["n"] = kept.groupby(["model", "criterion"], sort=True).size().to_numpy()
    cells["n_scenes"], cells["n_clusters"] = cube.present.sum(axis=0), n_clusters
    parts = []
    for place, metric in enumerate(METRICS):
        ends = (found.value, found.lo, found.hi, found.se)
        numbers = _percent(*(values[:, place] for values in ends))
        parts.append(cells.assign(cell=cells["criterion"] + f"_{metric}", **numbers))
    order = {name: place for place, name in enumerate(run.design.model_names)}
    table = pd.concat(parts, ignore_index=True).sort_values(
        "model", key=lambda names: names.map(order), kind="stable"
    )
    return table[list(_COLUMNS)].reset_index(drop=True)


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
    most = f", at most {table['n_clusters'].max()} of them" if len(table) else ""
    return TextTable(
        f"{what} with 95 % intervals{suite}",
        (Column("Model", is_text=True), *columns),
        tuple(rows),
        (f"Intervals: base scenes resampled{most}.",),
    )
