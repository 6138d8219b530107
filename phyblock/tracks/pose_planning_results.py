"""What pose planning measures: poses that are right, how far off they are, what stands, and the
plan without its poses; by level.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from phyblock.data import AssemblyTask
from phyblock.domain import Block, PoseStep
from phyblock.errors import Problem, SpecError
from phyblock.scoring.counts import Floats, f1_of, mean_of, ratio_of
from phyblock.scoring.pose import POSE_ERRORS, POSE_FRAMES, PoseError, PoseFrame
from phyblock.scoring.pose_matching import TOLERANCES_CM
from phyblock.sim.dynamics import ExecutionLimits, execute
from phyblock.sim.engine import described_engine
from phyblock.sim.film import FilmStep, Tone
from phyblock.sim.geometry import put, upright
from phyblock.tables.cells import in_levels, level_cells
from phyblock.tables.design import OVERALL, Design
from phyblock.tables.drawing import COLORS, INK, headed
from phyblock.tables.listing import Listing, by_settings
from phyblock.tables.load import Run, made_once_copied
from phyblock.tables.measures import CELL, Measure, SampleCounts
from phyblock.tables.showing import planning_words
from phyblock.tables.text_table import (
    NO_VALUE,
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
    SceneFigure,
    TableMaker,
    TrackReport,
)
from phyblock.text import counted
from phyblock.tracks.base import CARRYING, ENGINE, FIRST_CARRYING
from phyblock.tracks.estimates import track_estimates
from phyblock.tracks.figures import Part, curves, inference, share_bars
from phyblock.tracks.pose_judging import (
    CARRIED,
    ERRORS,
    FITS,
    PLANS,
    RIGHT,
    PoseOutcome,
    PoseRecord,
    StepOutcome,
    worlds_of,
)
from phyblock.tracks.pose_planning import (
    LISTED_IN_C,
    POSE_FLOORS,
)
from phyblock.types import REFUSED_ENDS, Setting, StepEnd

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NAME = "pose_planning"

ERROR_NAMES: dict[PoseError, str] = {
    "wrong_kind": "Wrong kind",
    "wrong_rotation": "Wrong rotation",
    "too_early": "Too early",
    "off_sideways": "Off sideways",
    "off_height": "Off in height",
    "interpenetrating": "Interpenetrating",
    "floating": "Floating",
    "toppling": "Toppling others",
}
_ERROR_MEANINGS: dict[PoseError, str] = {
    "wrong_kind": "steps with a block that the goal does not need, or not so often",
    "wrong_rotation": "steps with a block that is turned as none of its kind in the goal is",
    "too_early": "steps with a block whose supports are not there",
    "off_sideways": "steps more than 1 cm off, more to a side than in height",
    "off_height": "steps more than 1 cm off, more in height than to a side",
    "interpenetrating": "steps with a right pose that were refused, as space was taken",
    "floating": "steps with a right pose whose block did not stay",
    "toppling": "steps with a right pose that moved other blocks",
}


def is_asked(run: Run) -> bool:
    """Whether the run has plans with poses."""
    return NAME in run.design.suite.tracks


def _f1(frame: PoseFrame, tolerances_cm: tuple[float, ...], sums: Floats) -> Floats:
    """Mean over tolerances of 2 TP / (steps + blocks)."""
    columns = RIGHT.columns
    whole = sums[..., columns.index("steps")] + sums[..., columns.index("blocks")]
    parts = [
        ratio_of(np.stack([2 * sums[..., columns.index(f"{frame}_{cm:g}")], whole], axis=-1))
        for cm in tolerances_cm
    ]
    return np.asarray(np.mean(parts, axis=0))


def _share(counted: SampleCounts, part: str, whole: str, sums: Floats) -> Floats:
    """Share of a column in another."""
    return ratio_of(_two(counted, part, whole, sums))


def _mean(counted: SampleCounts, column: str, number: str, sums: Floats) -> Floats:
    """Mean of what was summed in a column."""
    return mean_of(_two(counted, column, number, sums))


def _two(counted: SampleCounts, first: str, second: str, sums: Floats) -> Floats:
    return sums[..., [counted.columns.index(first), counted.columns.index(second)]]


def tolerance_measure(frame: PoseFrame, cm: float) -> str:
    """Name of F1 at one tolerance."""
    return f"f1_{frame}_{cm:g}cm".replace(".", "_")


def error_measure(error: PoseError) -> str:
    """Name of the measure of an error: its share of all steps."""
    return f"pose_{error}"


def _plan_f1(setting: Setting, meaning: str) -> Measure:
    name, heading = f"f1_{setting.lower()}", f"F1 in {setting}"
    return Measure(name, heading, PLANS[setting], f1_of, meaning, over="steps")


_WITHIN = "right steps within {} of their place and 15 degrees"

POSE_PLANNING_MEASURES = (
    Measure(
        "f1_c", "F1 in C", RIGHT, partial(_f1, "absolute", TOLERANCES_CM),
        _WITHIN.format("0.5, 1, 2 and 4 cm") + ", the mean of the four", over="steps",
        floors=POSE_FLOORS,
    ),
    Measure(
        "f1_c_aligned", "F1 in C, aligned", RIGHT, partial(_f1, "aligned", TOLERANCES_CM),
        "the same after the best shift over the floor and turn of the whole plan", over="steps",
        floors=POSE_FLOORS,
    ),
    *(
        Measure(
            tolerance_measure(frame, cm), f"F1 at {cm:g} cm{', aligned' * (frame == 'aligned')}",
            RIGHT, partial(_f1, frame, (cm,)), _WITHIN.format(f"{cm:g} cm"), over="steps",
            in_tables=frame == "absolute",
        )
        for frame in POSE_FRAMES
        for cm in TOLERANCES_CM
    ),
    _plan_f1("A", "the plan without its poses, as full planning scores it in setting A"),
    _plan_f1("B", "the same in setting B"),
    Measure(
        "position_error", "Position error", FITS, partial(_mean, FITS, "position_cm", "n"),
        "distance of steps from the blocks that they stand for", unit="cm", better="lower",
        over="steps", most=math.inf,
    ),
    Measure(
        "rotation_error", "Rotation error", FITS, partial(_mean, FITS, "turn_deg", "n"),
        "how far these steps are turned, up to symmetry", unit="degrees", better="lower",
        over="steps", most=180.0,
    ),
    Measure(
        "volume_iou", "Volume IoU", FITS, partial(_mean, FITS, "iou", "n"),
        "what these steps and their blocks have in common of their volume", over="steps",
    ),
    Measure(
        "stands", "Steps that stand", CARRIED, partial(_share, CARRIED, "stands", "steps"),
        "steps carried out that stay and let others stay", over="steps",
    ),
    Measure(
        "reached", "Blocks reached", CARRIED, partial(_share, CARRIED, "reached", "blocks"),
        "blocks of the goal within 1 cm and 10 degrees in the end, by the suite's tolerances",
        over="blocks",
    ),
    Measure(
        "final_iou", "Final IoU", CARRIED, partial(_mean, CARRIED, "iou", "plans"),
        "what stands in the end and the goal have in common, in voxels of 5 mm", over="plans",
    ),
    Measure(
        "completed", "Completed", CARRIED, partial(_share, CARRIED, "completed", "plans"),
        "plans that end as the goal, with nothing left over", over="plans",
    ),
    *(
        Measure(
            error_measure(error), ERROR_NAMES[error], ERRORS,
            partial(_share, ERRORS, error, "steps"), _ERROR_MEANINGS[error], better="lower",
            over="steps", in_tables=False,
        )
        for error in POSE_ERRORS
    ),
)  # fmt: skip


_INTERVAL = "95 % CI"
_INTERVAL_C = f"C, {_INTERVAL}"
_SETTINGS = {"f1_a": "A", "f1_b": "B", "f1_c": "C"}
_CURVE = {tolerance_measure("absolute", cm): f"{cm:g} cm" for cm in TOLERANCES_CM}
_CARRIED = {
    "stands": "Stand",
    "reached": "Reached",
    "final_iou": "IoU",
    "completed": "Completed",
}
_SHOWN = (*_SETTINGS, *_CURVE, "f1_c_aligned", "position_error", *_CARRIED)
_SCALES = {measure.name: measure.scale for measure in POSE_PLANNING_MEASURES}


def _overall(run: Run) -> dict[tuple[str, str], dict[Hashable, Any]]:
    """Estimates over all scenes by model and measure."""
    estimates = track_estimates(run, NAME)
    rows = estimates[estimates[CELL] == OVERALL].to_dict("records")
    return {(str(row["model"]), str(row["measure"])): row for row in rows}


@made_once_copied
def table_c_frame(run: Run) -> pd.DataFrame:
    """One row a model, over all scenes: F1 without poses in A and in B, with them in C, and what
    became of plans that were carried out, each with the ends of a 95 % interval.

    Shares in percent, distances in centimeters; `n` plans.
    """
    rows = []
    known = _overall(run)
    for model in run.design.model_names if is_asked(run) else ():
        row: dict[str, Any] = {"model": model, "n": int(_of(known, model, "final_iou").get("n", 0))}
        for name in _SHOWN:
            estimate = _of(known, model, name)
            for end, suffix in (("value", ""), ("lo", "_lo"), ("hi", "_hi")):
                row[f"{name}{suffix}"] = _SCALES[name] * float(estimate.get(end, float("nan")))
        rows.append(row)
    return pd.DataFrame(rows)


def _of(
    known: Mapping[tuple[str, str], Mapping[Hashable, Any]], model: str, name: str
) -> Mapping[Hashable, Any]:
    return known.get((model, name), {})


def table_c_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Table C out of `table_c_frame`."""
    columns = [Column("Model", is_text=True)]
    columns += [Column(name, "F1 in") for name in _SETTINGS.values()]
    columns += [Column(_INTERVAL_C, "F1 in")]
    columns += [Column(name, "F1 in C at") for name in _CURVE.values()]
    columns += [Column("aligned", "F1 in C"), Column("cm", "Off by")]
    columns += [Column(name, "Carried out") for name in _CARRIED.values()]
    rows = [
        (
            row["model"],
            *(number(row[name]) for name in _SETTINGS),
            between(row["f1_c_lo"], row["f1_c_hi"]),
            *(number(row[name]) for name in _CURVE),
            number(row["f1_c_aligned"]),
            number(row["position_error"], 2),
            *(number(row[name]) for name in _CARRIED),
        )
        for row in table.to_dict("records")
    ]
    return TextTable(
        f"What poses cost (%){run.design.of_suite}",
        tuple(columns),
        tuple(rows),
        (
            f"One reply, scored three times: A and B leave out the poses, matcher "
            f"{run.design.matcher}; C is the mean of F1 at 0.5, 1, 2 and 4 cm and 15 degrees. "
            f"{level_name(OVERALL)}; micro averages.",
            "Aligned: after the best shift over the floor and turn of the whole plan. Off by: mean "
            "distance of steps from the blocks that they stand for. Stand: steps "
            "carried out that stay and let others stay. Reached: blocks of the goal in their "
            "places in the end. IoU: of all that stands then with the goal.",
        ),
    )


@made_once_copied
def pose_errors_frame(run: Run) -> pd.DataFrame:
    """One row a model and error, over all scenes: its share of all steps with a 95 % interval [%];
    `n` plans.
    """
    known = _overall(run)
    rows = []
    for model in run.design.model_names if is_asked(run) else ():
        for error in POSE_ERRORS:
            estimate = _of(known, model, error_measure(error))
            ends = {
                end: 100 * float(estimate.get(end, float("nan"))) for end in ("value", "lo", "hi")
            }
            rows.append({"model": model, "error": error, **ends, "n": int(estimate.get("n", 0))})
    return pd.DataFrame(rows)


def pose_errors_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Shares of the errors out of `pose_errors_frame`, a row a model."""
    cells = {(row["model"], row["error"]): row for row in table.to_dict("records")}
    names = ("%", _INTERVAL)
    columns = [Column(name, ERROR_NAMES[error]) for error in POSE_ERRORS for name in names]
    rows = [
        (
            str(model),
            *(text for error in POSE_ERRORS for text in with_interval(cells[model, error])),
        )
        for model in dict.fromkeys(table["model"] if len(table) else ())
    ]
    return TextTable(
        f"What was wrong with steps that have poses{run.design.of_suite}",
        (Column("Model", is_text=True), *columns),
        tuple(rows),
        (
            "Shares of all steps, of which the rest was right within 1 cm and stood; each step "
            "counts by the first error that it meets. docs/pose.md says what each is.",
        ),
    )


_LOOKS: dict[PoseError, tuple[str, str]] = {
    "wrong_kind": (COLORS[1], "white"),
    "wrong_rotation": (COLORS[4], "black"),
    "too_early": (COLORS[3], "black"),
    "off_sideways": (COLORS[0], "white"),
    "off_height": (COLORS[5], "black"),
    "interpenetrating": (COLORS[6], "white"),
    "floating": (COLORS[2], "black"),
    "toppling": ("#8fd6bf", "black"),
}


def tolerance_curve(run: Run) -> pd.DataFrame:
    """F1 in C [%] over all scenes: a row a tolerance [cm], columns by frame and model."""
    estimates = track_estimates(run, NAME)
    mine = estimates[estimates[CELL] == OVERALL].set_index(["measure", "model"])["value"].to_dict()
    columns = {
        (frame, model): [
            100 * float(mine.get((tolerance_measure(frame, cm), model), float("nan")))
            for cm in TOLERANCES_CM
        ]
        for frame in POSE_FRAMES
        for model in run.design.model_names
    }
    table = pd.DataFrame(columns, index=pd.Index(TOLERANCES_CM, name="cm"))
    return table.dropna(axis="columns", how="all")


def f1_by_tolerance(run: Run) -> Figure | None:
    """F1 in C at each tolerance, a line a model, dashed where plans are aligned; None without a
    plan.
    """
    if not is_asked(run):
        return None
    table = tolerance_curve(run)
    if not len(table.columns):
        return None
    ranks = table_c_frame(run).set_index("model")["f1_c"].dropna()
    models = ranks.sort_values(ascending=False, kind="stable").index
    styles: dict[str, PoseFrame] = {"-": "absolute", ":": "aligned"}
    by_style = {style: pd.DataFrame(table[frame]) for style, frame in styles.items()}
    figure, ax = curves(by_style, list(models), 3.4)
    ax.set(ylim=(0, 102), xlabel="Tolerance (cm)", ylabel="F1 in setting C (%)", xscale="log")
    ax.set_xticks(list(TOLERANCES_CM), [f"{cm:g}" for cm in TOLERANCES_CM])
    ax.minorticks_off()
    how = run.design.after_suite("15 degrees; dotted: the whole plan aligned first")
    headed(figure, "F1 by tolerance", how)
    return figure


def pose_error_bars(run: Run) -> Figure | None:
    """Shares of the errors in all steps of each model, of which one may have none; None without a
    wrong step.
    """
    table = pose_errors_frame(run)
    if not len(table) or not (table["value"] > 0).any():
        return None
    shares = table.pivot(index="model", columns="error", values="value")
    ranks = table_c_frame(run).set_index("model")["f1_c"]
    models = list(ranks.sort_values(ascending=False, kind="stable").index)
    parts = (
        Part(
            ERROR_NAMES[error], shares.loc[models, error].fillna(0).to_numpy(float), *_LOOKS[error]
        )
        for error in POSE_ERRORS
    )
    figure, ax = share_bars(models, parts, "Share of steps (%)")
    for place, model in enumerate(models):
        if shares.loc[model].isna().all():
            ax.text(1, place, "no steps", va="center", fontsize=7, color=INK)
    headed(figure, "What was wrong with steps", "by the first error that each meets; all levels")
    return figure


_ENDS: dict[StepEnd, str] = {
    "stands": "stands",
    "falls": "falls",
    "knocks_over": "knocks others over",
    "overlaps": "overlaps",
    "under_floor": "under the floor",
    "no_block": "no such block",
}


def pose_table(record: PoseRecord) -> TextTable:
    """Every step: what it puts where, how far off that is, and how it ended."""
    columns = ("Step", "Block", "At (cm)", "Off by (cm)", "Ended", "Error")
    given = record.parse.steps if record.parse else ()
    steps = record.pose.steps if record.pose else ()
    rows = tuple(
        (
            str(n),
            str(one.block),
            ", ".join(f"{part:g}" for part in one.center_cm),
            NO_VALUE if step.position_cm is None else number(step.position_cm, 2),
            _ended(step),
            "" if step.error is None else ERROR_NAMES[step.error],
        )
        for n, (one, step) in enumerate(zip(given, steps, strict=True), 1)
    )
    text = ("At (cm)", "Ended", "Error")
    return TextTable(
        f"{record.sample}: {_came_to(record, record.pose)}",
        tuple(Column(name, is_text=name in text) for name in columns),
        rows,
        () if given else (_no_plan(record),),
    )


def pose_film(record: PoseRecord, task: AssemblyTask) -> Iterator[FilmStep]:
    """A frame for the plan as it was given, one for the world after each step, and one for the end.

    A plan of which the record does not keep where blocks came to lie is carried out again, in the
    engine that is chosen now.
    """
    given = record.parse.steps if record.parse else ()
    pose, candidates = record.pose, task.candidates
    if pose is None:
        return
    if pose.rotation == "free":
        candidates, _ = upright(candidates)
    steps = [PoseStep(one.block, one.center_cm, one.euler_deg) for one in given]
    blocks = [put(step, candidates) for step in steps]
    yield FilmStep(
        f"{record.model}, {task.scene.id}: the plan as given", "plain", None,
        tuple(block for block in blocks if block is not None),
    )  # fmt: skip
    worlds = _kept_worlds(blocks, pose.steps)
    by = ""
    if worlds is None:
        tolerances = pose.limits
        limits = ExecutionLimits(tolerances.overlap_cm, tolerances.stand_cm, tolerances.stand_deg)
        worlds = execute(blocks, limits).worlds
        if pose.engine != (engine := described_engine()):
            by = f" (shown in {engine}, not {pose.engine})"
    for n, (one, step, world) in enumerate(zip(given, pose.steps, worlds, strict=True), 1):
        tone: Tone = "good" if step.error is None else "bad"
        where = "" if step.error is None or step.end != "stands" else _where(step.error)
        yield FilmStep(f"{n}. block {one.block}: {_ended(step)}{where}", tone, one.block, world)
    tone = "good" if pose.completed else "bad"
    yield FilmStep(f"{_came_to(record, pose)}{by}", tone, None, worlds[-1] if worlds else ())


def _kept_worlds(
    blocks: Sequence[Block | None], steps: Sequence[StepOutcome]
) -> tuple[tuple[Block, ...], ...] | None:
    """The blocks after each step, None where that was not kept."""
    kept = [step.rests for step in steps if step.rests is not None]
    if len(kept) < len(steps):
        return None
    return worlds_of(blocks, [step.end not in REFUSED_ENDS for step in steps], kept)


def _no_plan(record: PoseRecord) -> str:
    """Why there is not one step."""
    why = "there is no reply"
    if record.error is not None:
        why = record.error.message
    elif record.parse is not None and record.parse.problem is not None:
        why = f"nothing could be read out of the reply ({record.parse.problem})"
    return f"There is no plan: {why}."


def _ended(step: StepOutcome) -> str:
    if step.end == "falls":
        return f"falls, {number(step.moved_cm)} cm from its place"
    if step.end == "knocks_over":
        return f"knocks over {', '.join(map(str, step.knocked))}"
    return _ENDS[step.end]


def _where(error: PoseError) -> str:
    """What is wrong with a step that stands."""
    return f", but {ERROR_NAMES[error].lower()}"


def _came_to(record: PoseRecord, pose: PoseOutcome | None) -> str:
    if pose is None:
        return "nothing was carried out"
    return f"{pose.reached} of {counted(record.n_blocks, 'block')} reached, IoU {pose.iou:.2f}"


_MAIN = "Overall F1 in C"
_VIEW = EpisodeView(NAME, pose_table, pose_film)


def _headline(run: Run) -> tuple[HeadlineColumn, ...]:
    levels = [
        HeadlineColumn("f1_c", cell.name, _MAIN if cell.name == OVERALL else level_name(cell.name))
        for cell in level_cells(run)
    ]
    sides = [
        HeadlineColumn(name, OVERALL, heading)
        for name, heading in (("f1_a", "F1 in A"), ("stands", "Stand"), ("completed", "Completed"))
    ]
    return (*levels, *sides)


def _notes(run: Run) -> Sequence[str]:
    return (
        "F1 in setting C in percent: steps right in kind, rotation and order, and in place, mean "
        f"over 0.5, 1, 2 and 4 cm; F1 in A leaves out the poses, matcher {run.design.matcher}.",
    )


def _check_alike(run: Run, first: Run, _: Sequence[str], measure: Measure) -> None:
    """What is counted of the world depends on how plans are carried out, F1 does not."""
    if measure.counted not in (CARRIED, ERRORS):
        return
    for key, unsaid in ((CARRYING, FIRST_CARRYING), (ENGINE, None)):
        found, wanted = (one.manifest.tracks.get(NAME, {}).get(key, unsaid) for one in (run, first))
        if found != wanted:
            message = f"carried plans out otherwise than {first.path}, which decides {measure.name}"
            hint = "run the older one again, or compare by f1_c"
            field = f"tracks.{NAME}.{key}"
            raise SpecError(Problem(str(run.path), message, field, str(found), str(wanted), hint))


def _listings(design: Design) -> tuple[Listing, ...]:
    return (LISTED_IN_C, *by_settings(design))


REPORT = TrackReport(
    measures=POSE_PLANNING_MEASURES,
    cells=level_cells,
    in_cells=in_levels,
    headline=_headline,
    main=_MAIN,
    short="f1_c",
    notes=_notes,
    tables={
        "table_c": TableMaker(table_c_frame, table_c_view),
        "pose_errors": TableMaker(pose_errors_frame, pose_errors_view),
    },
    main_figure="f1-poses",
    figures={
        "f1-tolerance": FigureMaker("F1 with poses, by tolerance", f1_by_tolerance),
        "pose-errors": FigureMaker(
            "Steps with poses that were wrong, by what was wrong first", pose_error_bars
        ),
        "inference-poses": SceneFigure(
            "A plan with poses and what it built", partial(inference, view=_VIEW)
        ),
    },
    check_alike=_check_alike,
    episodes=_VIEW,
    listings=_listings,
    showing=lambda run: planning_words(run, "pose"),
)
