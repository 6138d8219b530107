"""All tables of a run, as files in its folder."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import pandas as pd

from phyblock.report.floors import floors_frame, floors_view
from phyblock.report.made import TABLES
from phyblock.report.measure_table import (
    headline_frame,
    headline_view,
    measures_frame,
    measures_view,
)
from phyblock.report.sensitivity import (
    components_frame,
    levels_frame,
    pairs_frame,
    ranks_frame,
)
from phyblock.report.sensitivity_view import (
    components_view,
    levels_view,
    ranks_view,
)
from phyblock.run.store import run_folder
from phyblock.tables.cost import cost_frame, cost_view
from phyblock.tables.coverage import coverage_frame, coverage_view
from phyblock.tables.csv_text import to_csv
from phyblock.tables.latex import to_latex
from phyblock.tables.load import Run, load_run
from phyblock.tables.markdown import to_markdown
from phyblock.tables.showing import marked, varied_words
from phyblock.tables.text_table import TextTable
from phyblock.tables.track_report import TableMaker
from phyblock.tracks.estimates import all_estimates
from phyblock.tracks.kind import kind_of, kinds

__all__ = [
    "TablesWritten",
    "make_tables",
    "table_files",
    "table_makers",
    "table_names",
    "write_tables",
]

_FOLDER = TABLES
_FORMS = ("csv", "md", "tex")


@dataclass(frozen=True, eq=False)
class TablesWritten:
    """What `write_tables` made.

    `frames` and `views` (as text, ready to print) go by table name: those of assembly (frame
    only), table1, errors and published that were asked for, and coverage in any case; with table1
    come intervals, table5 (of several seeds) and settings (of both settings), with coverage cost.
    """

    folder: Path
    files: tuple[Path, ...]
    frames: Mapping[str, pd.DataFrame]
    views: Mapping[str, TextTable]
    run: Run


def write_tables(path: str | Path, tables: Sequence[str] | None = None) -> TablesWritten:
    """Rebuild `tables/` of a run folder from its records; each file appears whole or not at all.

    `tables` names those to write; None is what the suite in `run.yaml` asks for. Raises StoreError
    for a broken run (see `load_run`) or a folder that cannot be written,
    and, before anything is, naming every file in the way that we never wrote.
    """
    run = load_run(path, texts=False)
    frames, views = make_tables(run, run.design.suite.tables if tables is None else tables)
    texts = {name: {"csv": _csv(frame, name)} for name, frame in frames.items()}
    for name, view in views.items():
        texts[name] |= {"md": to_markdown(view), "tex": to_latex(view, f"phyblock-{name}")}
    files: dict[str, str | bytes] = {
        f"{_FOLDER}/{name}.{form}": text[form]
        for form in _FORMS
        for name, text in texts.items()
        if form in text
    }
    written = run_folder(run.path).write(files)
    return TablesWritten(run.path / _FOLDER, written, frames, views, run)


def table_files() -> tuple[str, ...]:
    """Every file of tables that a run folder may hold, by its name in it."""
    tables = [kind.report().tables or (kind.name,) for kind in kinds().values()]
    names = [*(name for of_track in tables for name in of_track), *_OF_ANY_TRACK]
    return tuple(f"{_FOLDER}/{name}.{form}" for form in _FORMS for name in names)


_ESTIMATES = "estimates"
_OF_ANY_TRACK = {
    _ESTIMATES: TableMaker(all_estimates),
    "measures": TableMaker(measures_frame, measures_view, _ESTIMATES),
    "floors": TableMaker(floors_frame, floors_view, _ESTIMATES),
    "sensitivity": TableMaker(components_frame, components_view, _ESTIMATES),
    "sensitivity_levels": TableMaker(levels_frame, levels_view, _ESTIMATES),
    "sensitivity_ranks": TableMaker(ranks_frame, ranks_view, _ESTIMATES),
    "sensitivity_pairs": TableMaker(pairs_frame, None, _ESTIMATES),
    "coverage": TableMaker(coverage_frame, coverage_view),
    "cost": TableMaker(cost_frame, cost_view, "coverage"),
}
"""Tables that every run has."""


def table_makers(run: Run) -> dict[str, TableMaker]:
    """Tables of a run by name: of its tracks, in their order, then those of any run."""
    makers: dict[str, TableMaker] = {}
    for track in run.design.suite.tracks:
        report = kind_of(track).report()
        own = report.tables or {track: _headline_maker(track)}
        words = (*report.showing(run), *varied_words(run))
        makers |= {name: replace(one, view=_marked(one, words)) for name, one in own.items()}
    return makers | _OF_ANY_TRACK


def _marked(
    maker: TableMaker, words: tuple[str, ...]
) -> Callable[[pd.DataFrame, Run], TextTable] | None:
    view = maker.view
    return view and (lambda table, run: marked(view(table, run), words))


def _headline_maker(track: str) -> TableMaker:
    """The table of a track that has none of its own."""
    return TableMaker(partial(headline_frame, track), partial(headline_view, track))


def table_names(run: Run) -> tuple[str, ...]:
    """Tables that the tracks of a run have."""
    return tuple(table_makers(run))


def make_tables(
    run: Run, names: Sequence[str]
) -> tuple[dict[str, pd.DataFrame], dict[str, TextTable]]:
    """Frames and views by name: of `names`, of what comes with them, and of any run.

    The table of a track that has none of its own comes unasked.
    """
    plain = [track for track in run.design.suite.tracks if not kind_of(track).report().tables]
    wanted = {_ESTIMATES, "coverage", *plain, *names}
    makers = {
        name: maker
        for name, maker in table_makers(run).items()
        if name in wanted or maker.comes_with in wanted
    }
    frames = {name: maker.frame(run) for name, maker in makers.items()}
    frames = {name: frame for name, frame in frames.items() if name in wanted or len(frame)}
    views = {
        name: maker.view(frames[name], run)
        for name, maker in makers.items()
        if maker.view and name in frames
    }
    return frames, views


def _csv(frame: pd.DataFrame, name: str) -> str:
    decimals = "%.1f" if name in ("table1", "table2", "table3") else "%.6f"
    return to_csv(frame, decimals)
