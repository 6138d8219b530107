"""Accuracies cell by cell: one row a model and subtask, category or all."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from phyblock.domain import SUBTASKS
from phyblock.tables.load import Run, made_once_copied
from phyblock.tables.measures import CELL
from phyblock.tables.outcomes import FAILURES
from phyblock.tracks.estimates import track_estimates
from phyblock.tracks.vqa.answers import (
    CELLS,
    answers_of,
    expected_answers,
    scored_answers,
    subtasks_of,
)
from phyblock.tracks.vqa.measures import ACCURACY, EACH_ROTATION, NAME, guessing, subtask_cells

__all__ = ["questions_frame"]

_COLUMNS = (
    "model",
    "cell",
    "n",
    "expected",
    *FAILURES,
    "correct",
    "accuracy",
    "accuracy_lo",
    "accuracy_hi",
    "each_rotation",
    "seeds",
    "accuracy_mean",
    "accuracy_sd",
    "chance",
)


@made_once_copied
def questions_frame(run: Run) -> pd.DataFrame:
    """Accuracies in [0, 1] by model and cell (`CELLS`), in the suite's order of models.

    Of a subtask, `n` samples are scored of `expected` (seeds and rotations each count), the
    failures are counted by kind, `correct` were answered right. `accuracy` is the headline: the
    share of them, or under circular evaluation the share of questions of which every rotation was
    answered right, while `each_rotation` is then the share over single rotations. Of a category
    and overall it is the unweighted mean over the parts that were asked, NaN unless each of these
    has a value. `*_lo` and `*_hi` bound a 95 % interval, `*_mean` and `*_sd` (ddof = 1) are taken
    over seeds, `chance` is what uniform guessing would give. Where a model
    said nothing at all in a subtask, nothing was measured: NaN.
    """
    estimates = track_estimates(run, NAME).set_index(["measure", "model", CELL])
    known = estimates.to_dict("index")
    asked = {cell.name for cell in subtask_cells(run)}
    expected = expected_answers(run)
    rows: list[dict[str, Any]] = []
    for model in run.design.model_names:
        samples, scored = answers_of(run, model), scored_answers(run, model)
        for cell in CELLS:
            parts = [name for name in SUBTASKS if name in subtasks_of(cell)]
            mine, here = (frame[frame["subtask"].isin(parts)] for frame in (samples, scored))
            estimate = known.get((ACCURACY.name, model, cell), {})
            single = known.get((EACH_ROTATION.name, model, cell), {})
            value = estimate.get("value", np.nan)
            rows.append(
                {
                    "model": model,
                    "cell": cell,
                    "n": len(here),
                    "expected": sum(expected.get(name, 0) for name in parts),
                    **{failure: int((mine["outcome"] == failure).sum()) for failure in FAILURES},
                    "correct": int((here["given"] == here["right"]).sum()),
                    "accuracy": value,
                    "accuracy_lo": estimate.get("lo", np.nan),
                    "accuracy_hi": estimate.get("hi", np.nan),
                    "each_rotation": np.nan if np.isnan(value) else single.get("value", np.nan),
                    "seeds": estimate.get("seeds", 0),
                    "accuracy_mean": estimate.get("mean", np.nan),
                    "accuracy_sd": estimate.get("sd", np.nan),
                    "chance": np.nan
                    if np.isnan(value) or cell not in asked
                    else guessing(run, cell),
                }
            )
    return pd.DataFrame(rows, columns=list(_COLUMNS))
