"""All figures of a run, as SVG and PNG in its folder."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from phyblock.report.figures.bars import main_measure, measure_bars
from phyblock.report.figures.data import dataset_levels
from phyblock.report.figures.sensitivity import moved_dots
from phyblock.run.folder import run_folder
from phyblock.tables.drawing import png_bytes, styled, svg_bytes
from phyblock.tables.load import Run
from phyblock.tracks.kind import kind_of, kinds

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["figure_files", "figure_names", "figure_titles", "write_figures"]

_FOLDER = "figures"
_FORMS = {"svg": svg_bytes, "png": png_bytes}

_SCENES = "scenes"


def _makers(run: Run) -> dict[str, Callable[[Run], Figure | None]]:
    """Figures of a run by name: of its tracks, in their order, then of its scenes."""
    makers: dict[str, Callable[[Run], Figure | None]] = {}
    for track in run.design.suite.tracks:
        makers[_bars_name(track)] = partial(measure_bars, track=track)
        makers |= kind_of(track).report().figures
        if run.design.suite.vary.factors:
            makers[_moved_name(track)] = partial(moved_dots, track=track)
    return {**makers, _SCENES: dataset_levels}


def _bars_name(track: str) -> str:
    return kind_of(track).report().bars or f"{track.replace('_', '-')}-{main_measure(track).name}"


def _moved_name(track: str) -> str:
    return f"sensitivity-{track.replace('_', '-')}"


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
        titles[_moved_name(track)] = f"{kind_of(track).title}: what the way of asking changes"
    return titles


def write_figures(run: Run, names: Sequence[str] | None = None) -> tuple[Path, ...]:
    """Draw figures into `figures/` of the run's folder, NAME.svg and NAME.png; all by default.

    Figures that the run has no numbers for are left out. The same records give the same bytes.
    Raises StoreError for a folder that cannot be written, and, before anything is drawn, naming
    every file in the way that we never wrote.
    """
    makers = _makers(run)
    wanted = [name for name in makers if names is None or name in names]
    if not wanted:
        return ()
    folder = run_folder(run.path)
    folder.check(figure_files(wanted))
    files: list[Path] = []
    with styled():
        for name in wanted:
            figure = makers[name](run)
            if figure is None:
                continue
            for ending, draw in _FORMS.items():
                files += folder.write({f"{_FOLDER}/{name}.{ending}": draw(figure)})
                # Laid out once: the next format takes what the first has found.
                figure.set_layout_engine("none")
    return tuple(files)


def figure_files(names: Sequence[str] | None = None) -> tuple[str, ...]:
    """Every file of these figures, by its name in a run folder; by default of all there are."""
    known = [
        name
        for kind in kinds().values()
        for name in (_bars_name(kind.name), *kind.report().figures, _moved_name(kind.name))
    ]
    return tuple(
        f"{_FOLDER}/{name}.{ending}"
        for name in ((*known, _SCENES) if names is None else names)
        for ending in _FORMS
    )
