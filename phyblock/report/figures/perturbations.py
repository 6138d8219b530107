"""One scene in all the ways in which a suite shows it."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from phyblock.config.suite import FACTORS, ImagesSpec, with_values
from phyblock.data import AssemblyTask, Dataset
from phyblock.errors import Problem, SpecError
from phyblock.report.sensitivity_view import factor_name
from phyblock.sim.pictures import PictureStyle, candidates_key, candidates_png, goal_key, goal_png
from phyblock.tables.drawing import drawn_width_in, headed, new_figure
from phyblock.tables.load import Run
from phyblock.text import some_of
from phyblock.tracks.opening import picture_style
from phyblock.tracks.showing import in_order, shown_order

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["perturbation_strip"]

_CELL_IN = 1.1
_IMAGES, _ORDER = "images", "candidate_order"
_Shown = tuple[str, AssemblyTask, PictureStyle]


def perturbation_strip(run: Run, dataset: Dataset, scene: str) -> Figure | None:
    """Goal above candidates, a column a way of asking: the reference, then one factor at a time.

    Ways that change no picture have none. Of the scene that is named, else of the first; None
    where pictures are all alike, or nothing was asked. Raises SpecError for a scene that the run
    has not.
    """
    tasks = {task.scene.id: task for task in dataset.tasks}
    asked = sorted(tasks.keys() & set(run.records["scene"]))
    if scene and scene not in asked:
        message, allowed = "has no such scene", some_of(asked)
        raise SpecError(Problem(str(run.path), message, "--scene", scene, allowed))
    if not asked:
        return None
    task = tasks[scene or asked[0]]
    shown: dict[tuple[str, str], _Shown] = {}
    for title, one, style in _ways(run, task):
        key = goal_key(one.scene, style), candidates_key(one.candidates, style)
        shown.setdefault(key, (title, one, style))
    if len(shown) < 2:
        return None
    columns = min(len(shown), max(2, int(drawn_width_in() / _CELL_IN)))
    rows = math.ceil(len(shown) / columns)
    side = drawn_width_in() / columns
    figure = new_figure(0.5 + rows * (2 * side + 0.3))
    axes = figure.subplots(2 * rows, columns, squeeze=False)
    for ax in axes.ravel():
        ax.set_axis_off()
    for n, (title, one, style) in enumerate(shown.values()):
        row, column = divmod(n, columns)
        _show(axes[2 * row, column], goal_png(one.scene, style))
        _show(axes[2 * row + 1, column], candidates_png(one.candidates, style))
        axes[2 * row, column].set_title(title, fontsize=7, pad=3)
    how = f"scene {task.scene.id}; goal above candidates, one factor changed at a time"
    headed(
        figure,
        "One scene in all the ways in which it is shown",
        run.design.after_suite(how),
    )
    return figure


def _ways(run: Run, task: AssemblyTask) -> Iterator[_Shown]:
    """Title, scene and style of the reference, then of each other level of every factor."""
    vary, images = run.design.suite.vary, run.section(_IMAGES, ImagesSpec)
    seed = run.design.suite.seeds[0]
    yield "reference", task, picture_style(images)
    for factor in vary.factors:
        for level in vary.names(factor)[1:]:
            title = f"{factor_name(factor)}:\n{level}"
            path = FACTORS[factor] or ()
            if path[:1] == (_IMAGES,):
                changed = with_values(images, {path[1:]: vary.value(factor, level)})
                yield title, task, picture_style(changed)
            elif factor == _ORDER:
                mixed = in_order(task, shown_order(task, seed), task)
                yield title, mixed, picture_style(images)


def _show(ax: Axes, png: bytes) -> None:
    with Image.open(io.BytesIO(png)) as image:
        ax.imshow(np.asarray(image.convert("RGB")))
