"""All figures of a run, as SVG and PNG in its folder."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from phyblock.errors import Problem, StoreError
from phyblock.files import atomic_write
from phyblock.report.figures.bars import main_measure, measure_bars
from phyblock.report.figures.data import dataset_levels
from phyblock.tables.drawing import png_bytes, styled, svg_bytes
from phyblock.tables.load import Run
from phyblock.tracks.kind import kind_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["figure_names", "figure_titles", "write_figures"]

_SCENES = "scenes"


def _makers(run: Run) -> dict[str, Callable[[Run], Figure | None]]:
    """Figures of a run by name: of its tracks, in their order, then of its scenes."""
    makers: dict[str, Callable[[Run], Figure | None]] = {}
    for track in run.design.suite.tracks:
        makers[_bars_name(track)] = partial(measure_bars, track=track)
        makers |= kind_of(track).report().figures
    return {**makers, _SCENES: dataset_levels}


def _bars_name(track: str) -> str:
    return kind_of(track).report().bars or f"{track.replace('_', '-')}-{main_measure(track).name}"


def figure_names(run: Run) -> tuple[str, ...]:
    """Names of all figures that a run may have, in the order in which they are shown."""
    return tuple(_makers(run))


def figure_titles(run: Run) -> dict[str, str]:
    """What people read in the place of the names."""
    titles = {_SCENES: "The scenes of the run by level"}
    for track in run.design.suite.tracks:
        report = kind_of(track).report()
        titles[_bars_name(track)] = f"{kind_of(track).title}: {main_measure(track).heading}"
        titles |= report.figure_titles
    return titles


def write_figures(run: Run, names: Sequence[str] = ()) -> tuple[Path, ...]:
    """Draw figures into `figures/` of the run's folder, NAME.svg and NAME.png; all without `names`.

    Figures that the run has no numbers for are left out. The same records give the same bytes.
    Raises StoreError for a folder that cannot be written.
    """
    makers = _makers(run)
    folder = run.path / "figures"
    files: list[Path] = []
    try:
        folder.mkdir(exist_ok=True)
        with styled():
            for name in (name for name in makers if not names or name in names):
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
