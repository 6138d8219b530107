"""What full planning measures of a plan: its steps, the whole of it, and what became of the goal's
blocks; by level (paper section 4.1).
"""

from __future__ import annotations

import math
import re
from collections.abc import Hashable, Iterator, Mapping, Sequence
from functools import partial
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from phyblock.data import AssemblyTask
from phyblock.domain import Block
from phyblock.errors import Problem, SpecError
from phyblock.records.record import Score
from phyblock.scoring.counts import Floats, f1_of, precision_of, ratio_of, recall_of
from phyblock.scoring.plan import BLOCK_OUTCOMES, ERROR_TYPES, BlockOutcome, ErrorType
from phyblock.scoring.statistics import Clusters, bounded, jackknife
from phyblock.sim.film import FilmStep, Tone
from phyblock.tables.cells import (
    METRIC_NAMES,
    METRICS,
    cell_scores,
    in_levels,
    level_cells,
    measured,
    with_levels,
)
from phyblock.tables.cost import cost_frame
from phyblock.tables.design import OVERALL, Design
from phyblock.tables.drawing import (
    ACCENT,
    COLORS,
    GRID,
    INK,
    MUTED,
    PALE,
    bare_axes,
    drawn_width_in,
    headed,
    legend_below,
    name_across,
    names_width_in,
    new_figure,
    text_width_in,
)
from phyblock.tables.flat import BLOCK_COLUMNS, joined_counts
from phyblock.tables.headline import (
    headline_rows,
    seeds_notes,
    uncertainty_cells,
    uncertainty_columns,
)
from phyblock.tables.intervals import base_scenes, grouped, parents_of, summed
from phyblock.tables.load import Run, made_once_copied
from phyblock.tables.measures import CELL, Measure, SampleCounts
from phyblock.tables.outcomes import FAILURES, has_reply
from phyblock.tables.paper_numbers import HUMAN_NOTE, beside, beside_by_level, published_table
from phyblock.tables.shares import joined_shares, share_texts, shares_of
from phyblock.tables.showing import planning_words
from phyblock.tables.text_table import (
    NO_VALUE,
    SPREAD,
    Column,
    TextTable,
    between,
    level_name,
    number,
    with_interval,
)
from phyblock.tables.track_report import (
    EpisodeView,
    FigureMaker,
    HeadlineColumn,
    PaperTable,
    SceneFigure,
    TableMaker,
    TrackReport,
)
from phyblock.text import counted
from phyblock.tracks.estimates import track_estimates
from phyblock.tracks.figures import NAMED, Part, inference, line_look, share_bars, stack
from phyblock.tracks.full_planning import PLAN_FLOORS, PlanRecord
from phyblock.tracks.plans import POSE_MEASURES
from phyblock.tracks.tables import (
    order_frame,
    order_view,
    scenes_frame,
    scenes_view,
)

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NAME = "full_planning"


def is_asked(run: Run) -> bool:
    """Whether the run has plans."""
    return NAME in run.design.suite.tracks


def _scored(run: Run) -> pd.DataFrame:
    scores = cell_scores(run)
    scores = scores[scores["track"] == NAME].rename(columns={"level": CELL})
    return scores.assign(item=scores["scene"], replied=has_reply(scores))


def _steps(run: Run) -> pd.DataFrame:
    """Under `membership` steps count over again, so that no plan has a value of its own."""
    rows = _scored(run)
    alone = rows["criterion"] != "membership"
    whole = alone & (rows["fp"] == 0) & (rows["fn"] == 0)
    f1 = np.nan_to_num(f1_of(rows[["tp", "fp", "fn"]].to_numpy(np.float64)))
    return rows.assign(whole=whole.astype("int64"), f1=alone * f1, plans=alone.astype("int64"))


def _in_order(run: Run) -> pd.DataFrame:
    """Plans whose order counts; those that an earlier version scored are left out."""
    rows = _scored(run)
    rows = rows[(rows["criterion"] == "aov") & rows["kept"].notna()]
    blocks, steps = rows["tp"] + rows["fn"], rows["tp"] + rows["fp"]
    distance = 1 - 2 * rows["kept"].astype("float64") / (blocks + steps)
    return rows.assign(blocks=blocks, distance=distance, plans=1)


_STEPS = SampleCounts("steps", ("tp", "fp", "fn", "whole", "f1", "plans"), _steps)
BLOCK_COUNTS = SampleCounts(
    "blocks", (*BLOCK_COLUMNS.values(), "blocks", "distance", "plans"), _in_order
)

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
_SUPPORTS: tuple[BlockOutcome, ...] = ("support_not_named", "support_turned", "support_both")


def block_measure(outcome: BlockOutcome) -> str:
    """Name of the measure of an outcome: its share of the goals' blocks."""
    return BLOCK_COLUMNS[outcome]


def _share(outcomes: tuple[BlockOutcome, ...], sums: Floats) -> Floats:
    parts = sums[..., [BLOCK_OUTCOMES.index(outcome) for outcome in outcomes]].sum(axis=-1)
    return ratio_of(np.stack([parts, sums[..., len(BLOCK_OUTCOMES)]], axis=-1))


def _mean(counted: SampleCounts, column: str, sums: Floats) -> Floats:
    """Mean over plans of what was summed in a column."""
    columns = counted.columns
    return ratio_of(sums[..., [columns.index(column), columns.index("plans")]])


SUPPORT_MISSING = Measure(
    "blocks_support", "Support missing", BLOCK_COUNTS, partial(_share, _SUPPORTS),
    "blocks named that rest on one that was not, or in another pose", better="lower",
    over="blocks", in_tables=False,
)  # fmt: skip

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
    Measure(
        "success", "Whole plans", _STEPS, partial(_mean, _STEPS, "whole"),
        "plans that place every block, by right steps alone", over="plans",
    ),
    Measure(
        "macro_f1", "Macro F1", _STEPS, partial(_mean, _STEPS, "f1"),
        "mean F1 of single plans, 0 for an empty one", over="plans",
    ),
    Measure(
        "distance", "Distance to a valid order", BLOCK_COUNTS,
        partial(_mean, BLOCK_COUNTS, "distance"),
        "fewest steps to leave out and blocks to put in until a plan is a valid order, of steps "
        "and blocks together", better="lower", over="plans",
    ),
    *(
        Measure(
            block_measure(outcome), BLOCK_NAMES[outcome], BLOCK_COUNTS,
            partial(_share, (outcome,)), _BLOCK_MEANINGS[outcome], over="blocks",
            better="higher" if outcome == "placed" else "lower", in_tables=False,
        )
        for outcome in BLOCK_OUTCOMES
    ),
    SUPPORT_MISSING,
    *POSE_MEASURES,
)  # fmt: skip


_CELL = ("model", "track", "setting", "matcher", "criterion", "level")
_GROUP = ("model", "track", "level")
_PLURALS = {"parse_failure": "parse_failures", "api_error": "api_errors", "refusal": "refusals"}
_OUTCOMES = {outcome: _PLURALS.get(outcome, outcome) for outcome in FAILURES}
_SUMS = ("tp", "fp", "fn")
_SPREAD = tuple(f"{metric}_{what}" for metric in METRICS for what in ("mean", "sd"))
_INTERVALS = tuple(f"{metric}_{end}" for metric in METRICS for end in ("lo", "hi", "se"))
_COUNTS = ("n", *_OUTCOMES.values(), *_SUMS, "seeds", "n_scenes", "n_clusters")

ASSEMBLY_COLUMNS = (
    *_CELL,
    "n",
    "expected",
    *_OUTCOMES.values(),
    *_SUMS,
    *METRICS,
    "seeds",
    *_SPREAD,
    "n_scenes",
    "n_clusters",
    *_INTERVALS,
    "seed_note",
)
"""Columns of `assembly.csv`."""


@made_once_copied
def assembly_frame(run: Run) -> pd.DataFrame:
    """Every model, setting, matcher and level, in the suite's order, in `ASSEMBLY_COLUMNS`.

    `n` samples are scored of `expected`; tp, fp, fn are sums over them and precision, recall, f1
    the micro averages in [0, 1], NaN where undefined. `*_mean` and `*_sd` (ddof = 1) are taken
    over the micro averages of the `seeds` single seeds; `*_lo`, `*_hi` bound a 95 % interval and
    `*_se` is its standard error, from leaving out the `n_clusters` base scenes that the `n_scenes`
    scenes were made from (see `estimate_frame`). A cell in which no sample has a reply has
    counts, if the suite counts empty plans, but no metrics: nothing was measured. `matcher` is ""
    for a Level-1 criterion that knows none.
    """
    keys = list(_CELL)
    frame = (
        _cells(run)
        .join(_sums(run), on=keys)
        .join(_estimates(run), on=keys)
        .join(_outcomes(run), on=list(_GROUP))
    )
    frame[list(_COUNTS)] = joined_counts(frame[list(_COUNTS)])
    notes = _seed_notes(run)
    frame["seed_note"] = [notes.get(model, "") for model in frame["model"]]
    return frame[list(ASSEMBLY_COLUMNS)]


def _cells(run: Run) -> pd.DataFrame:
    design = run.design
    rows = [
        (model, NAME, setting, matcher, criterion, level, design.expected(level))
        for model in design.model_names
        if is_asked(run)
        for setting in design.suite.settings
        for level, criterion in ((level, design.criterion(level)) for level in design.levels)
        for matcher in design.matchers(criterion)
    ]
    return pd.DataFrame(rows, columns=[*_CELL, "expected"])


def _sums(run: Run) -> pd.DataFrame:
    groups = cell_scores(run).groupby(list(_CELL), sort=False)
    summed = groups[list(_SUMS)].sum()
    summed.insert(0, "n", groups.size())
    return summed


def _estimates(run: Run) -> pd.DataFrame:
    """Metrics with spread and interval by cell."""
    names = {"value": "", "mean": "_mean", "sd": "_sd", "lo": "_lo", "hi": "_hi", "se": "_se"}
    estimates = track_estimates(run, NAME).rename(columns={CELL: "level"}).assign(track=NAME)
    parts = []
    for metric in METRICS:
        mine = estimates[estimates["measure"] == metric].set_index(list(_CELL))
        named = mine[list(names)].rename(columns={k: f"{metric}{end}" for k, end in names.items()})
        parts.append(named.astype("float64"))
    return pd.concat([*parts, mine[["seeds", "n_scenes", "n_clusters"]]], axis=1)


def _outcomes(run: Run) -> pd.DataFrame:
    """How many samples ended other than well, by model, track and level."""
    samples = run.records[["sample", "model", "track"]]
    for outcome, column in _OUTCOMES.items():
        samples = samples.assign(**{column: (run.records["outcome"] == outcome).astype("int64")})
    return with_levels(samples, run).groupby(list(_GROUP))[list(_OUTCOMES.values())].sum()


def _seed_notes(run: Run) -> dict[str, str]:
    refused = run.records.loc[~run.records["seed_sent"].fillna(True).astype(bool), "model"]
    repeats = len(run.design.suite.seeds)
    note = f"seed unsupported: {counted(repeats, 'independent repeat')}"
    return dict.fromkeys(refused.unique(), note)


def table1_frame(run: Run) -> pd.DataFrame:
    """The paper's Table 1: one row a model, in percent, unrounded, NaN where undefined.

    Columns are `model`, then for each level `level1_precision`, `level1_recall`, `level1_f1`, ...
    to `overall_f1`, from the headline matcher and setting, pooled over seeds; then the ends
    `overall_f1_lo` and `overall_f1_hi` of its interval. With more than one seed
    `level1_precision_mean` and `level1_precision_sd` etc., over single seeds, follow.
    """
    design = run.design
    cells = headline_cells(assembly_frame(run), design).set_index(["model", "level"])
    shown = [(level, metric) for level in design.levels for metric in METRICS]
    wanted = [(*of, "") for of in shown] + [(OVERALL, "f1", end) for end in ("_lo", "_hi")]
    if len(design.suite.seeds) > 1:
        wanted += [(*of, end) for of in shown for end in ("_mean", "_sd")]
    table = pd.DataFrame({"model": list(design.model_names)})
    for level, metric, end in wanted:
        values = cells[f"{metric}{end}"].xs(level, level="level")
        table[level_column(level, metric) + end] = 100 * table["model"].map(values)
    return table


def headline_cells(
    assembly: pd.DataFrame, design: Design, *, matcher: str = "", setting: str = ""
) -> pd.DataFrame:
    """One row a model and level, of one matcher and setting (the headline ones)."""
    return assembly[
        (assembly["setting"] == (setting or design.setting))
        & assembly["matcher"].isin(["", matcher or design.matcher])
    ]


def level_column(level: str, metric: str) -> str:
    """Column of `table1_frame` for a level and metric."""
    return f"{level if level == OVERALL else f'level{level}'}_{metric}"


def levels_in_order(run: Run) -> tuple[str, ...]:
    """Levels whose criterion goes by the order of steps: no other knows the four types.

    Level 1 by its own criterion is left out: the scenes that it shares with level 2 would only be
    counted again, by an order that it does not ask for.
    """
    return tuple(level for level in run.design.levels if run.design.criterion(level) == "aov")


@made_once_copied
def errors_frame(run: Run) -> pd.DataFrame:
    """One row a model and level of `levels_in_order`: n, wrong_steps, each type's count and share.

    Headline matcher and setting. Shares are of all wrong steps, in [0, 1], NaN where no step was
    wrong; `<type>_lo` and `<type>_hi` bound their 95 % intervals.
    """
    design, levels = run.design, levels_in_order(run)
    scores = run.scores[
        (run.scores["track"] == NAME)
        & (run.scores["criterion"] == "aov")
        & (run.scores["setting"] == design.setting)
        & (run.scores["matcher"] == design.matcher)
        & ~run.scores["outcome"].isin(design.outcomes_left_out)
    ][["sample", "model", "scene", "seed", "outcome", *ERROR_TYPES]]
    rows = with_levels(scores, run)
    n = rows.groupby(["model", "level"]).size().rename("n")
    cells = [(model, level) for model in design.model_names for level in levels]
    table = pd.DataFrame(cells, columns=["model", "level"]).join(n, on=["model", "level"])
    table["n"] = table["n"].fillna(0).astype("int64")
    rows = rows.rename(columns={"level": CELL})
    rows["replied"] = has_reply(rows)
    of_level = [cell for cell in level_cells(run) if cell.name in levels]
    shares = shares_of(run, rows, ERROR_TYPES, of_level)
    table = joined_shares(table, shares, ["model", "level"])
    return table.rename(columns={"whole": "wrong_steps"})


_ROWS = {block_measure(outcome): BLOCK_NAMES[outcome] for outcome in BLOCK_OUTCOMES}
_NUMBERS = ("value", "lo", "hi", "se")
_COLUMNS = ("model", "level", "outcome", *_NUMBERS, "n", "n_scenes", "n_clusters")


@made_once_copied
def losses_frame(run: Run) -> pd.DataFrame:
    """One row a model, level and outcome: its share of the goals' blocks, with a 95 % interval [%].

    Headline setting and matcher, levels whose criterion is `aov`; `n` plans. The outcomes sum to
    100; `support`, beside them, is the sum of the three of missing supports. Plans that an earlier
    version scored are left out.
    """
    estimates = headline_rows(track_estimates(run, NAME), run.design)
    names = [*_ROWS, SUPPORT_MISSING.name]
    rows = estimates[estimates["measure"].isin(names)].rename(columns={CELL: "level"})
    models = list(run.design.model_names)
    places = [
        rows["model"].map(models.index),
        rows["level"].map(run.design.levels.index),
        rows["measure"].map(names.index),
    ]
    order = pd.concat(places, axis=1, keys=["model", "level", "measure"])
    rows = rows.loc[order.sort_values(["model", "level", "measure"]).index]
    numbers = 100 * rows[list(_NUMBERS)].astype("float64")
    outcomes = rows["measure"].str.removeprefix(f"{BLOCK_COUNTS.name}_")
    return rows.assign(**numbers, outcome=outcomes)[list(_COLUMNS)].reset_index(drop=True)


def losses_view(table: pd.DataFrame, run: Run) -> TextTable:
    """A row a model and outcome out of `losses_frame`, a share and its interval a level."""
    design = run.design
    cells = {
        (row["model"], row["outcome"], row["level"]): with_interval(row)
        for row in table.to_dict("records")
    }
    levels = [level for level in design.levels if level in set(table["level"])]
    rows = []
    for model in dict.fromkeys(table["model"]):
        for place, outcome in enumerate(BLOCK_OUTCOMES):
            values = [cells.get((model, outcome, level), (NO_VALUE,) * 2) for level in levels]
            label = "" if place else model
            rows.append((label, BLOCK_NAMES[outcome], *(text for both in values for text in both)))
    pairs = [Column(name, level_name(level)) for level in levels for name in ("%", "95 % CI")]
    return TextTable(
        f"What became of the goals' blocks{design.of_suite}",
        (Column("Model", is_text=True), Column("Outcome", is_text=True), *pairs),
        tuple(rows),
        (
            f"Setting {design.setting}, matcher {design.matcher}; shares of all blocks of the "
            "goals, which sum to 100. docs/scoring.md says what each outcome is.",
            *_lacking(run),
        ),
    )


def _lacking(run: Run) -> list[str]:
    """How many plans were scored before blocks were counted."""
    scores = cell_scores(run)
    mine = scores[
        (scores["track"] == NAME)
        & (scores["criterion"] == "aov")
        & (scores["setting"] == run.design.setting)
        & (scores["matcher"] == run.design.matcher)
        & (scores["level"] == run.design.levels[-1])
    ]
    if not (lacking := int(mine["kept"].isna().sum())):
        return []
    return [f"{lacking} plans were scored before this was counted; phyblock score counts them."]


PUBLISHED_LEVELS = ("1", "2", "3", "4", "overall")
"""Levels of the paper's Table 1, in its order."""
PUBLISHED_SETTING = "A"
"""The setting of every number in it."""

_OVERALL_LEVELS = frozenset({2, 3, 4})
"""Levels whose scenes the paper's overall numbers pool."""

_COLUMNS_PUBLISHED = (
    "model",
    "published_name",
    "level",
    "metric",
    "published",
    "ours",
    "difference",
    "criterion",
    "matcher",
    "n",
)


def published_frame(run: Run) -> pd.DataFrame:
    """15 rows for each model with a row in Table 1: published, ours, ours minus published [%].

    Ours is in setting A and not rounded; it is NaN for what the suite does not run: a level,
    `overall` without one of the levels 2, 3 and 4, everything without setting A. The `paper`
    matcher is compared where the run has it, else the headline one; `n` samples are behind our
    number.
    """
    design = run.design
    printed = published_table(1).rename(columns={"model": "published_name", "value": "published"})
    rows = set(printed["published_name"])
    matcher = "paper" if "paper" in design.suite.scoring.matchers else design.matcher
    ours = headline_cells(
        assembly_frame(run), design, matcher=matcher, setting=PUBLISHED_SETTING
    ).melt(
        id_vars=["model", "level", "criterion", "matcher", "n"],
        value_vars=list(METRICS),
        var_name="metric",
        value_name="ours",
    )
    cells = pd.DataFrame(
        [
            (model, name, level, metric)
            for model, name in design.published.items()
            if name in rows
            for level in PUBLISHED_LEVELS
            for metric in METRICS
        ],
        columns=["model", "published_name", "level", "metric"],
    )
    if not set(design.suite.levels) >= _OVERALL_LEVELS:
        ours = ours[ours["level"] != OVERALL]
    table = cells.merge(printed, on=["published_name", "level", "metric"], how="left")
    table = table.merge(ours, on=["model", "level", "metric"], how="left")
    table["ours"] = 100 * table["ours"]
    table["difference"] = table["ours"] - table["published"]
    table["n"] = table["n"].fillna(0).astype("int64")
    for name in ("criterion", "matcher"):
        table[name] = table[name].astype("object").fillna("")
    return table[list(_COLUMNS_PUBLISHED)]


def largest_differences(published: pd.DataFrame) -> pd.Series[float]:
    """Largest absolute difference of each model [percentage points], in the frame's order.

    NaN for a model of which no cell can be compared; `.max()` is the largest of all.
    """
    return published["difference"].abs().groupby(published["model"], sort=False).max()


def comparison_notes(published: pd.DataFrame, design: Design) -> tuple[str, ...]:
    """The largest difference of all, and what of the run could not be compared, as sentences."""
    compared = int(published["difference"].notna().sum())
    largest = number(largest_differences(published).max(), 3)
    notes = [f"Largest absolute difference of {compared} cells: {largest}."]
    known = set(published["model"])
    if without := [name for name in design.model_names if name not in known]:
        notes.append(f"No published row: {', '.join(without)}.")
    if PUBLISHED_SETTING not in design.suite.settings:
        notes.append(f"The paper's setting, {PUBLISHED_SETTING}, was not run.")
    if not set(design.suite.levels) >= _OVERALL_LEVELS:
        notes.append("Overall is not compared: the paper's pools the levels 2, 3 and 4.")
    return tuple(notes)


_PAPER_LEVELS = ("1", "2", "3", "4", OVERALL)


def table5_frame(run: Run) -> pd.DataFrame:
    """One row a model: `level1_mean`, `level1_sd`, ... `overall_sd` of F1 over seeds [%].

    Headline matcher and setting; sd with ddof = 1. Empty for a run of one seed or
    without full planning.
    """
    design = run.design
    cells = headline_cells(assembly_frame(run), design)
    names = design.model_names if is_asked(run) and len(design.suite.seeds) > 1 else ()
    table = pd.DataFrame({"model": list(names)})
    for level in design.levels:
        name = level if level == OVERALL else f"level{level}"
        of_level = cells[cells["level"] == level].set_index("model")
        for kind in ("mean", "sd"):
            table[f"{name}_{kind}"] = 100 * table["model"].map(of_level[f"f1_{kind}"])
    return table


def table5_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Mean and standard deviation of F1 a level out of `table5_frame`."""
    design = run.design
    rows = []
    for row in table.to_dict("records"):
        names = [level if level == OVERALL else f"level{level}" for level in design.levels]
        cells = [(row[f"{name}_mean"], row[f"{name}_sd"]) for name in names]
        rows.append((row["model"], *(_with_spread(mean, sd) for mean, sd in cells)))
    return TextTable(
        f"F1 as the paper's Table 5: means over {len(design.suite.seeds)} seeds (%)",
        (Column("Model", is_text=True), *(Column(level_name(level)) for level in design.levels)),
        tuple(rows),
        (
            f"Setting {design.setting}, matcher {design.matcher}; mean ± standard deviation over "
            "single seeds. All other tables pool the seeds.",
        ),
    )


def _with_spread(mean: float, sd: float) -> str:
    return number(mean, 2) if pd.isna(sd) else f"{number(mean, 2)}{SPREAD}{number(sd)}"


def intervals_table(run: Run) -> pd.DataFrame:
    """One row a model and level: f1, lo, hi, se [%], n, seeds, n_scenes, n_clusters.

    F1 is pooled over seeds, of the headline matcher and setting.
    """
    cells = headline_cells(assembly_frame(run), run.design)
    table = cells[["model", "level"]].copy()
    for name, column in {"f1": "f1", "lo": "f1_lo", "hi": "f1_hi", "se": "f1_se"}.items():
        table[name] = 100 * cells[column]
    kept = ["n", "seeds", "n_scenes", "n_clusters"]
    return pd.concat([table, cells[kept]], axis=1).reset_index(drop=True)


def intervals_view(table: pd.DataFrame, run: Run) -> TextTable:
    """F1 with its interval a level out of `intervals_table`."""
    design = run.design
    named = table.rename(columns={"f1": "value"}).to_dict("records")
    cells = {(row["model"], row["level"]): row for row in named}
    rows = [
        (
            model,
            *(text for level in design.levels for text in with_interval(cells[model, level])),
        )
        for model in design.model_names
    ]
    return TextTable(
        f"F1 with 95 % intervals (%){design.of_suite}",
        (
            Column("Model", is_text=True),
            *(
                Column(name, level_name(level))
                for level in design.levels
                for name in ("F1", "95 % CI")
            ),
        ),
        tuple(rows),
        (
            f"Setting {design.setting}, matcher {design.matcher}; F1 is pooled over "
            f"{counted(len(design.suite.seeds), 'seed')}.",
            *_sizes(table, run),
            "Intervals: each base scene left out in turn, micro averages taken anew.",
        ),
    )


def _sizes(table: pd.DataFrame, run: Run) -> list[str]:
    """How many scenes and base scenes are behind each level, at most over models."""
    most = table.groupby("level")[["n_scenes", "n_clusters"]].max()
    parts = [
        f"{level_name(level)} {most.loc[level, 'n_scenes']} ({most.loc[level, 'n_clusters']})"
        for level in run.design.levels
    ]
    return (
        [f"Scenes (base scenes): {', '.join(parts)}."] if len(table) else [f"No cell: {NO_VALUE}"]
    )


def paper_table5_frame(run: Run) -> pd.DataFrame:
    """Mean and sd of F1 over seeds by level beside the paper's Table 5."""
    table = table5_frame(run)
    rows = [
        (row["model"], level, f"f1_{kind}", row[f"{name}_{kind}"])
        for row in table.to_dict("records")
        for level in run.design.levels
        for name in (level if level == OVERALL else f"level{level}",)
        for kind in ("mean", "sd")
    ]
    ours = pd.DataFrame(rows, columns=["model", "level", "metric", "ours"])
    printed = published_table(5) if is_asked(run) else published_table(5).iloc[:0]
    return beside(printed, ours.astype({"ours": "float64"}), run, ["level", "metric"])


def paper_table5_view(table: pd.DataFrame, run: Run) -> TextTable:
    """A row a model and statistic out of `paper_table5_frame`."""
    kinds = {"f1_mean": "F1 mean", "f1_sd": "F1 sd"}
    columns, rows = beside_by_level(table, _PAPER_LEVELS, "Statistic", kinds, 2)
    note = (
        f"Ours: setting {run.design.setting}, matcher {run.design.matcher}. Both: means over "
        "single seeds, sd with ddof = 1; all other tables pool the seeds."
    )
    return TextTable("Our numbers beside the paper's Table 5 (%)", columns, rows, (note,))


_ENDS = {"value": "", "lo": "_lo", "hi": "_hi"}
_F1 = {
    f"f1_{setting.lower()}{end}": (setting, name)
    for setting, (name, end) in product("AB", _ENDS.items())
}
"""Columns of F1: its setting, and the column of estimates that it is taken from."""
_COLUMNS_SETTINGS = ("model", "level", *_F1, "difference", "lo", "hi", "n_scenes", "n_clusters")
_UNKNOWN = {"n_scenes": 0, "n_clusters": 0}


@made_once_copied
def settings_frame(run: Run) -> pd.DataFrame:
    """One row a model and level: F1 in A and in B, B minus A, all with 95 % intervals; in [0, 1].

    Headline matcher, the criterion of each level. Paired: a reply is scored
    under both. Empty where the run has one setting.
    """
    design = run.design
    if not {"A", "B"} <= set(design.suite.settings):
        return pd.DataFrame(columns=list(_COLUMNS_SETTINGS))
    estimates = _estimates_settings(run)
    scores, parents = _scores(run), parents_of(run)
    by_cell: dict[tuple[str, str], dict[str, Any]] = {}
    for level in design.levels:
        matcher = design.matchers(design.criterion(level))[0]
        part = scores[(scores["level"] == level) & (scores["matcher"] == matcher)]
        scenes, known, settings = (grouped(part, by) for by in ("scene", "model", "setting"))
        if settings.values != ["A", "B"]:
            continue
        models = [model for model in design.model_names if model in known.values]
        order = [known.values.index(model) for model in models]
        counts, samples = summed(part, ["tp", "fp", "fn"], (scenes, known, settings))
        present = samples[:, order, 0] > 0
        clusters = Clusters.of(base_scenes(parents, scenes.values))
        n_clusters = clusters.behind(present)
        paired = jackknife(
            counts[:, order],
            clusters,
            _both_and_difference,
            n_clusters=np.repeat(n_clusters[:, None], 3, axis=1),
        )
        paired = bounded(paired, 1.0)
        for n, model in enumerate(models):
            f1 = [estimates[model, setting, level, matcher] for setting in "AB"]
            by_cell[model, level] = {
                **{name: f1["AB".index(of)][end] for name, (of, end) in _F1.items()},
                **{"difference": paired.value[n, 2], "lo": paired.lo[n, 2], "hi": paired.hi[n, 2]},
                "n_scenes": int(present[:, n].sum()),
                "n_clusters": int(n_clusters[n]),
            }
    answered = {model for model, _ in by_cell}
    rows = [
        {"model": model, "level": level, **(by_cell.get((model, level)) or _UNKNOWN)}
        for model in design.model_names
        if model in answered
        for level in design.levels
    ]
    return pd.DataFrame(rows, columns=list(_COLUMNS_SETTINGS))


def _estimates_settings(run: Run) -> dict[Hashable, Any]:
    """F1 by model, setting, level and matcher."""
    estimates = track_estimates(run, NAME)
    estimates = estimates[estimates["measure"] == "f1"].set_index(
        ["model", "setting", CELL, "matcher"]
    )
    return dict(estimates[list(_ENDS)].astype("float64").to_dict("index"))


def _scores(run: Run) -> pd.DataFrame:
    """Scores of the plans that were asked for, by the levels of their scenes."""
    scores = cell_scores(run)
    return measured(scores[scores["track"] == NAME], ["level", "model"])


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


_MODEL = Column("Model", is_text=True)
ERROR_NAMES: dict[ErrorType, str] = {
    "shape_not_in_gt": "Shape not in GT",
    "overflow": "Overflow",
    "incorrect_orientation": "Incorrect orientation",
    "dependency_not_met": "Dependency not met",
}
_COUNTED = ("Plans", "Wrong steps")
_OF_TYPE = ("n", "%", "95 % CI")
_LABELS_NOTE = (
    "Prec, Rec, F1 are labeled by what they are. The paper prints its model rows as precision, "
    "recall, F1 under the header “Rec, Prec, F1”; only its Random row is as that header says."
)


def table1_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Table 1 in the paper's layout out of `table1_frame`."""
    design = run.design
    cells = [level_column(level, metric) for level in design.levels for metric in METRICS]
    columns = [
        Column(METRIC_NAMES[metric], level_name(level))
        for level in design.levels
        for metric in METRICS
    ]
    rows = tuple(
        (
            row["model"],
            *(number(row[cell]) for cell in cells),
            *uncertainty_cells(row, cells[-1], design),
        )
        for row in table.to_dict("records")
    )
    return TextTable(
        f"Assembly planning (%){design.of_suite}",
        (_MODEL, *columns, *uncertainty_columns(design, level_name(OVERALL))),
        rows,
        (how_counted(design), *_table1_notes(run), _LABELS_NOTE),
    )


def _table1_notes(run: Run) -> list[str]:
    cells = headline_cells(assembly_frame(run), run.design)
    overall = cells[cells["level"] == OVERALL]
    short = overall[overall["n"] < overall["expected"]]
    notes = [*seeds_notes(run.design)]
    if len(short):
        counts = zip(short["model"], short["n"], strict=True)
        listed = ", ".join(f"{model} {n}" for model, n in counts)
        notes.append(f"Scored of {run.design.expected(OVERALL)} samples: {listed}.")
    if run.design.suite.scoring.missing == "count":
        notes += _empty_plan_notes(cells)
    for note, rows in overall[overall["seed_note"] != ""].groupby("seed_note", sort=False):
        notes.append(f"{', '.join(rows['model'])}: {note}.")
    return notes


def _empty_plan_notes(cells: pd.DataFrame) -> list[str]:
    """Which models have samples without a reply, by kind; a lone kind needs no number."""
    listed = []
    for row in cells[cells["level"] == OVERALL].to_dict("records"):
        kinds = {"API errors": row["api_errors"], "missing replies": row["missing"]}
        kinds = {name: count for name, count in kinds.items() if count}
        if kinds:
            each = [f"{name} {count}" for name, count in kinds.items()]
            why = ", ".join(kinds if len(kinds) == 1 else each)
            listed.append(f"{row['model']} {sum(kinds.values())} of {row['n']} ({why})")
    notes = [f"Counted as empty plans: {', '.join(listed)}."] if listed else []
    unanswered = cells["api_errors"] + cells["missing"]
    if ((unanswered > 0) & (unanswered == cells["n"])).any():
        notes.append("No value stands where a model has no reply at all.")
    return notes


def how_counted(design: Design) -> str:
    """Setting, matcher, criterion, and what becomes of missing replies, as a sentence."""
    scoring = design.suite.scoring
    level1 = f", Level 1 by {scoring.level1}" if 1 in design.suite.levels else ""
    missing = "left out" if scoring.missing == "skip" else "counted as empty plans"
    return (
        f"Setting {design.setting}, matcher {design.matcher}{level1}; micro averages; "
        f"missing replies and API errors are {missing}."
    )


def errors_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Error types out of `errors_frame`: a count, a share (%) and its interval a type."""
    design, levels = run.design, levels_in_order(run)
    columns = [Column(kind, ERROR_NAMES[name]) for name in ERROR_TYPES for kind in _OF_TYPE]
    rows = [
        (
            row["model"] if row["level"] == levels[0] else "",
            level_name(row["level"]),
            str(row["n"]),
            str(row["wrong_steps"]),
            *(cell for name in ERROR_TYPES for cell in (str(row[name]), *share_texts(row, name))),
        )
        for row in table.to_dict("records")
    ]
    is_apart = 1 in design.suite.levels and "1" not in levels
    why = f"; {level_name('1')} asks for no order and has no such types" if is_apart else ""
    return TextTable(
        f"Wrong steps by type{design.of_suite}",
        (_MODEL, Column("Level", is_text=True), *map(Column, _COUNTED), *columns),
        tuple(rows),
        (
            f"Setting {design.setting}, matcher {design.matcher}, by aov{why}. Shares are of all "
            "wrong steps; intervals: base scenes left out in turn.",
        ),
    )


def published_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Published, ours and difference out of `published_frame`: a row a model and metric.

    Under the name of a model stands the name that it was published by.
    """
    columns, rows = beside_by_level(table, PUBLISHED_LEVELS, "Metric", METRIC_NAMES, 1)
    largest = largest_differences(table)
    last = (text for value in largest for text in (number(value, 3), "", ""))
    return TextTable(
        f"Our numbers beside the paper's Table 1{run.design.of_suite} (%)",
        (*columns, Column("Largest")),
        tuple((*row, end) for row, end in zip(rows, last, strict=True)),
        tuple(_difference_notes(table, run.design)),
    )


def _difference_notes(table: pd.DataFrame, design: Design) -> list[str]:
    matchers = "/".join(sorted(set(table["matcher"]) - {""})) or NO_VALUE
    seeds = len(design.suite.seeds)
    pooled = f", pooled over {seeds} seeds" if seeds > 1 else ""
    level1 = f", Level 1 by {design.suite.scoring.level1}" if 1 in design.suite.levels else ""
    return [
        *comparison_notes(table, design),
        f"Ours: setting {PUBLISHED_SETTING}, matcher {matchers}{level1}; micro averages{pooled}. "
        "Published: micro averages of one run.",
        "The last column has the largest absolute difference of each model.",
    ]


_COLORS = (COLORS[0], COLORS[5], COLORS[4], COLORS[1])
_INKS = ("white", "black", "black", "white")
_LEAST_LABEL = 6.0
_COUNTS_IN = 0.55
"""What the numbers of wrong steps take beside the bars."""


def error_bars(run: Run) -> Figure | None:
    """Shares of the four error types in each model's wrong steps; None without a wrong step."""
    table = errors_frame(run)
    table = table[(table["level"] == OVERALL) & (table["wrong_steps"] > 0)]
    if table.empty:
        return None
    order = {model: place for place, model in enumerate(ranked(intervals_table(run), "f1"))}
    table = table.sort_values("model", key=lambda names: names.map(order), kind="stable")
    names_in = names_width_in(table["model"])
    figure = new_figure(1.1 + 0.2 * len(table), names_in + 1.2)
    ax = figure.subplots()
    parts = (
        Part(ERROR_NAMES[name], 100 * table[f"{name}_share"].to_numpy(float), color, ink)
        for name, color, ink in zip(ERROR_TYPES, _COLORS, _INKS, strict=True)
    )
    stack(ax, list(table["model"]), parts, 0.66, _LEAST_LABEL)
    for place, wrong in enumerate(table["wrong_steps"]):
        ax.text(101.5, place, f"{wrong:,}", va="center", color=MUTED, fontsize=7)
    ax.text(101.5, -0.72, "wrong steps", va="bottom", color=MUTED, fontsize=7)
    ax.set(xlim=(0, 100), ylim=(len(table) - 0.4, -0.7))
    name_across(ax, "Share of wrong steps (%)", figure.get_figwidth() - names_in - _COUNTS_IN)
    bare_axes([ax])
    legend_below(figure, *ax.get_legend_handles_labels())
    headed(figure, "Why steps were wrong", f"{how_measured(run.design)}; all levels")
    return figure


_ROW_IN = 0.19
_LEAST_PANEL_IN, _LEAST_PLOT_IN = 0.7, 1.0
_RADAR_IN, _LEAST_RADAR_IN = 2.75, 2.2
_RINGS = (25, 50, 75, 100)
_CORNER_PT = 9
"""Between a corner and its name, for a marker that stands at the corner."""
_NAMES_IN = 0.2
"""Above and below a radar."""
_SETTINGS = {
    "a": (COLORS[0], "o", "A: with orientation"),
    "b": (COLORS[1], "D", "B: without orientation"),
}


def how_measured(design: Design, *, setting: bool = True) -> str:
    """Suite, setting and matcher in a line."""
    parts = [f"Suite {design.suite.name}"] if design.suite.name else []
    parts += [f"setting {design.setting}"] if setting else []
    return ", ".join([*parts, f"{design.matcher} matcher"])


def ranked(table: pd.DataFrame, column: str) -> list[str]:
    """Models of a table of levels, the highest overall first; those without a value are left out.

    A run without an overall number ranks by name.
    """
    overall = table[table["level"] == OVERALL].dropna(subset=[column])
    return list(overall.sort_values([column, "model"], ascending=[False, True])["model"])


def f1_radar(run: Run) -> Figure | None:
    """A radar a setting with a corner a level and a line a model, as in the paper; of a single
    model one radar with a line a setting. None for fewer than three levels.

    Of more than eight models the best eight have colors and names, the others are pale.
    """
    levels = [level for level in run.design.levels if level != OVERALL]
    panels = _by_setting(run)
    models = ranked(intervals_table(run), "f1")
    if not models or len(levels) < 3:
        return None
    if len(models) == 1:
        lines = {f"Setting {name}": _line(cells, models[0]) for name, cells in panels.items()}
        shown = {models[0]: lines}
    else:
        shown = {
            f"Setting {name}": {model: _line(cells, model) for model in models}
            for name, cells in panels.items()
        }
    abreast = len(shown) if drawn_width_in() / len(shown) >= _LEAST_RADAR_IN else 1
    rows, side = len(shown) // abreast, min(_RADAR_IN, drawn_width_in() / abreast)
    figure = new_figure(0.5 + rows * (side + _NAMES_IN))
    axes = figure.subplots(rows, abreast, subplot_kw={"projection": "polar"}, squeeze=False)
    for ax, (title, drawn) in zip(axes.ravel(), shown.items(), strict=True):
        handles = _radar(ax, drawn, levels)
        ax.set_title(title, loc="center", pad=12 + _CORNER_PT)
    names = list(next(iter(shown.values())))[:NAMED]
    if len(names) > 1:
        legend_below(figure, handles[: len(names)], names)
    others = len(models) - NAMED
    more = f"; the {others} others in gray" if others > 0 else ""
    headed(figure, "F1 by level (%)", how_measured(run.design, setting=len(panels) == 1) + more)
    return figure


def _by_setting(run: Run) -> dict[str, pd.Series[float]]:
    """F1 [%] by model and level in each setting of the run, A first."""
    both = settings_frame(run)
    if len(both):
        cells = both.set_index(["model", "level"])
        return {name: 100 * cells[f"f1_{name.lower()}"] for name in "AB"}
    return {run.design.setting: intervals_table(run).set_index(["model", "level"])["f1"]}


def _line(cells: pd.Series[float], model: str) -> pd.Series[float]:
    return pd.Series(cells.loc[model], dtype="float64")


def _radar(ax: Axes, lines: dict[str, pd.Series[float]], levels: Sequence[str]) -> list[Artist]:
    """Draw lines of F1 by level, the first on top; their handles in that order."""
    polar: Any = ax
    angles = np.linspace(0, 2 * np.pi, len(levels), endpoint=False)
    polar.set_theta_offset(np.pi / 2)
    polar.set_theta_direction(-1)
    handles: list[Artist] = []
    for place, (name, cells) in reversed(list(enumerate(lines.items()))):
        values = cells.loc[list(levels)].to_numpy(float)
        handles += ax.plot(
            np.append(angles, angles[0]),
            np.append(values, values[0]),
            markersize=3.5,
            clip_on=False,
            **line_look(place, name),
        )
    ax.set_xticks(angles, [level_name(level) for level in levels])
    ax.tick_params(axis="x", pad=_CORNER_PT)
    ax.set(ylim=(0, 100), yticks=_RINGS, yticklabels=[])
    for share in _RINGS:
        ax.text(
            np.pi / len(levels),
            share,
            f"{share} %" if share == _RINGS[-1] else str(share),
            ha="center",
            va="center",
            fontsize=6,
            color=MUTED,
            bbox={"facecolor": "white", "alpha": 0.8, "edgecolor": "none", "pad": 0.3},
            zorder=4,
        )
    polar.spines["polar"].set_color(GRID)
    return handles[::-1]


def settings_dots(run: Run) -> Figure | None:
    """F1 in A and in B with the gap between, a panel a level, Overall first; None for one setting.

    Of a single model, and where panels would be too narrow, there is one panel: with a row a level,
    or of all levels together.
    """
    table = settings_frame(run)
    models, levels = ranked(table, "f1_b"), run.design.levels
    if not models:
        return None
    cells = table.set_index(["model", "level"])
    levels = (*levels[-1:], *levels[:-1])
    if len(models) == 1:
        mine = table[table["model"] == models[0]].set_index("level")
        return _of_one(run, models[0], mine.loc[list(levels)])
    names_in = names_width_in(models)
    room_in = drawn_width_in(names_in + _LEAST_PLOT_IN) - names_in
    levels = levels if room_in / len(levels) >= _LEAST_PANEL_IN else levels[:1]
    figure = new_figure(1.0 + _ROW_IN * len(models), names_in + _LEAST_PLOT_IN)
    axes = figure.subplots(1, len(levels), sharey=True, squeeze=False)[0]
    # Membership counts a step again that is repeated: it may go beyond all there is.
    end = 3 + max(100.0, 100 * float(np.nanmax(table[["f1_a", "f1_b"]].to_numpy(float))))
    for ax, level in zip(axes, levels, strict=True):
        _gaps(ax, cells.loc[[(model, level) for model in models]])
        ax.set(title=level_name(level), xlim=(-3, end), xticks=[0, 50, 100], xlabel="F1 (%)")
    axes[0].set_yticks(np.arange(len(models)), models)
    _finish(run, figure, axes, len(models))
    return figure


def _of_one(run: Run, model: str, rows: pd.DataFrame) -> Figure:
    """One model: a row a level, with intervals."""
    figure = new_figure(1.0 + 0.3 * len(rows))
    ax = figure.subplots()
    for shift, (name, (color, *_)) in zip((-0.09, 0.09), _SETTINGS.items(), strict=True):
        ends = 100 * rows[[f"f1_{name}_lo", f"f1_{name}_hi"]].to_numpy(float)
        ax.hlines(np.arange(len(rows)) + shift, *ends.T, color=color, linewidth=1.2)
    _gaps(ax, rows, 0.09)
    ax.set(title=model, xlim=(0, 103), xlabel="F1 (%)")
    ax.set_yticks(np.arange(len(rows)), [level_name(str(level)) for level in rows.index])
    _finish(run, figure, [ax], len(rows))
    return figure


def _gaps(ax: Axes, rows: pd.DataFrame, shift: float = 0.0) -> None:
    places = np.arange(len(rows))
    a, b = 100 * rows[["f1_a", "f1_b"]].to_numpy(float).T
    if not shift:
        ax.hlines(places, a, b, color=PALE, linewidth=2.2)
    for values, apart, (color, marker, label) in zip(
        (a, b), (-shift, shift), _SETTINGS.values(), strict=True
    ):
        ax.plot(values, places + apart, marker, color=color, markersize=4, label=label)


def _finish(run: Run, figure: Figure, axes: Sequence[Axes], n_rows: int) -> None:
    axes[0].set_ylim(n_rows - 0.4, -0.6)
    bare_axes(axes)
    legend_below(figure, *axes[0].get_legend_handles_labels())
    how = how_measured(run.design, setting=False)
    headed(figure, "What orientation costs", how)


_LOOKS: dict[BlockOutcome, tuple[str, str]] = {
    "placed": (COLORS[0], "white"),
    "left_out": (PALE, "black"),
    "wrong_kind": (COLORS[1], "white"),
    "wrong_orientation": (COLORS[4], "black"),
    "support_not_named": ("#005c43", "white"),
    "support_turned": (COLORS[2], "black"),
    "support_both": ("#8fd6bf", "black"),
    "order": (COLORS[3], "black"),
}
"""Color of a part and of the number in it; the three of missing supports are of one hue."""


def loss_bars(run: Run) -> Figure | None:
    """Shares of the outcomes of goal blocks in all levels; None where no plan's are known."""
    table = losses_frame(run)
    table = table[(table["level"] == OVERALL) & table["value"].notna()]
    if table.empty:
        return None
    shares = table.pivot(index="model", columns="outcome", values="value")
    models = [model for model in ranked(intervals_table(run), "f1") if model in shares.index]
    parts = (
        Part(BLOCK_NAMES[outcome], shares.loc[models, outcome].to_numpy(float), *_LOOKS[outcome])
        for outcome in BLOCK_OUTCOMES
    )
    figure, _ = share_bars(models, parts, "Share of the goals' blocks (%)")
    headed(figure, "What became of the goals' blocks", f"{how_measured(run.design)}; all levels")
    return figure


_LINE_POINTS = 8.5
"""Height of a label, with what it keeps free [points]."""
_LABEL_PT = 6.5
_BESIDE_IN = 0.6
"""What the axis of F1 takes beside the plot."""
_FREE_IN = 0.15
"""Between a point and its name, and behind the name."""
_MOST_OF_WIDTH = 0.7
"""A name takes at most this share of the plot: points need the rest."""
_DECADE_IN = 1.4
"""There is room for three numbers in a decade from here on."""
_STATED_SIZE = re.compile(r"(?<![A-Za-z0-9.])(\d+(?:\.\d+)?)[bB](?![A-Za-z0-9])")
_SHIFTS = sorted((sign * 9.0 * n for n in range(60) for sign in (1, -1)), key=abs)
"""How far a label may be moved, the nearest first [points]."""


def f1_by_size(run: Run) -> Figure | None:
    """F1 against billions of parameters; None where the size of no model is known.

    A size is what the models file says, else what the model's name does, as `-7B`.
    """
    sizes = {model.name: model.size_b or stated_size_b(model.name) for model in run.design.models}
    return _scatter(run, sizes, "F1 by model size", ("size", "Parameters (billions, log scale)"))


def stated_size_b(name: str) -> float | None:
    """The billions of parameters that a model's name tells, as `-7B`; None where it tells none.

    Of several numbers the first counts, which is of all experts where some alone are active.
    """
    match = _STATED_SIZE.search(name)
    return float(match[1]) if match else None


def f1_by_cost(run: Run) -> Figure | None:
    """F1 against dollars for 100 replies; None where no model's replies cost anything known."""
    table = cost_frame(run)
    table = table[table["track"] == NAME]
    prices = dict(zip(table["model"], table["cost_per_100_usd"], strict=True))
    return _scatter(run, prices, "F1 by cost", ("cost", "Cost of 100 replies (USD, log scale)"))


def _scatter(
    run: Run, x_of: dict[str, float | None], title: str, axis: tuple[str, str]
) -> Figure | None:
    from matplotlib.ticker import LogLocator, NullLocator

    table = intervals_table(run)
    table = table[table["level"] == OVERALL].dropna(subset=["f1"])
    known = {model: float(x) for model, x in x_of.items() if x is not None and x > 0}
    table = table[table["model"].isin(list(known))]
    if table.empty:
        return None
    table = table.assign(x=table["model"].map(known)).sort_values(["f1", "model"])
    names_in = max(text_width_in(name, _LABEL_PT) for name in table["model"])
    figure = new_figure(3.6, _BESIDE_IN + (names_in + _FREE_IN) / _MOST_OF_WIDTH)
    ax = figure.subplots()
    ends = table[["lo", "hi"]].to_numpy(float)
    ax.vlines(table["x"], ends[:, 0], ends[:, 1], color=PALE, linewidth=2.2)
    ax.plot(table["x"], table["f1"], "o", color=ACCENT, markersize=5)
    ax.set_xscale("log")
    start = float(table["x"].min()) / 1.7
    end = _end(table, start, figure.get_figwidth())
    ax.set(xlim=(start, end), xlabel=axis[1], ylabel="F1 overall (%)")
    ax.set_ylim(0, min(104.0, 8 + float(table["hi"].fillna(table["f1"]).max())))
    is_wide = figure.get_figwidth() / math.log10(end / start) > _DECADE_IN
    ax.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5) if is_wide else (1,)))
    ax.xaxis.set_minor_locator(NullLocator())
    ax.xaxis.set_major_formatter(lambda x, _: f"{x:g}")
    bare_axes([ax], "both")
    subtitle = f"{how_measured(run.design)}; lines: 95 % intervals"
    if left_out := len(run.design.model_names) - len(table):
        subtitle += f"; {left_out} of unknown {axis[0]} left out"
    headed(figure, title, subtitle)
    _label(figure, ax, table)
    return figure


def _end(table: pd.DataFrame, start: float, width_in: float) -> float:
    """Where a scale from `start` ends, so that every name fits beside its point."""
    width = width_in - _BESIDE_IN
    ends = [math.log(float(table["x"].max()) * 1.3 / start)]
    for name, x in zip(table["model"], table["x"], strict=True):
        free = 1 - min((text_width_in(name, _LABEL_PT) + _FREE_IN) / width, _MOST_OF_WIDTH)
        ends.append(math.log(x / start) / free)
    return start * math.exp(max(ends))


def _label(figure: Figure, ax: Axes, table: pd.DataFrame) -> None:
    """Names to the right of their points, moved up or down where they would cover another."""
    figure.draw_without_rendering()
    points = ax.transData.transform(table[["x", "f1"]].to_numpy(float)) * 72 / figure.dpi
    taken = [(x - 4.0, x + 4.0, y) for x, y in points]
    for (x, y), name in zip(points, table["model"], strict=True):
        start, end = x + 6.5, x + 8 + 72 * text_width_in(name, _LABEL_PT)
        shift = next(
            shift
            for shift in _SHIFTS
            if not any(
                abs(y + shift - other) < _LINE_POINTS and left < end and start < right
                for left, right, other in taken
            )
        )
        taken.append((start, end, y + shift))
        ax.annotate(
            name,
            (x, y),
            xycoords="figure points",
            xytext=(start, y + shift - 2.6),
            textcoords="figure points",
            fontsize=_LABEL_PT,
            color=INK,
            annotation_clip=False,
            arrowprops={"arrowstyle": "-", "color": MUTED, "linewidth": 0.5, "relpos": (0, 0.5)}
            if shift
            else None,
            bbox={"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 0.4},
            zorder=4,
        )


_ERRORS: dict[str, ErrorType] = {str(name): name for name in ERROR_TYPES}


def _table(record: PlanRecord) -> TextTable:
    """Every step: the candidate that it names, and what became of it."""
    rows = tuple((str(n), str(one), outcome) for n, one, _, outcome in _steps_film(record))
    columns = (Column("Step"), Column("Block"), Column("Outcome", is_text=True))
    return TextTable(f"{record.sample}: {_came_to(record)}", columns, rows)


def _film(record: PlanRecord, task: AssemblyTask) -> Iterator[FilmStep]:
    """A frame for the empty ground, one a step, and one for what came of the plan.

    A right step puts a block at its place in the goal; a wrong one puts none.
    """
    yield FilmStep(f"{record.model}, {task.scene.id}", "plain", None, ())
    blocks: tuple[Block, ...] = ()
    for n, candidate, vertex, outcome in _steps_film(record):
        tone: Tone = "good" if vertex is not None else "bad"
        blocks += () if vertex is None else (task.scene.blocks[vertex],)
        yield FilmStep(f"{n}. block {candidate}: {outcome}", tone, candidate, blocks)
    tone = "good" if len(blocks) == len(task.scene.blocks) else "bad"
    yield FilmStep(_came_to(record), tone, None, blocks)


def _steps_film(record: PlanRecord) -> Iterator[tuple[int, int, int | None, str]]:
    """Number, candidate, block of the goal that it placed from 0, and what became of each step."""
    score, plan = _score(record), record.parse.plan if record.parse else ()
    placed, why = (score.placed, score.why) if score else (None, None)
    if placed is None or why is None:
        return
    for n, (candidate, vertex, error) in enumerate(zip(plan, placed, why, strict=True), 1):
        outcome = "placed" if vertex is not None else ERROR_NAMES[_ERRORS[str(error)]]
        yield n, candidate, vertex, outcome


def _score(record: PlanRecord) -> Score | None:
    """The first score, which is of the headline setting and matcher, that knows single steps."""
    return next((score for score in record.scores if score.placed is not None), None)


def _came_to(record: PlanRecord) -> str:
    score = _score(record)
    if score is None or score.placed is None:
        return "no step is known"
    return f"{score.tp} of {record.n_blocks} blocks placed"


PLAN_VIEW = EpisodeView(NAME, _table, _film)


_MAIN = "Overall F1"


def _headline(run: Run) -> tuple[HeadlineColumn, ...]:
    levels = [
        HeadlineColumn("f1", level, _MAIN if level == OVERALL else level_name(level), "")
        for level in run.design.levels
    ]
    sides = [HeadlineColumn(name, OVERALL, name.capitalize()) for name in METRICS[:2]]
    return (*levels, *sides)


def _references(run: Run) -> Mapping[str, Mapping[str, float]]:
    printed = published_table(1)
    printed = printed[printed["model"] == "Random"].set_index(["level", "metric"])
    values = printed["value"].to_dict()
    random = {
        column.heading: float(values.get((column.cell, column.measure), float("nan")))
        for column in _headline(run)
    }
    return {"Random, published": random}


def _published(run: Run) -> Mapping[str, float]:
    """What the paper's Table 1 prints as overall F1."""
    if run.design.setting != PUBLISHED_SETTING:
        return {}
    frame = published_frame(run)
    frame = frame[(frame["level"] == OVERALL) & (frame["metric"] == "f1")]
    return dict(zip(frame["model"], frame["published"], strict=True))


def _orders(run: Run) -> pd.DataFrame:
    return order_frame(NAME, run.design.criterion(OVERALL), run)


def _notes(run: Run) -> Sequence[str]:
    return (f"F1 in percent. {how_counted(run.design)}",)


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


REPORT = TrackReport(
    measures=PLANNING_MEASURES,
    cells=level_cells,
    in_cells=in_levels,
    headline=_headline,
    main=_MAIN,
    short="f1",
    published=_published,
    references=_references,
    notes=_notes,
    reference_note=HUMAN_NOTE,
    tables={
        "assembly": TableMaker(assembly_frame),
        "table1": TableMaker(table1_frame, table1_view),
        "intervals": TableMaker(intervals_table, intervals_view, "table1"),
        "table5": TableMaker(table5_frame, table5_view, "table1"),
        "settings": TableMaker(settings_frame, settings_view, "table1"),
        "errors": TableMaker(errors_frame, errors_view),
        "losses": TableMaker(losses_frame, losses_view, "errors"),
        "orders": TableMaker(_orders, order_view, "table1"),
        "scenes": TableMaker(partial(scenes_frame, NAME), scenes_view, "table1"),
        "published": TableMaker(published_frame, published_view),
    },
    episodes=PLAN_VIEW,
    main_figure="f1-levels",
    figures={
        "f1-radar": FigureMaker("F1 by level, as in the paper", f1_radar),
        "settings": FigureMaker("Setting A against setting B", settings_dots),
        "losses": FigureMaker("What became of the goals' blocks", loss_bars),
        "error-types": FigureMaker("Wrong steps by type", error_bars),
        "f1-size": FigureMaker("F1 by model size", f1_by_size),
        "f1-cost": FigureMaker("F1 by cost", f1_by_cost),
        "inference": SceneFigure("A plan and what it built", partial(inference, view=PLAN_VIEW)),
    },
    paper_tables={
        1: PaperTable(published_frame, published_view),
        5: PaperTable(paper_table5_frame, paper_table5_view),
    },
    check_alike=_check_alike,
    showing=lambda run: planning_words(run, NAME),
)
