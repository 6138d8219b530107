"""Measures of episodes: moves, completed goals, how episodes ended, what became of each step."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from phyblock.errors import Problem, SpecError
from phyblock.results.text import Column, TextTable
from phyblock.scoring.counts import f1_of, precision_of, recall_of
from phyblock.scoring.plan import ERROR_TYPES
from phyblock.sim.dynamics import settle
from phyblock.sim.engine import PHYSICS_VARIABLE, REFERENCE_ENGINE, described_engine
from phyblock.sim.film import FilmStep, Tone
from phyblock.text import counted
from phyblock.tracks.base import ENGINE
from phyblock.tracks.full_planning import POSE_MEASURES
from phyblock.tracks.measures import (
    WHOLE,
    EpisodeView,
    HeadlineColumn,
    Measure,
    SampleCounts,
    TrackReport,
    share,
)
from phyblock.tracks.step_planning import (
    ENDINGS,
    STEP_FLOORS,
    EpisodeRecord,
    EpisodeTurn,
    StepsSpec,
)

if TYPE_CHECKING:
    import pandas as pd

    from phyblock.data import AssemblyTask
    from phyblock.domain import Block
    from phyblock.results.load import Run

NAME = "step_planning"
STEP_OUTCOMES = ("placed", *ERROR_TYPES, "invalid", "unread", "done")
"""What becomes of a step; `unread` are replies in which no single operation could be read."""
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


def _moves(run: Run) -> pd.DataFrame:
    return run.scored(NAME, ("tp", "fp", "fn"))


def _episodes(run: Run) -> pd.DataFrame:
    """A row an episode: its ending, its steps by outcome, and what it took to complete a goal."""
    rows = run.counted(NAME)
    taken = [Counter(one if one in STEP_OUTCOMES else "unread" for one in outcomes)
             for outcomes in rows["outcomes"]]  # fmt: skip
    steps = rows["outcomes"].map(len).astype("int64")
    whole = (rows["ending"] == "completed").astype("int64")
    about: dict[str, Any] = {
        f"ended_{name}": (rows["ending"] == name).astype("int64") for name in ENDINGS
    }
    about |= {f"step_{name}": [counts[name] for counts in taken] for name in STEP_OUTCOMES}
    about |= {"completed": whole, "episodes": 1, "steps": steps, "finishing": whole * steps}
    return rows.assign(**about, fewest=whole * rows["n_blocks"].astype("int64"))


_MOVES = SampleCounts("moves", ("tp", "fp", "fn"), _moves)
_EPISODES = SampleCounts(
    "episodes",
    (
        *("completed", "episodes", "steps", "finishing", "fewest"),
        *(f"ended_{name}" for name in ENDINGS),
        *(f"step_{name}" for name in STEP_OUTCOMES),
    ),
    _episodes,
)

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
    share(_EPISODES, "completed", "episodes", "Completed", name="completion",
          meaning="episodes that placed the whole goal"),
    *POSE_MEASURES,
    share(_EPISODES, "steps", "episodes", "Steps", unit="steps", better="lower",
          meaning="steps of an episode, in the mean"),
    share(_EPISODES, "finishing", "fewest", "Steps / fewest", name="detour", unit="",
          better="lower", meaning="steps of completed episodes over the fewest that do"),
    *(
        share(_EPISODES, f"ended_{name}", "episodes", ENDING_NAMES[name], better="lower",
              meaning="episodes that ended so")
        for name in ENDINGS if name != "completed"
    ),
    *(
        share(_EPISODES, f"step_{name}", "steps", OUTCOME_NAMES[name],
              better="higher" if name == "placed" else "lower", meaning="steps that ended so")
        for name in STEP_OUTCOMES
    ),
)  # fmt: skip

_MAIN = "F1 of attempts"
_COLUMNS = (
    HeadlineColumn("completion", WHOLE.name, "Completed"),
    HeadlineColumn("f1", WHOLE.name, _MAIN, "attempted"),
    HeadlineColumn("precision", WHOLE.name, "Precision of attempts", "attempted"),
    HeadlineColumn("recall", WHOLE.name, "Recall", "placed"),
    HeadlineColumn("f1", WHOLE.name, "F1 of placed blocks", "placed"),
)


def _notes(run: Run) -> Sequence[str]:
    steps = run.design.suite.section(StepsSpec)
    engine = f" in {run.manifest.engine}" if ENGINE in run.manifest.tracks.get(NAME, {}) else ""
    return (
        f"Percent. Scored in setting {run.design.setting}; the simulator goes by setting "
        f"{steps.setting or run.design.setting}, gating {steps.gating}, physics {steps.physics}"
        f"{engine}; feedback {steps.feedback}, history as {steps.history}. F1 and precision of "
        "attempts count every move that placed nothing as wrong; F1 of placed blocks leaves out "
        "what placed nothing.",
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


def _operation(turn: EpisodeTurn) -> str:
    move = turn.parse.move
    if move is None:
        return "(no operation)"
    return "Done" if move == "Done" else f"Move({move})"


def _outcome(turn: EpisodeTurn) -> str:
    name = turn.outcome or "unread"
    # Beyond the outcomes of moves there are ways in which a reply says none.
    return OUTCOME_NAMES.get(name, name.replace("_", " ").capitalize())


def _table(record: EpisodeRecord) -> TextTable:
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
        f"{record.sample}: {ENDING_NAMES[record.ending]}",
        tuple(Column(name, is_text=name not in ("Step", "Placed")) for name in columns),
        rows,
    )


def _film(record: EpisodeRecord, task: AssemblyTask) -> Iterator[FilmStep]:
    """A frame for the empty ground, one a step, and one for how it ended."""
    yield FilmStep(f"{record.model}, {task.scene.id}", "plain", None, ())
    blocks: tuple[Block, ...] = ()
    for turn in record.steps:
        blocks = tuple(task.scene.blocks[vertex] for vertex in turn.world)
        tones: dict[str, Tone] = {"placed": "good", "done": "plain"}
        ending = "" if turn.outcome == "done" else f": {_outcome(turn)}"
        caption = f"{turn.step}. {_operation(turn)}{ending}"
        candidate = turn.parse.move if isinstance(turn.parse.move, int) else None
        yield FilmStep(caption, tones.get(turn.outcome or "", "bad"), candidate, blocks)
    by = ""
    if record.ending == "collapsed":
        blocks = settle(blocks).blocks
        # Older records say no engine, and no version of it.
        engine, now = record.engine or REFERENCE_ENGINE, described_engine()
        if engine not in (now, now.partition(" ")[0]):
            by = f" (falls in {now}, not {engine})"
    placed = record.progress[-1] if record.progress else 0
    how = f"{placed} of {counted(record.n_blocks, 'block')} placed; ended: "
    tone: Tone = "good" if record.ending == "completed" else "bad"
    yield FilmStep(f"{how}{ENDING_NAMES[record.ending]}{by}", tone, None, blocks)


REPORT = TrackReport(
    measures=STEP_MEASURES,
    headline=lambda _: _COLUMNS,
    main=_MAIN,
    short="steps_f1",
    notes=_notes,
    check_alike=_check_alike,
    showing=lambda run: run.showing("steps"),
    episodes=EpisodeView(_table, _film),
)
