"""What a comparison is about in each track: its samples, what one is worth, what many are."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from phyblock.domain import CATEGORIES
from phyblock.report.cells import measured
from phyblock.report.design import OVERALL, Design
from phyblock.report.load import Run
from phyblock.report.questions import questions_counted, subtasks_of
from phyblock.scoring.uncertainty import Floats, Metric, f1_of, ratio_of

__all__ = ["MEASURES", "Measure"]

_COUNTS = ["tp", "fp", "fn"]
_KEYS = ["scene", "item", "seed"]
_SUBTASKS = tuple(subtask for subtasks in CATEGORIES.values() for subtask in subtasks)


@dataclass(frozen=True)
class Measure:
    """What is compared in a track.

    `name` heads its values and `how`, of the design that it goes by, says what they are. `parts`
    are the rows of one pair, of which the last stands for all. `samples` are those of a part by
    model, a row each by `scene`, `item` and `seed`; `counts` makes (samples, 2, n_counts) of
    those of two models side by side (columns `a` and `b`). `each` is what one sample is
    worth in [0, 1], and `whole` says, for the sums of all samples, what such sums are worth.
    """

    name: str
    how: Callable[[Design], str]
    parts: Callable[[Design], tuple[str, ...]]
    samples: Callable[[Run, str, Design], dict[str, pd.DataFrame]]
    counts: Callable[[pd.DataFrame], Floats]
    n_counts: int
    each: Metric
    whole: Callable[[Floats], Metric]


def _plans(run: Run, level: str, design: Design) -> dict[str, pd.DataFrame]:
    criterion = design.criterion(level)
    scores = run.scores
    kept = scores[
        (scores["track"] == "full_planning")
        & (scores["criterion"] == criterion)
        & (scores["matcher"] == design.matchers(criterion)[0])
    ]
    if level != OVERALL:
        records = run.records
        of_level = [int(level) in levels for levels in records["levels"]]
        kept = kept[kept["sample"].isin(records["sample"][of_level])]
    return _scored(kept, design)


def _episodes(run: Run, counted: str, design: Design) -> dict[str, pd.DataFrame]:
    scores = run.scores
    kept = (scores["track"] == "step_planning") & (scores["criterion"] == counted)
    return _scored(scores[kept], design)


def _scored(scores: pd.DataFrame, design: Design) -> dict[str, pd.DataFrame]:
    kept = scores[
        (scores["setting"] == design.setting) & ~scores["outcome"].isin(design.outcomes_left_out)
    ]
    kept = measured(kept, ["model"])
    return _by_model(kept.assign(item=kept["scene"]), _COUNTS)


def _answers(run: Run, cell: str, design: Design) -> dict[str, pd.DataFrame]:
    asked = questions_counted(replace(run, design=design))
    asked = asked[asked["subtask"].isin(subtasks_of(cell))]
    numbers = {name: number for number, name in enumerate(_SUBTASKS)}
    table = asked.assign(item=asked["question"], subtask=asked["subtask"].map(numbers))
    return _by_model(table, ["subtask", "correct"])


def _by_model(table: pd.DataFrame, columns: Sequence[str]) -> dict[str, pd.DataFrame]:
    indexed = table.set_index(_KEYS)
    groups = indexed.groupby("model", sort=False)
    return {str(model): part[list(columns)] for model, part in groups}


def _score_counts(both: pd.DataFrame) -> Floats:
    return np.asarray(both.to_numpy(np.float64).reshape(len(both), 2, len(_COUNTS)))


def _answer_counts(both: pd.DataFrame) -> Floats:
    """Right answers and answers of each subtask, flat: (samples, 2, subtasks x 2)."""
    counts = np.zeros((len(both), 2, len(_SUBTASKS), 2))
    rows = np.arange(len(both))
    for side, name in enumerate("ab"):
        subtask = both[name, "subtask"].to_numpy(np.intp)
        counts[rows, side, subtask, 0] = both[name, "correct"]
        counts[rows, side, subtask, 1] = 1
    return counts.reshape(len(both), 2, -1)


def _by_subtask(sums: Floats) -> Floats:
    return np.asarray(sums.reshape(*sums.shape[:-1], len(_SUBTASKS), 2))


def _answer(sums: Floats) -> Floats:
    return ratio_of(_by_subtask(sums).sum(axis=-2))


def _macro(totals: Floats) -> Metric:
    """The mean over categories of the means over subtasks, of those that have an answer."""
    asked = _by_subtask(totals)[..., 1] > 0
    of_category = asked.reshape(*asked.shape[:-1], len(CATEGORIES), -1)
    subtasks = of_category.sum(axis=-1, keepdims=True)
    categories = (subtasks > 0).sum(axis=-2, keepdims=True)
    whole = np.broadcast_to(subtasks * categories, of_category.shape).reshape(asked.shape)
    weights = asked / np.where(asked, whole, 1)

    def metric(sums: Floats) -> Floats:
        # A resample without a subtask that was asked has no value.
        shares = np.where(asked, ratio_of(_by_subtask(sums)), 0)
        return np.where(asked.any(axis=-1), (weights * shares).sum(axis=-1), np.nan)

    return metric


MEASURES: dict[str, Measure] = {
    "full_planning": Measure(
        "F1",
        lambda design: (
            f"F1 in setting {design.setting} by the {design.matcher} matcher; micro averages over "
            "the samples that both have."
        ),
        lambda design: design.levels,
        _plans,
        _score_counts,
        len(_COUNTS),
        f1_of,
        lambda _: f1_of,
    ),
    "vqa": Measure(
        "Accuracy",
        lambda _: (
            "Right answers to the questions that both have; means over categories of the means "
            "over their subtasks, of those that were asked."
        ),
        lambda _: (*CATEGORIES, OVERALL),
        _answers,
        _answer_counts,
        2 * len(_SUBTASKS),
        _answer,
        _macro,
    ),
    "step_planning": Measure(
        "F1",
        lambda design: (
            f"F1 of step planning in setting {design.setting}, of all moves attempted or of the "
            "blocks placed; micro averages over the episodes that both have."
        ),
        lambda _: ("attempted", "placed"),
        _episodes,
        _score_counts,
        len(_COUNTS),
        f1_of,
        lambda _: f1_of,
    ),
}
"""By track, in the order in which one is chosen for runs of several."""
