"""What a track brings to the report: its measures, its cells, and tables and figures of its own."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

from phyblock.tables.listing import Listing, by_settings
from phyblock.tables.measures import CELL, Cell, Measure
from phyblock.tables.text_table import TextTable

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd
    from matplotlib.figure import Figure

    from phyblock.data import AssemblyTask, Dataset
    from phyblock.models import Image
    from phyblock.records.record import Record
    from phyblock.sim.film import FilmStep
    from phyblock.sim.pictures import PictureStyle
    from phyblock.tables.design import Design
    from phyblock.tables.load import Run

__all__ = [
    "WHOLE",
    "EpisodeView",
    "FigureMaker",
    "HeadlineColumn",
    "ItemExport",
    "KeptPictures",
    "PageItems",
    "PaperTable",
    "SceneFigure",
    "TableMaker",
    "TrackReport",
]


@dataclass(frozen=True)
class HeadlineColumn:
    """A measure in a cell, as a column of a headline table.

    `criterion` says how it is counted, where one measure is counted in several ways.
    """

    measure: str
    cell: str
    heading: str
    criterion: str = ""


@dataclass(frozen=True)
class PaperTable:
    """How a table of the paper is set beside ours.

    `frame` has a row a cell with columns model, published_name, published, ours, difference; it is
    empty where no model of the run has a row in that table.
    """

    frame: Callable[[Run], pd.DataFrame]
    view: Callable[[pd.DataFrame, Run], TextTable]


class KeptPictures(Protocol):
    """Pictures of items in a folder of kept ones."""

    def outline(self, item: Any) -> tuple[Sequence[Image], bool]:
        """The pictures of an item as far as they are at hand, and whether all are."""

    def keys(self, item: Any) -> Sequence[str]:
        """Names under which they are kept."""


@dataclass(frozen=True)
class PageItems:
    """What the page of a report shows of items that are more than their scene.

    `shown` gives what a record asked about, as it was shown, None where that is not known. `entry`
    is what the page takes of it, `pictures` finds those that were sent in a folder of kept ones.
    """

    shown: Callable[[Record], Any | None]
    entry: Callable[[Any], Mapping[str, Any]]
    pictures: Callable[[Path, PictureStyle], KeptPictures]


@dataclass(frozen=True)
class EpisodeView:
    """How a record of a track is shown step by step: as a table, and as frames of a film.

    `state_keys` name, in the cache, the pictures that its turns were sent beside those of the
    scene.
    """

    track: str
    table: Callable[[Any], TextTable]
    frames: Callable[[Any, AssemblyTask], Iterable[FilmStep]]
    state_keys: Callable[[Any, AssemblyTask, PictureStyle], Iterable[str]] = lambda *_: ()


@dataclass(frozen=True)
class ItemExport:
    """How `phyblock export --questions` writes items with their pictures for other tools.

    `formats` are the words for `--to`; `items` names the bundled set that is written unless
    another is named. `write` takes a format, the folder to write, the set by its name or folder,
    the scenes that it is about, how many items to write at most (None: all) and the edge of a
    picture [pixels]; it returns what it wrote. It raises DataError for a set or picture that cannot
    be read, SpecError for a package that is not installed, StoreError for a folder that cannot be
    written.
    """

    formats: tuple[str, ...]
    items: str
    write: Callable[[str, Path, str, Dataset, int | None, int], tuple[Path, ...]]


@dataclass(frozen=True)
class TableMaker:
    """How a table is made and how people read it; without `view` it is a CSV file alone.

    `comes_with` names the table that it accompanies, where it has rows at all.
    """

    frame: Callable[[Run], pd.DataFrame]
    view: Callable[[pd.DataFrame, Run], TextTable] | None = None
    comes_with: str = ""


@dataclass(frozen=True)
class FigureMaker:
    """How a figure is drawn from numbers, and what people read in the place of its name.

    `draw` gives None for a run that has no numbers for it. A report has those `in_report`; the
    others are drawn on request alone.
    """

    title: str
    draw: Callable[[Run], Figure | None]
    in_report: bool = True


@dataclass(frozen=True)
class SceneFigure:
    """How a figure is drawn that shows scenes, which is done on request alone.

    `draw` takes the data set of the run, and the scene that is wanted, "" where that is left to
    the figure. It gives None for a run that has nothing to show, and raises DataError for what
    cannot be read.
    """

    title: str
    draw: Callable[[Run, Dataset, str], Figure | None]


WHOLE = Cell("overall", "Overall")
"""The one cell of a track that has no parts."""


def _in_whole(rows: pd.DataFrame, _: Run) -> pd.DataFrame:
    """All samples in one cell."""
    return rows.assign(**{CELL: WHOLE.name})


def _no_references(_: Run) -> Mapping[str, Mapping[str, float]]:
    return {}


@dataclass(frozen=True)
class TrackReport:
    """The measures of a track, and what is shown of them.

    `cells` are those of a run, the last of which stands for all; `in_cells` repeats rows of samples
    for each cell that they are pooled in, which it names in the column `CELL`. `headline` chooses
    the columns of the headline table, the first measure in every cell where it is left out; the
    column headed `main`, else the last, is the one that models are ranked by. `notes` say how its
    values are counted. `references` are rows to hold models against, by name, with values [%] by
    heading, and `reference_note` says what they are; `published` is what the paper prints of `main`
    for models of the run. `short` is the name of the column that stands for the track in a summary.

    `tables`, `figures` and `paper_tables` (by their number in the paper) are its own. `main_figure`
    is the name of the figure of its main measure, else that of the track. `check_alike` raises
    SpecError where the first run cannot be compared with the second in these cells by a measure.
    `part_names` say what `Record.part` stands for. `items` opens, for the page of a run, what was
    asked about where that is more than scenes; it raises DataError where that is not what the run
    was made on.
    `episodes` shows records that are episodes, `export` writes what is asked about. `listings` are
    the scores that the page of a run lists samples by, the one that the headline leads with first.
    `showing` says, in words that end every caption, what is unusual about how items were shown.
    """

    measures: tuple[Measure, ...]
    cells: Callable[[Run], tuple[Cell, ...]] = lambda _: (WHOLE,)
    in_cells: Callable[[pd.DataFrame, Run], pd.DataFrame] = _in_whole
    headline: Callable[[Run], tuple[HeadlineColumn, ...]] | None = None
    main: str = ""
    short: str = ""
    published: Callable[[Run], Mapping[str, float]] = lambda _: {}
    references: Callable[[Run], Mapping[str, Mapping[str, float]]] = _no_references
    notes: Callable[[Run], Sequence[str]] = lambda _: ()
    reference_note: str = ""
    tables: Mapping[str, TableMaker] = field(default_factory=dict)
    main_figure: str = ""
    figures: Mapping[str, FigureMaker | SceneFigure] = field(default_factory=dict)
    paper_tables: Mapping[int, PaperTable] = field(default_factory=dict)
    check_alike: Callable[[Run, Run, Sequence[str], Measure], None] | None = None
    part_names: Mapping[str, str] = field(default_factory=dict)
    items: Callable[[Run, Dataset], PageItems] | None = None
    episodes: EpisodeView | None = None
    export: ItemExport | None = None
    listings: Callable[[Design], tuple[Listing, ...]] = by_settings
    showing: Callable[[Run], tuple[str, ...]] = lambda _: ()
