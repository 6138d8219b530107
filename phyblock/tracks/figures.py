"""Lines of models in a figure: the best have colors and names, the others are pale."""

from __future__ import annotations

import io
from collections.abc import Iterable, Mapping, Sequence
from itertools import cycle
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from PIL import Image

from phyblock.config.suite import ImagesSpec
from phyblock.data import AssemblyTask, Dataset
from phyblock.errors import Problem, SpecError
from phyblock.records.files import read_records
from phyblock.records.record import Record
from phyblock.sim.film import FilmStep, Tone
from phyblock.sim.pictures import Lookout, PictureStyle, candidates_png
from phyblock.tables.drawing import (
    COLORS,
    GRID,
    INK,
    MARKERS,
    MUTED,
    PALE,
    WIDTH_IN,
    bare_axes,
    drawn_width_in,
    headed,
    legend_below,
    name_across,
    names_width_in,
    new_figure,
    text_width_in,
    wrapped,
)
from phyblock.tables.load import Run
from phyblock.tables.track_report import EpisodeView
from phyblock.text import one_line, some_of
from phyblock.tracks.kind import kind_of
from phyblock.tracks.opening import picture_style
from phyblock.tracks.showing import as_recorded

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NAMED = 8
"""Models with a color and a name; there are so many colors that can be told apart."""


def line_look(place: int, name: str) -> dict[str, Any]:
    """How the line at a place from 0, the best first, looks, and what the legend calls it."""
    named = place < NAMED
    return {
        "color": COLORS[place] if named else PALE,
        "marker": MARKERS[place] if named else None,
        "linewidth": 1.3 if named else 0.7,
        "label": name if named else "_other",
        "zorder": 3 if named else 1,
    }


def curves(
    tables: Mapping[str, pd.DataFrame], models: Sequence[str], marker_pt: float
) -> tuple[Figure, Axes]:
    """A figure with a line a model, the best first, and style of line, which `tables` are by.

    A table has the places along the axis across as index, and a column a model. Lines of the first
    style have markers and stand in the legend.
    """
    figure = new_figure(3.1)
    ax = figure.subplots()
    for place, model in reversed(list(enumerate(models))):
        look = line_look(place, model)
        for style, table in tables.items():
            ax.plot(table.index, table[model], linestyle=style, markersize=marker_pt, **look)
            look |= {"marker": None, "label": "_other"}
    bare_axes([ax], "y")
    ax.spines["bottom"].set_color(GRID)
    ax.tick_params(colors=INK)
    handles, labels = ax.get_legend_handles_labels()
    legend_below(figure, handles[::-1], labels[::-1])
    return figure, ax


HATCHES = ("", "", "//", "..", "\\\\", "xx", "----", "++")
"""Hatches of parts by their place: they tell colors apart that look alike to some, or in print."""


class Part(NamedTuple):
    """A part of the whole: its name, its share of each model [%], and how it looks."""

    name: str
    shares: NDArray[np.float64]
    color: str
    ink: str


_LEAST_LABEL = 4.0


def share_bars(models: Sequence[str], parts: Iterable[Part], name: str) -> tuple[Figure, Axes]:
    """A figure with the parts as one line a model, `name` under them and a legend."""
    names_in = names_width_in(models)
    figure = new_figure(1.05 + 0.2 * len(models), names_in + 1.0)
    ax = figure.subplots()
    stack(ax, models, parts, 0.7, _LEAST_LABEL)
    ax.set(xlim=(0, 100), ylim=(len(models) - 0.4, -0.6))
    name_across(ax, name, figure.get_figwidth() - names_in)
    bare_axes([ax])
    legend_below(figure, *ax.get_legend_handles_labels())
    return figure, ax


def stack(
    ax: Axes, models: Sequence[str], parts: Iterable[Part], height: float, least_label: float
) -> None:
    """Draw the parts one after another, each of its own color and hatch.

    Numbers stand in parts of `least_label` [%] and more where the figure is as wide as the text;
    in a narrower one in larger parts.
    """
    least_label *= WIDTH_IN / drawn_width_in()
    places, start = np.arange(len(models)), np.zeros(len(models))
    for part, hatch in zip(parts, cycle(HATCHES), strict=False):
        ax.barh(
            places,
            part.shares,
            left=start,
            height=height,
            color=part.color,
            edgecolor="white",
            linewidth=0.8,
            hatch=hatch,
            label=part.name,
        )
        for place, share in enumerate(part.shares):
            if share >= least_label:
                middle, text = start[place] + share / 2, f"{share:.0f}"
                ax.text(
                    middle,
                    place,
                    text,
                    ha="center",
                    va="center",
                    color=part.ink,
                    fontsize=7,
                    bbox={"facecolor": part.color, "edgecolor": "none", "pad": 0.6},
                )
        start = start + part.shares
    ax.set_yticks(places, models)


_LEAST_IN = 5.5
_TEXT_PT = 6.5
_LINE_IN = 0.115
_MOST_LINES = 18
_TONES: dict[Tone, str] = {"plain": MUTED, "good": "#00704f", "bad": "#b4460a"}
_MARKS: dict[Tone, str] = {"plain": "", "good": "+ ", "bad": "− "}  # noqa: RUF001


def inference(run: Run, dataset: Dataset, scene: str, *, view: EpisodeView) -> Figure | None:
    """Goal, candidates and what was built in a row, the reply and its steps below.

    Of the scene that is named, else of the first in which a model placed some blocks and not all,
    models in the order of the run. None where no reply was read. Raises SpecError for a scene that
    the run has not.
    """
    sample = _chosen(run, view.track, scene)
    if sample is None:
        return None
    record = next(record for record in read_records(run.path) if record.sample == sample)
    tasks = {task.scene.id: task for task in dataset.tasks}
    task = as_recorded(tasks[record.scene], record)
    steps = list(view.frames(record, task))
    reply = _shortened(_reply(record), 0.46)
    outcomes = _outcome_lines(steps[1:], 0.46)
    n_lines = max(len(reply), len(outcomes), 1)
    figure = new_figure(0.5, _LEAST_IN)
    width = figure.get_figwidth()
    figure.set_figheight(0.5 + width / 3 + 0.35 + _LINE_IN * n_lines)
    heights = [width / 3, 0.35 + _LINE_IN * n_lines]
    grid = figure.add_gridspec(2, 6, height_ratios=heights)
    pictures = [figure.add_subplot(grid[0, n : n + 2]) for n in (0, 2, 4)]
    _pictures(pictures, task, steps[-1], picture_style(run.section("images", ImagesSpec)))
    left, right = (figure.add_subplot(grid[1, n : n + 3]) for n in (0, 3))
    _lines(left, "Reply", [(line, INK) for line in reply], n_lines)
    _lines(right, "Steps", outcomes, n_lines)
    headed(
        figure,
        f"{kind_of(view.track).title}: {one_line(record.model)}, scene {record.scene}",
        f"Seed {record.seed}; {steps[-1].caption}",
    )
    return figure


def _chosen(run: Run, track: str, scene: str) -> str | None:
    """The sample that is shown."""
    records = run.records[run.records["track"] == track]
    if scene:
        known = records["scene"].unique()
        if scene not in known:
            message, allowed = "has no such scene", some_of(sorted(known))
            raise SpecError(Problem(str(run.path), message, "--scene", scene, allowed))
        records = records[records["scene"] == scene]
    read = records[records["outcome"] == "ok"]
    scores = run.scores[run.scores["sample"].isin(read["sample"])]
    partly = set(scores[(scores["tp"] > 0) & (scores["fn"] > 0)]["sample"])
    for model in run.design.model_names:
        mine = read[read["model"] == model]["sample"]
        for sample in mine:
            if scene or sample in partly:
                return str(sample)
    return str(read["sample"].iloc[0]) if len(read) else None


def _reply(record: Record) -> str:
    if record.asked_turns:
        return "\n".join(turn.reply.text for turn in record.asked_turns)
    return record.reply.text if record.reply else ""


def _shortened(text: str, share: float) -> list[str]:
    """A reply in lines that fit a share of the width, its middle left out where there are many."""
    width = new_figure(1, _LEAST_IN).get_figwidth() * share
    lines = [
        line
        for given in text.strip().splitlines()
        for line in (_fitting(one_line(given), width) or [""])
    ]
    lines = [line for n, line in enumerate(lines) if line or (n and lines[n - 1])]
    half = _MOST_LINES // 2
    return lines if len(lines) <= _MOST_LINES else [*lines[:half], "[...]", *lines[-half + 1 :]]


def _fitting(text: str, width_in: float) -> list[str]:
    """A text in lines, words that are wider than a line cut short."""
    lines = wrapped(text, width_in, _TEXT_PT)
    return [_cut(line, width_in) for line in lines]


def _cut(line: str, width_in: float) -> str:
    if text_width_in(line, _TEXT_PT) <= width_in:
        return line
    share = width_in / text_width_in(line, _TEXT_PT)
    return line[: max(1, int(share * len(line)) - 4)] + "..."


def _outcome_lines(steps: Sequence[FilmStep], share: float) -> list[tuple[str, str]]:
    width = new_figure(1, _LEAST_IN).get_figwidth() * share
    lines = [(_cut(_MARKS[s.tone] + one_line(s.caption), width), _TONES[s.tone]) for s in steps]
    half = _MOST_LINES // 2
    if len(lines) <= _MOST_LINES:
        return lines
    return [*lines[:half], ("[...]", MUTED), *lines[-half + 1 :]]


def _pictures(
    axes: Sequence[Axes], task: AssemblyTask, last: FilmStep, style: PictureStyle
) -> None:
    lookout = Lookout(task.scene, style)
    with Image.open(io.BytesIO(candidates_png(task.candidates, style))) as grid:
        candidates = np.asarray(grid.convert("RGB"))
    goal, built = (np.asarray(lookout.image(b)) for b in (task.scene.blocks, last.blocks))
    shown = {"Goal": goal, "Candidates": candidates, "What was built": built}
    for ax, (title, image) in zip(axes, shown.items(), strict=True):
        ax.imshow(image)
        ax.set_title(title)
        ax.set_axis_off()


def _lines(ax: Axes, title: str, lines: Sequence[tuple[str, str]], n_lines: int) -> None:
    ax.set_title(title)
    ax.set_axis_off()
    for n, (line, color) in enumerate(lines):
        place = 1 - (n + 0.5) / n_lines
        ax.text(0, place, line, fontsize=_TEXT_PT, color=color, va="center", transform=ax.transAxes)
