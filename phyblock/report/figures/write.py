"""All figures of a run, as SVG and PNG in its folder."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from phyblock.errors import Problem, StoreError
from phyblock.files import atomic_write
from phyblock.report.figures.data import dataset_levels
from phyblock.tables.drawing import png_bytes, styled, svg_bytes
from phyblock.tables.load import Run
from phyblock.tracks.full_planning.figures.errors import error_bars
from phyblock.tracks.full_planning.figures.levels import f1_bars, f1_radar, settings_dots
from phyblock.tracks.full_planning.figures.scatter import f1_by_cost, f1_by_size
from phyblock.tracks.vqa.figure import progress_by_turn, vqa_heat_map

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["FIGURES", "write_figures"]

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
    Raises StoreError for a folder that cannot be written.
    """
    makers = {**(_PLANNING if run.design.tracks else {}), **_ANY}
    folder = run.path / "figures"
    files: list[Path] = []
    try:
        folder.mkdir(exist_ok=True)
        with styled():
            for name in (name for name in makers if name in names):
                figure = makers[name](run)
                if figure is None:
                    continue
                for ending, draw in (("svg", svg_bytes), ("png", png_bytes)):
                    files.append(folder / f"{name}.{ending}")
                    atomic_write(files[-1], draw(figure))
                    # Laid out once: the next format takes what the first has found.
                    figure.set_layout_engine("none")
    except OSError as error:
        raise StoreError(Problem(str(folder), f"cannot be written: {error.strerror}")) from error
    return tuple(files)
