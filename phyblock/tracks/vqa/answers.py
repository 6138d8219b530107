"""Answers to questions: which count, which are right, which letters were given."""

from __future__ import annotations

import pandas as pd

from phyblock.domain import CATEGORIES, LETTERS, SUBTASKS
from phyblock.scoring.counts import letter_rates
from phyblock.tables.load import Run, made_once_copied
from phyblock.tables.measures import CELL
from phyblock.tables.outcomes import has_reply
from phyblock.tables.shares import shares_of
from phyblock.tracks.vqa.spec import VqaSpec

__all__ = [
    "CELLS",
    "OVERALL_CELL",
    "answers_of",
    "expected_answers",
    "letters_frame",
    "question_digest",
    "questions_counted",
    "scored_answers",
    "showing",
    "subtasks_of",
]

_TRACK = "vqa"
_RIGHT_GIVEN = ("right", "given")
OVERALL_CELL = "overall"
CELLS: tuple[str, ...] = (
    *(name for category, subtasks in CATEGORIES.items() for name in (*subtasks, category)),
    OVERALL_CELL,
)
"""Cells in the order of Table 2: the subtasks of a category, its average, ..., the overall one."""


def showing(run: Run) -> VqaSpec:
    """What the run's suite says of it."""
    return run.section("vqa", VqaSpec)


def question_digest(run: Run) -> str | None:
    """Digest of the set that the run's questions were chosen from; None where it is not told."""
    return run.manifest.tracks.get(_TRACK, {}).get("questions")


@made_once_copied
def questions_counted(run: Run) -> pd.DataFrame:
    """The questions behind accuracies: model, subtask, scene, question, seed, variant, correct,
    n.

    One row a model, question, seed and variant, `correct` 0 or 1, `n` 1; with rotations it is
    right only if each of them is. Subtasks in which a model said nothing are left out.
    """
    records = run.records[run.records["track"] == _TRACK]
    keys = ["model", "subtask", "scene", "question", "seed", "variant"]
    rows = records[keys].assign(
        correct=records["given"].eq(records["right"]).fillna(False).astype("int64"),
        left_out=records["outcome"].isin(run.design.outcomes_left_out),
        replied=has_reply(records),
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
    `given_a` to `given_d`, the latter with `*_lo` and `*_hi`, the ends of 95 % intervals. A model
    without any reply has no rates.
    """
    rows, counted = [], []
    for model in run.design.model_names:
        answers = scored_answers(run, model)
        rates = letter_rates(zip(answers["right"], answers["given"], strict=True))
        unread = rates.n - sum(rates.given.values())
        rows.append({"model": model, "n": rates.n, "unread": unread})
        counted.append(answers[answers["right"].str.len() == 1])
    named = {f"{kind}_{letter.lower()}": letter for letter in LETTERS for kind in _RIGHT_GIVEN}
    answers = pd.concat(counted)
    letters = {name: (answers[name[:5]] == letter).astype(int) for name, letter in named.items()}
    replied = has_reply(answers)
    samples = answers[["model", "scene", "seed"]].assign(**letters, replied=replied, n=1)
    shares = 100 * shares_of(run, samples, list(named), whole="n").droplevel(CELL)
    columns = {f"{name}_share": name for name in named}
    columns |= {f"{n}_{end}": f"{n}_{end}" for n in named for end in ("lo", "hi") if n[0] == "g"}
    return pd.DataFrame(rows).join(shares[list(columns)].rename(columns=columns), on="model")


def subtasks_of(cell: str) -> tuple[str, ...]:
    """The subtasks that one of `CELLS` stands for."""
    if cell == OVERALL_CELL:
        return SUBTASKS
    return next((parts for name, parts in CATEGORIES.items() if name == cell), (cell,))


def answers_of(run: Run, model: str) -> pd.DataFrame:
    """Records of the questions that a model was asked."""
    records = run.records
    return records[(records["track"] == _TRACK) & (records["model"] == model)]


def scored_answers(run: Run, model: str) -> pd.DataFrame:
    """Samples that count; under `missing: skip` a question goes with all its rotations."""
    samples = answers_of(run, model)
    left_out = samples["outcome"].isin(run.design.outcomes_left_out)
    if not left_out.any():
        return samples
    names = pd.Series(
        list(zip(*(samples[name] for name in ("question", "seed", "variant")), strict=True)),
        samples.index,
    )
    return samples[~names.isin(set(names[left_out]))]


def expected_answers(run: Run) -> dict[str, int]:
    """Samples of each subtask that a complete run holds of one model."""
    asked = run.manifest.tracks.get(_TRACK, {}).get("by_subtask", {})
    return {name: count * run.design.repeats for name, count in asked.items()}
