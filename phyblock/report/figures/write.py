"""All figures of a run, as SVG and PNG in its folder."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from phyblock.report.figures.data import dataset_levels
from phyblock.report.figures.errors import error_bars
from phyblock.report.figures.levels import f1_bars, f1_radar, settings_dots
from phyblock.report.figures.scatter import f1_by_cost, f1_by_size
from phyblock.report.figures.style import png_bytes, styled, svg_bytes
from phyblock.report.figures.tracks import progress_by_turn, vqa_heat_map
from phyblock.report.load import Run
from phyblock.run.folder import run_folder

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["FIGURES", "figure_files", "write_figures"]

_FOLDER = "figures"
_FORMS = {"svg": svg_bytes, "png": png_bytes}

_PLANNING: dict[str, Callable[[Run], Figure | None]] = {
    "f1-levels": f1_bars,
    "f1-radar": f1_radar,
    "settings": settings_dots,
    "error-types": error_bars,
    "f1-size": f1_by_size,
    "f1-cost": f1_by_cost,
}
_ANY: dict[str, Callable[[Run], Figure | None]] = {
    "vqa-subtasks": vqa_heat_map,
    "step-progress": progress_by_turn,
    "scenes": dataset_levels,
}
FIGURES = (*_PLANNING, *_ANY)
"""Names of all figures, in the order in which they are shown."""


def write_figures(run: Run, names: Sequence[str] = FIGURES) -> tuple[Path, ...]:
    """Draw figures into `figures/` of the run's folder, NAME.svg and NAME.png.

    Figures that the run has no numbers for are left out. The same records give the same bytes.
    Raises StoreError for a folder that cannot be written, and, before anything is drawn, naming
    every file in the way that we never wrote.
    """
    makers = {**(_PLANNING if run.design.tracks else {}), **_ANY}
    folder = run_folder(run.path)
    folder.check(figure_files(names))
    files: list[Path] = []
    with styled():
        for name in (name for name in makers if name in names):
            figure = makers[name](run)
            if figure is None:
                continue
            for ending, draw in _FORMS.items():
                files += folder.write({f"{_FOLDER}/{name}.{ending}": draw(figure)})
                # Laid out once: the next format takes what the first has found.
                figure.set_layout_engine("none")
    return tuple(files)


def figure_files(names: Sequence[str] = FIGURES) -> tuple[str, ...]:
    """Every file of these figures, by its name in a run folder."""
    return tuple(f"{_FOLDER}/{name}.{ending}" for name in names for ending in _FORMS)
