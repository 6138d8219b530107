"""Step-planning episodes of a run as frames: one row an episode, and what is summed over them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from phyblock.data import AssemblyTask
from phyblock.domain import Block
from phyblock.errors import Problem, SpecError
from phyblock.scoring.counts import f1_of, precision_of, ratio_of, recall_of
from phyblock.scoring.plan import ERROR_TYPES
from phyblock.sim.dynamics import settle
from phyblock.sim.engine import PHYSICS_VARIABLE, REFERENCE_ENGINE, described_engine
from phyblock.sim.film import FilmStep, Tone
from phyblock.tables.cells import METRIC_NAMES, METRICS
from phyblock.tables.drawing import headed
from phyblock.tables.flat import joined_counts
from phyblock.tables.headline import (
    headline_rows,
    interval_frame,
    interval_view,
    seeds_notes,
    uncertainty_cells,
    uncertainty_columns,
)
from phyblock.tables.load import Run, made_once_copied
from phyblock.tables.measures import CELL, SCORED_BY, Measure, SampleCounts
from phyblock.tables.outcomes import has_reply
from phyblock.tables.paper_numbers import (
    NOTHING,
    OURS,
    PUBLISHED,
    beside_view,
    interleaved,
    published_table,
    row_name,
)
from phyblock.tables.shares import joined_shares, share_texts, shares_of
from phyblock.tables.showing import planning_words
from phyblock.tables.text_table import Column, TextTable, between, number
from phyblock.tables.track_report import (
    WHOLE,
    EpisodeView,
    FigureMaker,
    HeadlineColumn,
    PaperTable,
    SceneFigure,
    TableMaker,
    TrackReport,
)
from phyblock.text import counted
from phyblock.tracks.base import ENGINE
from phyblock.tracks.estimates import track_estimates
from phyblock.tracks.figures import curves, inference
from phyblock.tracks.plans import POSE_MEASURES
from phyblock.tracks.step_planning import (
    ENDINGS,
    STEP_FLOORS,
    EpisodeRecord,
    EpisodeTurn,
    StepsSpec,
    state_keys,
)
from phyblock.tracks.tables import (
    order_frame,
    order_view,
    scenes_frame,
    scenes_view,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NAME = "step_planning"
STEP_OUTCOMES = ("placed", *ERROR_TYPES, "invalid", "unread", "done")
"""What becomes of a step; `unread` are replies in which no single operation could be read."""

_EPISODE_TYPES = {
    "model": "object",
    "scene": "object",
    "seed": "int64",
    "variant": "object",
    "n_blocks": "int64",
    "outcome": "object",
    "ending": "object",
    "steps": "int64",
    "max_steps": "int64",
    "progress": "object",
    "outcomes": "object",
}


@made_once_copied
def episodes_frame(run: Run) -> pd.DataFrame:
    """One row an episode that tables count, in the order of the suite's models.

    `steps` were taken of at most `max_steps`; `outcomes` and `progress` are tuples with an entry
    a step: what became of it, and the blocks that were placed by then. Episodes that got no reply
    are left out where the suite says `missing: skip`.
    """
    records = run.records
    left_out = records["outcome"].isin(run.design.outcomes_left_out)
    kept = records[(records["track"] == NAME) & ~left_out]
    kept = kept.assign(steps=kept["outcomes"].map(len))
    return kept[list(_EPISODE_TYPES)].astype(_EPISODE_TYPES).reset_index(drop=True)


def endings_frame(run: Run) -> pd.DataFrame:
    """One row a model: episodes by how they ended, and how long they took.

    `n` episodes of `expected`; a count and a share with the ends of its 95 % interval, in [0, 1],
    for each of `ENDINGS`; `steps` the mean number of steps; `steps_to_finish` the mean of those
    that completed, and `detour` their steps over the fewest possible, which is the number of
    blocks: sums first, NaN where none completed. A model without any reply has no shares.
    """
    episodes = episodes_frame(run)
    ended = {name: (episodes["ending"] == name).astype("int64") for name in ENDINGS}
    shares = _shares(run, episodes.assign(**ended), ENDINGS)
    rows = []
    for model in run.design.model_names:
        mine = episodes[episodes["model"] == model]
        whole = mine[mine["ending"] == "completed"]
        row: dict[str, Any] = {"model": model, "n": len(mine)}
        row["expected"] = run.design.samples(NAME)
        row["steps"] = mine["steps"].mean()
        row["steps_to_finish"] = whole["steps"].mean()
        fewest = whole["n_blocks"].sum()
        row["detour"] = whole["steps"].sum() / fewest if fewest else np.nan
        rows.append(row)
    table = joined_shares(pd.DataFrame(rows), shares, ["model"])
    first = ["model", "n", "expected", *ENDINGS]
    return table[[*first, *(name for name in table if name not in (*first, "whole"))]]


def moves_frame(run: Run) -> pd.DataFrame:
    """One row a model: `steps` in all, and a count of each of `STEP_OUTCOMES` and its share of
    them, with the ends of its 95 % interval, in [0, 1].
    """
    episodes = episodes_frame(run)
    counted = [Counter(map(_named, outcomes)) for outcomes in episodes["outcomes"]]
    parts = {name: [counts[name] for counts in counted] for name in STEP_OUTCOMES}
    shares = _shares(run, episodes.assign(**parts), STEP_OUTCOMES)
    models = pd.Series(run.design.model_names, name="model")
    sizes = models.map(episodes["model"].value_counts()).fillna(0).astype("int64")
    table = pd.DataFrame({"model": models, "episodes": sizes})
    return joined_shares(table, shares, ["model"]).rename(columns={"whole": "steps"})


def _shares(
    run: Run, episodes: pd.DataFrame, parts: Sequence[str], whole: str | None = None
) -> pd.DataFrame:
    """See `shares_of`; by model."""
    rows = episodes.assign(replied=has_reply(episodes))
    return shares_of(run, rows, parts, whole=whole).droplevel(CELL)


def progress_frame(run: Run) -> pd.DataFrame:
    """One row a model and step: the curve of how a goal grows.

    `blocks` is the mean share of a goal's blocks that are placed after `step` steps, an episode
    that has ended keeping what it had; `under_way` the share of episodes that have not ended
    before that step; `*_lo` and `*_hi` bound their 95 % intervals. Steps go as far as the longest
    episode of any model. A model without any reply has no rows.
    """
    episodes = episodes_frame(run)
    steps = range(1, 1 + (int(episodes["steps"].max()) if len(episodes) else 0))
    reached = [_padded(progress, len(steps)) for progress in episodes["progress"]]
    blocks = np.array(reached, dtype=np.float64).reshape(len(episodes), len(steps))
    curves = {
        "blocks": blocks / episodes["n_blocks"].to_numpy()[:, None],
        "under_way": episodes["steps"].to_numpy()[:, None] >= np.array(steps),
    }
    parts = []
    for curve, counts in curves.items():
        names = [str(step) for step in steps]
        counted = pd.DataFrame(counts, columns=names, index=episodes.index, dtype="float64")
        rows = pd.concat([episodes.assign(episodes=1), counted], axis=1)
        shares = _shares(run, rows, names, "episodes")
        table = pd.DataFrame(
            {
                f"{curve}{end}": shares[[f"{name}_{kind}" for name in names]].to_numpy().ravel()
                for end, kind in {"": "share", "_lo": "lo", "_hi": "hi"}.items()
            },
            index=pd.MultiIndex.from_product([shares.index, steps], names=["model", "step"]),
        )
        parts.append(table)
    known = pd.concat(parts, axis=1).dropna(subset=["blocks"])
    models = set(known.index.get_level_values("model"))
    return known.loc[[name for name in run.design.model_names if name in models]].reset_index()


def _padded(progress: tuple[int, ...], length: int) -> list[int]:
    last = progress[-1] if progress else 0
    return [*progress, *[last] * (length - len(progress))]


def _named(outcome: str) -> str:
    return outcome if outcome in STEP_OUTCOMES else "unread"


COUNTED = ("placed", "attempted")
"""What precision is over: the blocks in the world, or every move that was attempted."""


def is_asked(run: Run) -> bool:
    """Whether the run has episodes."""
    return NAME in run.design.suite.tracks


def _moves(run: Run) -> pd.DataFrame:
    scores = run.scores
    left_out = scores["outcome"].isin(run.design.outcomes_left_out)
    kept = scores[(scores["track"] == NAME) & ~left_out]
    return kept.assign(**_about(kept))


def _episodes(run: Run) -> pd.DataFrame:
    episodes = episodes_frame(run)
    completed = (episodes["ending"] == "completed").astype("int64")
    return episodes.assign(
        **dict.fromkeys(SCORED_BY, ""),
        **_about(episodes),
        completed=completed,
        episodes=1,
    )


def _about(rows: pd.DataFrame) -> dict[str, Any]:
    return {CELL: WHOLE.name, "item": rows["scene"], "replied": has_reply(rows)}


_MOVES = SampleCounts("moves", ("tp", "fp", "fn"), _moves)
_ENDS = SampleCounts("episodes", ("completed", "episodes"), _episodes)

STEP_MEASURES = (
    Measure(
        "f1", "F1", _MOVES, f1_of, "harmonic mean of precision and recall", over="moves",
        floors=STEP_FLOORS,
    ),
    Measure(
        "precision", "Precision", _MOVES, precision_of, "right moves of those counted",
        over="moves",
    ),
    Measure(
        "recall", "Recall", _MOVES, recall_of, "blocks of the goal that were placed", over="blocks"
    ),
    Measure(
        "completion", "Completed", _ENDS, ratio_of, "episodes that placed the whole goal",
        over="episodes",
    ),
    *POSE_MEASURES,
)  # fmt: skip


_MODEL = Column("Model", is_text=True)
ENDING_NAMES = {
    "completed": "Completed",
    "done": "Said Done",
    "collapsed": "Collapsed",
    "max_steps": "Step limit",
    "max_failures": "Failures in a row",
    "max_repeats": "Repeats",
    "max_tokens": "Token limit",
    "max_cost": "Cost limit",
    "unanswered": "Unanswered",
}
"""What people read in the place of each ending."""
OUTCOME_NAMES = {
    "placed": "Placed",
    "shape_not_in_gt": "Shape not in GT",
    "overflow": "Overflow",
    "incorrect_orientation": "Incorrect orientation",
    "dependency_not_met": "Dependency not met",
    "invalid": "No candidate",
    "unread": "Unread",
    "done": "Done",
}
"""What people read in the place of each outcome of a step."""
_OF_SHARE = ("%", "95 % CI")
_CURVE = (1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 30, 44)


def endings_view(table: pd.DataFrame, run: Run) -> TextTable:
    """How episodes ended, out of `endings_frame`; ways in which none ended are left out."""
    ways = [name for name in ENDINGS if table[name].sum() or name in ("completed", "done")]
    columns = [Column(kind, ENDING_NAMES[name]) for name in ways for kind in _OF_SHARE]
    rows = tuple(
        (
            row["model"],
            str(row["n"]),
            *(text for name in ways for text in share_texts(row, name)),
            number(row["steps"]),
            number(row["detour"], 2),
        )
        for row in table.to_dict("records")
    )
    return TextTable(
        f"How episodes ended (%){run.design.of_suite}",
        (_MODEL, Column("Episodes"), *columns, Column("Steps"), Column("Steps / fewest")),
        rows,
        ("Steps is the mean over all episodes; Steps / fewest is over those completed.",),
    )


def moves_view(table: pd.DataFrame, run: Run) -> TextTable:
    """What became of steps, out of `moves_frame`."""
    rows = tuple(
        (
            row["model"],
            str(row["steps"]),
            *(text for name in STEP_OUTCOMES for text in share_texts(row, name)),
        )
        for row in table.to_dict("records")
    )
    columns = [Column(kind, OUTCOME_NAMES[name]) for name in STEP_OUTCOMES for kind in _OF_SHARE]
    return TextTable(
        f"What became of steps (%){run.design.of_suite}",
        (_MODEL, Column("Steps"), *columns),
        rows,
        ("Shares of all steps. Unread: no single operation could be read in the reply.",),
    )


def progress_view(table: pd.DataFrame, run: Run) -> TextTable:
    """The curve out of `progress_frame`, at some steps."""
    longest = int(table["step"].max()) if len(table) else 0
    shown = [step for step in _CURVE if step <= longest]
    names = ["blocks", "blocks_lo", "blocks_hi"]
    curves = table.set_index(["model", "step"])[names].to_dict("index")
    none = dict.fromkeys(names, np.nan)
    rows = []
    for model in run.design.model_names:
        points = [curves.get((model, step), none) for step in shown]
        rows.append((model, *(number(100 * point["blocks"]) for point in points)))
        ends = (between(100 * point["blocks_lo"], 100 * point["blocks_hi"]) for point in points)
        rows.append(("  95 % CI", *ends))
    return TextTable(
        f"Blocks of the goal that are placed after so many steps (%){run.design.of_suite}",
        (_MODEL, *(Column(str(step)) for step in shown)),
        tuple(rows),
        ("Mean over episodes; one that has ended keeps what it had. Every step: progress.csv.",),
    )


_RECALL = "placed_recall"
"""What our numbers and the published ones both have: the blocks of the goal that stand."""
_SHOWN = {
    "completion": ("completion", ""),
    **{f"{way}_{metric}": (metric, way) for way in reversed(COUNTED) for metric in METRICS},
}
"""Measure and way of counting by column."""
_LEADING = {"completion": "Completed", "attempted_f1": "F1 of attempts"}
_FURTHER = {
    "attempted_precision": Column("Prec", "Attempts"),
    _RECALL: Column("Rec", "Goal blocks"),
    "placed_precision": Column("Prec", "Placed blocks"),
    "placed_f1": Column("F1", "Placed blocks"),
}
_CONSTRUCTION = (
    " The simulator goes by the same setting and places no wrong one: precision of placed blocks "
    "is 100 by construction, but for collapses, and tells no model from another."
)
_PUBLISHED_NOTE = (
    "Of the published numbers, of the paper's own scenes, recall alone stands beside ours: it is "
    "of the goal's blocks, whatever was tried. Precision, and F1 with it, depend on which wrong "
    "blocks a simulator lets stand, which the paper does not say; ours are no like numbers."
)


def step_scores_frame(run: Run) -> pd.DataFrame:
    """One row a model, setting and way of counting: n, tp, fp, fn, micro averages in [0, 1].

    `*_lo` and `*_hi` bound 95 % intervals; `*_mean` and `*_sd` (ddof = 1) are taken over the micro
    averages of single seeds. A model without any reply has counts, if the suite counts empty plans,
    but no metrics.
    """
    scores = run.scores[
        (run.scores["track"] == NAME) & ~run.scores["outcome"].isin(run.design.outcomes_left_out)
    ]
    keys = ["model", "setting", "criterion"]
    groups = scores.groupby(keys, sort=False)
    counts = ["n", "tp", "fp", "fn"]
    cells = [
        (model, setting, criterion)
        for model in run.design.model_names
        for setting in run.design.suite.settings
        for criterion in COUNTED
    ]
    frame = pd.DataFrame(cells, columns=keys)
    frame = frame.join(groups.size().rename("n"), on=keys).join(groups[counts[1:]].sum(), on=keys)
    frame[counts] = joined_counts(frame[counts])
    estimates = track_estimates(run, NAME)
    for ends in (("value",), ("lo", "hi"), ("mean", "sd")):
        for metric in METRICS:
            mine = (
                estimates[estimates["measure"] == metric]
                .set_index(keys)[list(ends)]
                .astype("float64")
            )
            names = {end: metric if end == "value" else f"{metric}_{end}" for end in ends}
            frame = frame.join(mine.rename(columns=names), on=keys)
    return frame


def step_intervals(run: Run) -> pd.DataFrame:
    """F1 in the headline setting, pooled over seeds: a row a model and way of counting.

    Columns are model, cell (`placed` or `attempted`), value, lo, hi, se [%], n, n_scenes,
    n_clusters.
    """
    estimates = track_estimates(run, NAME)
    estimates = estimates[(estimates["measure"] == "f1") & estimates["value"].notna()].drop(
        columns=CELL
    )
    estimates = estimates.rename(columns={"criterion": CELL}).sort_values(CELL, kind="stable")
    table = interval_frame(estimates, run.design, 100.0, [CELL])
    return table.drop(columns="seeds")


def step_intervals_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Shows the table of `step_intervals`."""
    return interval_view(table, run, list(dict.fromkeys(table[CELL])), "F1 of step planning")


def table3_frame(run: Run) -> pd.DataFrame:
    """The paper's Table 3 [%], unrounded: one row a model, and one as published where it has one.

    `completion` is the share of episodes that placed the whole goal; `attempted_*` are over every
    attempted move, `placed_*` over the blocks in the world; `completion` and `attempted_f1` have
    the ends `*_lo` and `*_hi` of an interval; `detour` as in `endings_frame`. Under the headline
    setting, pooled over seeds; with more than one seed `*_mean` and `*_sd` over single seeds.
    Published rows have the recall alone.
    """
    design = run.design
    estimates = headline_rows(track_estimates(run, NAME), design)
    known = estimates.set_index(["measure", "criterion", "model"]).to_dict("index")
    ends = ("mean", "sd") if len(design.suite.seeds) > 1 else ()
    wanted = [(name, end) for name in _LEADING for end in ("value", "lo", "hi")]
    wanted += [(name, "value") for name in _SHOWN if name not in _LEADING]
    wanted += [(name, end) for name in _SHOWN for end in ends]
    endings: dict[str, Any] = {row["model"]: row for row in endings_frame(run).to_dict("records")}
    rows: list[dict[str, Any]] = []
    for model in design.model_names:
        row: dict[str, Any] = {"model": model, "source": OURS, "published_name": ""}
        for name, end in wanted:
            value = known.get((*_SHOWN[name], model), {}).get(end, np.nan)
            row[name if end == "value" else f"{name}_{end}"] = 100 * value
        rows.append(row | {name: endings[model][name] for name in ("detour", "n")})
        recall = published_recall(design.published.get(model, ""))
        if recall is not None:
            about = {"model": model, "source": PUBLISHED}
            rows.append({**about, "published_name": design.published[model], _RECALL: recall})
    return pd.DataFrame(rows)


def published_recall(model: str) -> float | None:
    """The recall that Table 3 prints for a model [%], None where it has no row."""
    printed = published_table(3).set_index(["model", "metric"])["value"].to_dict()
    return printed.get((model, "recall"))


def table3_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Shows the table of `table3_frame`, completed goals and F1 of attempts first."""
    design = run.design
    columns = [
        column
        for group in _LEADING.values()
        for column in (Column("%", group), *uncertainty_columns(design, group))
    ]
    rows = tuple(
        (
            row_name(row),
            *(
                text
                for name in _LEADING
                for text in (number(row[name]), *uncertainty_cells(row, name, design))
            ),
            *(number(row[name]) for name in _FURTHER),
            number(row["detour"], 2),
        )
        for row in table.to_dict("records")
    )
    return TextTable(
        f"Step-by-step planning (%){run.design.of_suite}",
        (_MODEL, *columns, *_FURTHER.values(), Column("Steps / fewest")),
        rows,
        tuple(_notes(table, run)),
    )


def _other_engine(run: Run) -> str:
    """The engine, where it is not that of reference."""
    is_other = ENGINE in run.manifest.tracks.get(NAME, {})
    return f" in {run.manifest.engine}" if is_other and run.manifest.engine else ""


def _notes(table: pd.DataFrame, run: Run) -> list[str]:
    steps = run.section("steps", StepsSpec)
    accepts = steps.setting or run.design.setting
    notes = [
        f"Scored in setting {run.design.setting}. The simulator goes by setting {accepts}, gating "
        f"{steps.gating}, physics {steps.physics}{_other_engine(run)}; feedback {steps.feedback}, "
        f"history as {steps.history}. Micro averages.",
        "Completed: episodes that placed the whole goal. Attempts: all moves; those that placed "
        "nothing are wrong. Placed blocks: those in the world; one is wrong when the goal has no "
        "such block left in this setting, or when it fell."
        + (_CONSTRUCTION if accepts == run.design.setting else ""),
        *seeds_notes(run.design),
    ]
    if (table["source"] == PUBLISHED).any():
        notes.append(_PUBLISHED_NOTE)
    ours = table[table["source"] == OURS]
    expected = run.design.samples(NAME)
    short = [
        f"{row['model']} {row['n']:.0f}" for row in ours.to_dict("records") if row["n"] < expected
    ]
    if short:
        notes.append(f"Scored of {expected} episodes: {', '.join(short)}.")
    return notes


def paper_table3_frame(run: Run) -> pd.DataFrame:
    """Recall of step planning beside the paper's Table 3; see the note of its view."""
    return interleaved(table3_frame(run), [_RECALL]) if is_asked(run) else NOTHING


def paper_table3_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Shows the table of `paper_table3_frame`."""
    note = f"Setting {run.design.setting}. {_PUBLISHED_NOTE}"
    names = {_RECALL: METRIC_NAMES["recall"]}
    return beside_view(table, run, number_in_paper=3, names=names, note=note)


def step_progress(run: Run) -> pd.DataFrame:
    """Share of the goal's blocks that stand after each step [%], mean over episodes.

    A row a step from 0, a column a model. An episode that has ended keeps what it built.
    """
    frame = progress_frame(run)
    table = 100 * frame.pivot(index="step", columns="model", values="blocks")
    table = table.reindex(columns=[name for name in run.design.model_names if name in table])
    start = pd.DataFrame(0.0, index=[0], columns=table.columns)
    return pd.concat([start, table]).rename_axis(index="step", columns=None)


def progress_by_turn(run: Run) -> Figure | None:
    """How far the structure is after each step, a line a model; None without an episode."""
    if not is_asked(run):
        return None
    table = step_progress(run)
    if not len(table.columns):
        return None
    last = table.iloc[-1].sort_values(ascending=False, kind="stable")
    figure, ax = curves({"-": table}, list(last.index), 3.2)
    ax.set(ylim=(0, 102), xlim=(0, None), xlabel="Step", ylabel="Blocks of the goal placed (%)")
    ax.locator_params(axis="x", integer=True)
    how = run.design.after_suite("mean over episodes; one that ended keeps its blocks")
    headed(figure, "Progress by step", how)
    return figure


def _operation(turn: EpisodeTurn) -> str:
    move = turn.parse.move
    if move is None:
        return "(no operation)"
    return "Done" if move == "Done" else f"Move({move})"


def episode_table(record: EpisodeRecord) -> TextTable:
    """Every step of an episode, wrong ones too."""
    columns = ("Step", "Operation", "Outcome", "Rule", "Placed")
    rows = tuple(
        (
            str(turn.step),
            _operation(turn),
            _outcome(turn),
            (turn.parse.rule or "none").replace("_", " "),
            f"{len(turn.world)} of {record.n_blocks}",
        )
        for turn in record.steps
    )
    return TextTable(
        f"{record.sample}: {_ending(record)}",
        tuple(Column(name, is_text=name not in ("Step", "Placed")) for name in columns),
        rows,
    )


def _outcome(turn: EpisodeTurn) -> str:
    name = turn.outcome or "unread"
    # Beyond the outcomes of moves there are ways in which a reply says none.
    return OUTCOME_NAMES.get(name, name.replace("_", " ").capitalize())


def episode_film(record: EpisodeRecord, task: AssemblyTask) -> Iterator[FilmStep]:
    """A frame for the empty ground, one a step, and one for how it ended."""
    yield FilmStep(f"{record.model}, {task.scene.id}", "plain", None, ())
    blocks: tuple[Block, ...] = ()
    for turn in record.steps:
        blocks = tuple(task.scene.blocks[vertex] for vertex in turn.world)
        tone: Tone = {"placed": "good", "done": "plain"}.get(turn.outcome or "", "bad")  # type: ignore[assignment]
        move = turn.parse.move
        caption = f"{turn.step}. {_operation(turn)}" + (
            "" if turn.outcome == "done" else f": {_outcome(turn)}"
        )
        yield FilmStep(caption, tone, move if isinstance(move, int) else None, blocks)
    by = ""
    if record.ending == "collapsed":
        blocks = settle(blocks).blocks
        # Older records say no engine, and no version of it.
        engine, now = record.engine or REFERENCE_ENGINE, described_engine()
        if engine not in (now, now.partition(" ")[0]):
            by = f" (falls in {now}, not {engine})"
    tone = "good" if record.ending == "completed" else "bad"
    placed = record.progress[-1] if record.progress else 0
    caption = (
        f"{placed} of {counted(record.n_blocks, 'block')} placed; ended: {_ending(record)}{by}"
    )
    yield FilmStep(caption, tone, None, blocks)


def _ending(record: EpisodeRecord) -> str:
    return ENDING_NAMES[record.ending]


_VIEW = EpisodeView(NAME, episode_table, episode_film, state_keys)
_MAIN, _RECALL_REPORT = "F1 of attempts", "Recall"
_COLUMNS = (
    HeadlineColumn("completion", WHOLE.name, "Completed"),
    HeadlineColumn("f1", WHOLE.name, _MAIN, "attempted"),
    HeadlineColumn("precision", WHOLE.name, "Precision of attempts", "attempted"),
    HeadlineColumn("recall", WHOLE.name, _RECALL_REPORT, "placed"),
    HeadlineColumn("f1", WHOLE.name, "F1 of placed blocks", "placed"),
)


def _references(run: Run) -> Mapping[str, Mapping[str, float]]:
    printed = {name: published_recall(name) for name in run.design.published.values()}
    return {
        f"{name}, published": {_RECALL_REPORT: value}
        for name, value in printed.items()
        if value is not None
    }


def _notes_report(run: Run) -> Sequence[str]:
    return (
        f"Percent, setting {run.design.setting}. Completed are episodes that placed the whole "
        "goal; F1 and precision of attempts count every move that placed nothing as wrong; recall "
        "is of the goal's blocks; F1 of placed blocks leaves out what placed nothing.",
    )


def _check_alike(run: Run, first: Run, _: Sequence[str], __: Measure) -> None:
    settings, wanted = run.design.suite.settings, first.design.setting
    if wanted not in settings:
        hint = "phyblock score reads stored replies again under other rules"
        message = f"was not scored as {first.path} was, by {wanted}"
        raise SpecError(Problem(str(run.path), message, "settings", ", ".join(settings), hint=hint))
    engine, other = (one.manifest.tracks.get(NAME, {}).get(ENGINE) for one in (run, first))
    if engine != other:
        found, wanted = (one.manifest.engine or REFERENCE_ENGINE for one in (run, first))
        message = f"let blocks go in another physics engine than {first.path}"
        hint = f"run one of them again with {PHYSICS_VARIABLE}"
        raise SpecError(Problem(str(run.path), message, "engine", found, wanted, hint))


REPORT = TrackReport(
    measures=STEP_MEASURES,
    headline=lambda _: _COLUMNS,
    main=_MAIN,
    short="steps_f1",
    references=_references,
    notes=_notes_report,
    tables={
        "table3": TableMaker(table3_frame, table3_view),
        "step_intervals": TableMaker(step_intervals, step_intervals_view, "table3"),
        "step_scores": TableMaker(step_scores_frame, None, "table3"),
        "endings": TableMaker(endings_frame, endings_view),
        "moves": TableMaker(moves_frame, moves_view, "endings"),
        "progress": TableMaker(progress_frame, progress_view),
        "step_orders": TableMaker(partial(order_frame, NAME, "placed"), order_view, "table3"),
        "step_scenes": TableMaker(partial(scenes_frame, NAME), scenes_view, "table3"),
    },
    main_figure="step-planning-f1",
    figures={
        "step-progress": FigureMaker("Blocks placed, turn by turn", progress_by_turn),
        "inference-steps": SceneFigure(
            "An episode and what it built", partial(inference, view=_VIEW)
        ),
    },
    paper_tables={3: PaperTable(paper_table3_frame, paper_table3_view)},
    check_alike=_check_alike,
    showing=lambda run: planning_words(run, "steps"),
    episodes=_VIEW,
)
