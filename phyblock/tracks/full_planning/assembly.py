"""The long table of assembly results, one row a cell, and the paper's Table 1 out of it."""

from __future__ import annotations

import pandas as pd

from phyblock.tables.cells import METRICS, cell_scores, with_levels
from phyblock.tables.design import OVERALL, Design
from phyblock.tables.flat import joined_counts
from phyblock.tables.load import Run, made_once_copied
from phyblock.tables.measures import CELL
from phyblock.tables.outcomes import FAILURES
from phyblock.text import counted
from phyblock.tracks.estimates import track_estimates
from phyblock.tracks.full_planning.measures import NAME, is_asked

__all__ = ["ASSEMBLY_COLUMNS", "assembly_frame", "headline_cells", "level_column", "table1_frame"]

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
