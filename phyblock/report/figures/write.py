"""The figures of a run: those of its report, and those that a person asks for a paper."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from phyblock.errors import Problem, SpecError
from phyblock.files import OutFolder
from phyblock.report.figures.captions import caption_files
from phyblock.report.figures.data import dataset_levels
from phyblock.report.figures.dots import measure_dots
from phyblock.report.figures.forest import difference_forest
from phyblock.report.figures.kit import block_kit
from phyblock.report.figures.perturbations import perturbation_strip
from phyblock.report.figures.sensitivity import moved_dots
from phyblock.run.plan import recorded_dataset
from phyblock.run.store import run_folder
from phyblock.tables.drawing import (
    PAGE_LOOK,
    Look,
    pdf_bytes,
    png_bytes,
    styled,
    svg_bytes,
)
from phyblock.tables.load import Run
from phyblock.tables.track_report import FigureMaker, SceneFigure
from phyblock.tracks.estimates import main_measure
from phyblock.tracks.kind import kind_of, kinds

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    "PAPER",
    "PaperFigures",
    "Wanted",
    "figure_files",
    "figure_names",
    "figure_titles",
    "write_figures",
    "write_paper_figures",
]

PAPER = "paper"
"""The folder in a run's folder where figures for papers are, unless another is named."""
_FOLDER = "figures"
_FORMS: Mapping[str, Callable[[Figure], bytes]] = {"svg": svg_bytes}
_PAPER_FORMS: Mapping[str, Callable[[Figure], bytes]] = {
    "pdf": pdf_bytes,
    "svg": svg_bytes,
    "png": png_bytes,
}

_Maker = FigureMaker | SceneFigure


@dataclass(frozen=True)
class Wanted:
    """Which figures are drawn, and of what.

    `names` is empty for all but those that show scenes; `scene` is the one that these show, "" for
    one that they choose; `data` is where the data set is now, None for where the run found it.
    """

    names: Sequence[str] = ()
    scene: str = ""
    data: Path | None = None


@dataclass(frozen=True)
class PaperFigures:
    """What `write_paper_figures` wrote.

    `wider` are widths [inches] by name of the figures that are wider than was asked for, as their
    texts need.
    """

    files: tuple[Path, ...]
    wider: Mapping[str, float]


def _makers(run: Run | None = None) -> dict[str, _Maker]:
    """Figures of a run by name: of its tracks, in their order, then of its scenes; where no run is
    given, those that any run may have.
    """
    varies = run is None or bool(run.design.suite.vary.factors)
    makers: dict[str, _Maker] = {}
    for track in kinds() if run is None else run.design.suite.tracks:
        makers |= _of_track(track, run, varies=varies)
    makers["scenes"] = FigureMaker("The scenes of the run by level", dataset_levels)
    makers["kit"] = FigureMaker("The blocks and their dimensions", block_kit, in_report=False)
    if varies:
        makers["perturbations"] = SceneFigure("A scene in all ways of asking", perturbation_strip)
    return makers


def _of_track(track: str, run: Run | None, *, varies: bool) -> dict[str, _Maker]:
    kind, dashed = kind_of(track), track.replace("_", "-")
    title, report = kind.title, kind.report()
    main = title if run is None else f"{title}: {main_measure(run, track).heading}"
    makers: dict[str, _Maker] = {
        report.main_figure or dashed: FigureMaker(main, partial(measure_dots, track=track)),
        **report.figures,
        f"forest-{dashed}": FigureMaker(
            f"{title}: differences between models",
            partial(difference_forest, track=track),
            in_report=False,
        ),
    }
    if varies:
        makers[f"sensitivity-{dashed}"] = FigureMaker(
            f"{title}: what the way of asking changes", partial(moved_dots, track=track)
        )
    return makers


def _is_in_report(maker: _Maker) -> bool:
    return isinstance(maker, FigureMaker) and maker.in_report


def figure_names(run: Run) -> tuple[str, ...]:
    """Names of all figures that a run may have, in the order in which they are shown."""
    return tuple(_makers(run))


def figure_titles(run: Run) -> dict[str, str]:
    """What people read in the place of the names."""
    return {name: maker.title for name, maker in _makers(run).items()}


def write_figures(run: Run, names: Sequence[str] | None = None) -> tuple[Path, ...]:
    """Draw figures of the report into `figures/` of the run's folder, NAME.svg; all by default.

    Figures that the run has no numbers for are left out. The same records give the same bytes.
    Raises StoreError for a folder that cannot be written, and, before anything is drawn, naming
    every file in the way that we never wrote.
    """
    makers = {name: maker for name, maker in _makers(run).items() if _is_in_report(maker)}
    wanted = [name for name in makers if names is None or name in names]
    if not wanted:
        return ()
    folder = run_folder(run.path)
    folder.check(figure_files(wanted))
    files: list[Path] = []
    with styled(PAGE_LOOK):
        for name in wanted:
            figure = _drawn(run, makers[name], Wanted())
            if figure is not None:
                drawn = _rendered(figure, _FORMS)
                named = {f"{_FOLDER}/{name}.{form}": data for form, data in drawn.items()}
                files += folder.write(named)
    return tuple(files)


def write_paper_figures(
    run: Run, wanted: Wanted, look: Look, out: Path | None = None
) -> PaperFigures:
    """Draw figures for a paper into `out`, else into `paper/` of the run's folder: NAME.pdf,
    NAME.svg, NAME.png, and the caption as NAME.txt and as NAME.tex.

    As `write_figures` else; raises DataError too, where scenes are to be shown and cannot be read,
    and SpecError for a scene that the run has not or that no figure shows.
    """
    makers = _makers(run)
    names = (
        [name for name in makers if name in wanted.names]
        if wanted.names
        else [name for name, maker in makers.items() if isinstance(maker, FigureMaker)]
    )
    of_scenes = [name for name, maker in makers.items() if isinstance(maker, SceneFigure)]
    if wanted.scene and not set(names) & set(of_scenes):
        message, hint = "is shown by none of these figures", f"name one: {', '.join(of_scenes)}"
        raise SpecError(Problem(str(run.path), message, "--scene", wanted.scene, hint=hint))
    folder = run_folder(run.path) if out is None else OutFolder(out)
    below = f"{PAPER}/" if out is None else ""
    endings = (*_PAPER_FORMS, "txt", "tex")
    folder.check(f"{below}{name}.{ending}" for name in names for ending in endings)
    files: list[Path] = []
    wider: dict[str, float] = {}
    with styled(look):
        for name in names:
            figure = _drawn(run, makers[name], wanted)
            if figure is not None:
                made: dict[str, bytes | str] = {**_rendered(figure, _PAPER_FORMS)}
                made |= caption_files(run, name, figure)
                if figure.get_figwidth() > look.width_in:
                    wider[name] = float(figure.get_figwidth())
                files += folder.write(
                    {f"{below}{name}.{form}": data for form, data in made.items()}
                )
    return PaperFigures(tuple(files), wider)


def _drawn(run: Run, maker: _Maker, wanted: Wanted) -> Figure | None:
    if isinstance(maker, FigureMaker):
        return maker.draw(run)
    dataset = recorded_dataset(run.path, run.manifest, run.design.suite.levels, wanted.data)
    return maker.draw(run, dataset, wanted.scene)


def _rendered(figure: Figure, forms: Mapping[str, Callable[[Figure], bytes]]) -> dict[str, bytes]:
    drawn = {}
    for ending, draw in forms.items():
        drawn[ending] = draw(figure)
        # Laid out once: the next format takes what the first has found.
        figure.set_layout_engine("none")
    return drawn


def figure_files(names: Sequence[str] | None = None) -> tuple[str, ...]:
    """Every file of these figures, by its name in a run folder; by default of all that a report
    may have.
    """
    known = [name for name, maker in _makers().items() if _is_in_report(maker)]
    return tuple(
        f"{_FOLDER}/{name}.{ending}"
        for name in (known if names is None else names)
        for ending in _FORMS
    )
