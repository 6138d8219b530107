"""Answers to questions, cell by cell: one row a model and subtask, category or all."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from phyblock.domain import CATEGORIES, LETTERS, SUBTASKS, Subtask
from phyblock.report.load import Run, once_per_run
from phyblock.report.outcomes import FAILURES, WITHOUT_REPLY
from phyblock.scoring import (
    Answered,
    chance,
    circular,
    letter_rates,
    macro_accuracy,
    subtask_accuracies,
)

__all__ = [
    "CELLS",
    "OVERALL_CELL",
    "Showing",
    "letters_frame",
    "questions_counted",
    "questions_frame",
    "showing",
    "subtasks_of",
]

_TRACK = "vqa"
OVERALL_CELL = "overall"
CELLS: tuple[str, ...] = (
    *(name for category, subtasks in CATEGORIES.items() for name in (*subtasks, category)),
    OVERALL_CELL,
)
"""Cells in the order of Table 2: the subtasks of a category, its average, ..., the overall one."""

_COLUMNS = (
    "model",
    "cell",
    "n",
    "expected",
    *FAILURES,
    "correct",
    "accuracy",
    "each_rotation",
    "seeds",
    "accuracy_mean",
    "accuracy_sd",
    "chance",
)


@dataclass(frozen=True)
class Showing:
    """How a run showed its questions."""

    options_as: str = "images"
    circular: bool = False
    blind: bool = False
    wrong_image: bool = False

    @property
    def rotations(self) -> int:
        """How often each question was asked with one seed."""
        return len(LETTERS) if self.circular else 1


def showing(run: Run) -> Showing:
    """What the run's suite says of it."""
    section = run.manifest.get("suite", {}).get("vqa", {})
    return Showing(**{name: section[name] for name in Showing.__annotations__ if name in section})


@once_per_run
def questions_frame(run: Run) -> pd.DataFrame:
    """Accuracies in [0, 1] by model and cell (`CELLS`), in the suite's order of models.

    Of a subtask, `n` samples are scored of `expected` (seeds and rotations each count), the
    failures are counted by kind, `correct` were answered right. `accuracy` is the headline: the
    share of them, or under circular evaluation the share of questions of which every rotation was
    answered right, while `each_rotation` is then the share over single rotations. Of a category
    and overall it is the unweighted mean, NaN unless each part has a value. `*_mean` and `*_sd`
    (ddof = 1) are taken over seeds, `chance` is what uniform guessing would give. Where a model
    said nothing at all in a subtask, nothing was measured: NaN.
    """
    rows: list[dict[str, Any]] = []
    for model in run.design.model_names:
        rows += _rows_of(run, model)
    return pd.DataFrame(rows, columns=list(_COLUMNS))


@once_per_run
def questions_counted(run: Run) -> pd.DataFrame:
    """The questions behind `questions_frame`: model, subtask, scene, question, seed, correct, n.

    One row a model, question and seed, `correct` 0 or 1, `n` 1; with rotations it is right only if
    each of them is. Subtasks in which a model said nothing are left out.
    """
    records = run.records[run.records["track"] == _TRACK]
    keys = ["model", "subtask", "scene", "question", "seed"]
    rows = records[keys].assign(
        correct=records["given"].eq(records["right"]).fillna(False).astype("int64"),
        left_out=records["outcome"].isin(run.design.outcomes_left_out),
        replied=~records["outcome"].isin(WITHOUT_REPLY),
    )
    asked = rows.groupby(keys, sort=True).agg(
        {"correct": "sum", "left_out": "any", "replied": "any"}
    )
    asked["replied"] = asked.groupby(["model", "subtask"])["replied"].transform("any")
    kept = asked[asked["replied"].astype(bool) & ~asked["left_out"].astype(bool)]
    correct = (kept["correct"] == showing(run).rotations).astype("int64")
    return pd.DataFrame({"correct": correct, "n": 1}, index=kept.index).reset_index()


def letters_frame(run: Run) -> pd.DataFrame:
    """How often each letter was right and was given [%], by model, without ordering.

    `n` answers were scored; `unread` of them (all failures) have no letter. Columns `right_a`,
    `given_a` to `given_d`.
    """
    rows = []
    for model in run.design.model_names:
        answers = _answers(_scored(run, model))
        rates = letter_rates(answers)
        row: dict[str, Any] = {"model": model, "n": rates.n}
        row["unread"] = rates.n - sum(rates.given.values())
        for letter in LETTERS:
            for kind, counts in (("right", rates.right), ("given", rates.given)):
                share = 100 * counts[letter] / rates.n if rates.n else np.nan
                row[f"{kind}_{letter.lower()}"] = share
        rows.append(row)
    names = [f"{kind}_{letter.lower()}" for letter in LETTERS for kind in ("right", "given")]
    return pd.DataFrame(rows, columns=["model", "n", "unread", *names])


def _rows_of(run: Run, model: str) -> list[dict[str, Any]]:
    shown = showing(run)
    samples = _of_model(run, model)
    scored = _scored(run, model)
    values = _values(scored, shown)
    each = {name: one.value for name, one in subtask_accuracies(_answers(scored)).items()}
    by_seed = [_cells(_values(part, shown)) for _, part in scored.groupby("seed", sort=True)]
    cells, singles = _cells(values), _cells({n: each[n] for n in SUBTASKS if values[n] is not None})
    guessed = _cells(_chances(shown, values))
    expected = _expected(run)
    rows: list[dict[str, Any]] = []
    for cell in CELLS:
        parts = subtasks_of(cell)
        mine, here = (frame[frame["subtask"].isin(parts)] for frame in (samples, scored))
        known = [seed[cell] for seed in by_seed if not np.isnan(seed[cell])]
        rows.append(
            {
                "model": model,
                "cell": cell,
                "n": len(here),
                "expected": sum(expected.get(name, 0) for name in parts),
                **{failure: int((mine["outcome"] == failure).sum()) for failure in FAILURES},
                "correct": int((here["given"] == here["right"]).sum()),
                "accuracy": cells[cell],
                "each_rotation": singles[cell],
                "seeds": len(known),
                "accuracy_mean": float(np.mean(known)) if known else np.nan,
                "accuracy_sd": float(np.std(known, ddof=1)) if len(known) > 1 else np.nan,
                "chance": guessed[cell],
            }
        )
    return rows


def subtasks_of(cell: str) -> tuple[str, ...]:
    """The subtasks that one of `CELLS` stands for."""
    if cell == OVERALL_CELL:
        return SUBTASKS
    return next((parts for name, parts in CATEGORIES.items() if name == cell), (cell,))


def _of_model(run: Run, model: str) -> pd.DataFrame:
    records = run.records
    return records[(records["track"] == _TRACK) & (records["model"] == model)]


def _scored(run: Run, model: str) -> pd.DataFrame:
    """Samples that count; under `missing: skip` a question goes with all its rotations."""
    samples = _of_model(run, model)
    left_out = samples["outcome"].isin(run.design.outcomes_left_out)
    if not left_out.any():
        return samples
    names = pd.Series(list(zip(samples["question"], samples["seed"], strict=True)), samples.index)
    return samples[~names.isin(set(names[left_out]))]


def _answers(samples: pd.DataFrame) -> list[Answered]:
    columns = ("question", "seed", "subtask", "right", "given", "rotation")
    return [
        Answered(f"{question} s{seed}", subtask, right, given, int(rotation))
        for question, seed, subtask, right, given, rotation in zip(
            *(samples[name] for name in columns), strict=True
        )
    ]


def _values(samples: pd.DataFrame, shown: Showing) -> dict[Subtask, float | None]:
    """The headline accuracy of every subtask, None where the model said nothing."""
    answers = _answers(samples)
    found = circular(answers, shown.rotations) if shown.circular else subtask_accuracies(answers)
    replied = set(samples.loc[~samples["outcome"].isin(WITHOUT_REPLY), "subtask"])
    return {name: one.value if name in replied else None for name, one in found.items()}


def _chances(shown: Showing, values: dict[Subtask, float | None]) -> dict[Subtask, float | None]:
    asked: Iterable[Subtask] = (name for name in SUBTASKS if values[name] is not None)
    return {name: chance(name) ** shown.rotations for name in asked}


def _cells(values: dict[Subtask, float | None]) -> dict[str, float]:
    """Subtasks, categories and overall, NaN where there is no value."""
    means = macro_accuracy(values)
    found: dict[str, float | None] = {name: values.get(name) for name in SUBTASKS}
    for category, mean in means.categories.items():
        found[category] = mean
    found[OVERALL_CELL] = means.overall
    return {name: np.nan if value is None else value for name, value in found.items()}


def _expected(run: Run) -> dict[str, int]:
    """Samples of each subtask that a complete run holds of one model."""
    told = run.manifest.get("tracks", {}).get(_TRACK, {}).get("by_subtask", {})
    return {name: count * len(run.design.suite.seeds) for name, count in told.items()}
