"""Measures of plans by level: steps, whole plans, wrong steps by type, outcomes of blocks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from phyblock.errors import Problem, SpecError
from phyblock.results.text import Column, TextTable
from phyblock.scoring.counts import f1_of, precision_of, recall_of
from phyblock.scoring.plan import BLOCK_OUTCOMES, ERROR_TYPES, BlockOutcome, ErrorType
from phyblock.sim.film import FilmStep, Tone
from phyblock.tracks.full_planning import PLAN_FLOORS, POSE_MEASURES, PlanRecord
from phyblock.tracks.measures import (
    EpisodeView,
    HeadlineColumn,
    Measure,
    SampleCounts,
    TrackReport,
    share,
)

if TYPE_CHECKING:
    import pandas as pd

    from phyblock.data import AssemblyTask
    from phyblock.domain import Block
    from phyblock.results.load import Run

NAME = "full_planning"

ERROR_NAMES: dict[ErrorType, str] = {
    "shape_not_in_gt": "Shape not in GT",
    "overflow": "Overflow",
    "incorrect_orientation": "Incorrect orientation",
    "dependency_not_met": "Dependency not met",
}
_ERROR_MEANINGS: dict[ErrorType, str] = {
    "shape_not_in_gt": "wrong steps with a type and color that no block of the goal has",
    "overflow": "wrong steps with a kind of which all blocks of the goal are placed already",
    "incorrect_orientation": "wrong steps with a block that the goal has in another orientation",
    "dependency_not_met": "wrong steps with a block whose supports are not placed",
}
BLOCK_NAMES: dict[BlockOutcome, str] = {
    "placed": "Placed",
    "left_out": "Left out",
    "wrong_kind": "Wrong kind",
    "wrong_orientation": "Wrong orientation",
    "support_not_named": "Support never named",
    "support_turned": "Support turned wrongly",
    "support_both": "Supports of both sorts",
    "order": "Order",
}
_BLOCK_MEANINGS: dict[BlockOutcome, str] = {
    "placed": "blocks placed",
    "left_out": "blocks for which a plan has no step left",
    "wrong_kind": "blocks in whose place a plan names a kind not needed, or not so often",
    "wrong_orientation": "blocks named in another pose",
    "support_not_named": "blocks named that rest on one that was never named",
    "support_turned": "blocks named that rest on one that was named in another pose",
    "support_both": "blocks named that rest on one of each sort",
    "order": "blocks that another order of a plan's steps would place",
}
_SUPPORTS = ("blocks_support_not_named", "blocks_support_turned", "blocks_support_both")


def _steps(run: Run) -> pd.DataFrame:
    """Under `membership` steps count over again, so that no plan has a value of its own."""
    rows = run.scored(NAME, ("tp", "fp", "fn"))
    alone = rows["criterion"] != "membership"
    whole = alone & (rows["fp"] == 0) & (rows["fn"] == 0)
    f1 = np.nan_to_num(f1_of(rows[["tp", "fp", "fn"]].to_numpy(np.float64)))
    return rows.assign(whole=whole.astype("int64"), f1=alone * f1, plans=alone.astype("int64"))


def _wrong_steps(run: Run) -> pd.DataFrame:
    rows = run.scored(NAME, ERROR_TYPES)
    rows = rows[rows["criterion"] == "aov"]
    return rows.assign(wrong=rows[list(ERROR_TYPES)].sum(axis=1))


def _in_order(run: Run) -> pd.DataFrame:
    """Plans whose order counts; those that an earlier version scored are left out."""
    outcomes = [f"blocks_{name}" for name in BLOCK_OUTCOMES]
    rows = run.scored(NAME, ("tp", "fp", "fn", "kept", *outcomes))
    rows = rows[(rows["criterion"] == "aov") & rows["kept"].notna()]
    blocks, steps = rows["tp"] + rows["fn"], rows["tp"] + rows["fp"]
    distance = 1 - 2 * rows["kept"].astype("float64") / (blocks + steps)
    return rows.assign(blocks=blocks, distance=distance, plans=1)


_STEPS = SampleCounts("steps", ("tp", "fp", "fn", "whole", "f1", "plans"), _steps)
_WRONG = SampleCounts("wrong_steps", (*ERROR_TYPES, "wrong"), _wrong_steps)
_BLOCKS = SampleCounts(
    "blocks",
    (*(f"blocks_{name}" for name in BLOCK_OUTCOMES), "blocks", "distance", "plans"),
    _in_order,
)

PLANNING_MEASURES = (
    Measure(
        "f1", "F1", _STEPS, f1_of, "harmonic mean of precision and recall", over="steps",
        floors=PLAN_FLOORS,
    ),
    Measure(
        "precision", "Precision", _STEPS, precision_of, "right steps of those proposed",
        over="steps",
    ),
    Measure(
        "recall", "Recall", _STEPS, recall_of, "blocks of the goal that a right step placed",
        over="blocks",
    ),
    share(_STEPS, "whole", "plans", "Whole plans", name="success",
          meaning="plans that place every block, by right steps alone"),
    share(_STEPS, "f1", "plans", "Macro F1", name="macro_f1",
          meaning="mean F1 of single plans, 0 for an empty one"),
    share(_BLOCKS, "distance", "plans", "Distance to a valid order", better="lower",
          meaning="fewest steps to leave out and blocks to put in until a plan is a valid order, "
          "of steps and blocks together"),
    *(
        share(_BLOCKS, f"blocks_{name}", "blocks", BLOCK_NAMES[name],
              meaning=_BLOCK_MEANINGS[name], better="higher" if name == "placed" else "lower")
        for name in BLOCK_OUTCOMES
    ),
    share(_BLOCKS, _SUPPORTS, "blocks", "Support missing", name="blocks_support", better="lower",
          meaning="blocks named that rest on one that was not, or in another pose"),
    *POSE_MEASURES,
    *(
        share(_WRONG, name, "wrong", ERROR_NAMES[name], name=f"wrong_{name}", better="lower",
              meaning=_ERROR_MEANINGS[name], over="wrong steps")
        for name in ERROR_TYPES
    ),
)  # fmt: skip

_MAIN = "Overall F1"


def _headline(run: Run) -> tuple[HeadlineColumn, ...]:
    cells = run.level_cells()
    levels = [
        HeadlineColumn("f1", cell.name, _MAIN if cell == cells[-1] else cell.heading)
        for cell in cells
    ]
    sides = [
        HeadlineColumn(name, cells[-1].name, name.capitalize()) for name in ("precision", "recall")
    ]
    return (*levels, *sides)


def _notes(run: Run) -> Sequence[str]:
    design = run.design
    level1 = f", Level 1 by {design.suite.scoring.level1}" if 1 in design.suite.levels else ""
    return (
        f"F1 in percent. Setting {design.setting}, matcher {design.matcher}{level1}; micro "
        "averages.",
    )


def _check_alike(run: Run, first: Run, levels: Sequence[str], _: Measure) -> None:
    suite, wanted = run.design.suite, first.design
    needed: list[tuple[str, Sequence[str], str]] = [
        ("settings", suite.settings, wanted.setting),
        ("scoring.matchers", suite.scoring.matchers, wanted.matcher),
    ]
    known = ("aov", suite.scoring.level1)
    needed += [("scoring.level1", known, wanted.criterion(level)) for level in levels]
    for what, names, name in needed:
        if name not in names:
            hint = "phyblock score reads stored replies again under other rules"
            message = f"was not scored as {first.path} was, by {name}"
            raise SpecError(Problem(str(run.path), message, what, ", ".join(names), hint=hint))


def _steps_of(record: PlanRecord) -> Iterator[tuple[int, int, int | None, str]]:
    """Number, candidate, block of the goal that it placed from 0, and what became of each step.

    By the first score that knows single steps, which is of the headline setting and matcher.
    """
    score = next((score for score in record.scores if score.placed is not None), None)
    if score is None or score.placed is None or score.why is None or record.parse is None:
        return
    for n, (candidate, vertex, why) in enumerate(
        zip(record.parse.plan, score.placed, score.why, strict=True), 1
    ):
        outcome = "placed" if vertex is not None else dict(ERROR_NAMES.items())[why]  # type: ignore[index]
        yield n, candidate, vertex, outcome


def _outcome(record: PlanRecord) -> str:
    score = next((score for score in record.scores if score.placed is not None), None)
    return "no step is known" if score is None else f"{score.tp} of {record.n_blocks} blocks placed"


def _table(record: PlanRecord) -> TextTable:
    """Every step: the candidate that it names, and what became of it."""
    rows = tuple((str(n), str(one), outcome) for n, one, _, outcome in _steps_of(record))
    columns = (Column("Step"), Column("Block"), Column("Outcome", is_text=True))
    return TextTable(f"{record.sample}: {_outcome(record)}", columns, rows)


def _film(record: PlanRecord, task: AssemblyTask) -> Iterator[FilmStep]:
    """A frame for the empty ground, one a step, and one for what came of the plan.

    A right step puts a block at its place in the goal; a wrong one puts none.
    """
    yield FilmStep(f"{record.model}, {task.scene.id}", "plain", None, ())
    blocks: tuple[Block, ...] = ()
    for n, candidate, vertex, outcome in _steps_of(record):
        tone: Tone = "good" if vertex is not None else "bad"
        blocks += () if vertex is None else (task.scene.blocks[vertex],)
        yield FilmStep(f"{n}. block {candidate}: {outcome}", tone, candidate, blocks)
    tone = "good" if len(blocks) == len(task.scene.blocks) else "bad"
    yield FilmStep(_outcome(record), tone, None, blocks)


REPORT = TrackReport(
    measures=PLANNING_MEASURES,
    cells=lambda run: run.level_cells(),
    in_cells=lambda rows, run: run.in_levels(rows),
    headline=_headline,
    main=_MAIN,
    short="f1",
    notes=_notes,
    check_alike=_check_alike,
    showing=lambda run: run.showing(NAME),
    episodes=EpisodeView(_table, _film),
)
