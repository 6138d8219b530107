"""What a track brings to the report: its measures, its cells, and tables and figures of its own."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from phyblock.tables.measures import Cell, Measure
from phyblock.tables.text_table import TextTable

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from phyblock.tables.load import Run

__all__ = ["Shown", "TableMaker", "TrackReport"]


@dataclass(frozen=True)
class Shown:
    """A measure in a cell, as a column of a headline table; `criterion` says how it is counted."""

    measure: str
    cell: str
    heading: str
    criterion: str = ""


@dataclass(frozen=True)
class TableMaker:
    """How a table is made and how people read it; without `view` it is a CSV file alone.

    `comes_with` names the table that it accompanies, where it has rows at all.
    """

    frame: Callable[[Run], pd.DataFrame]
    view: Callable[[pd.DataFrame, Run], TextTable] | None = None
    comes_with: str = ""


def _no_references(_: Run) -> Mapping[str, Mapping[str, float]]:
    return {}


@dataclass(frozen=True)
class TrackReport:
    """The measures of a track, and what is shown of them.

    `cells` are those of a run. `headline` chooses the columns of the headline table out of a run,
    of which `main` stands for all; without it every cell of the first measure is shown.
    `references` are rows to hold models against, by name, with values by column heading. `notes`
    stand under the headline. `tables` and `figures` are of its own, by name; a figure is None for
    a run that has no numbers for it. `check_alike` raises SpecError where the second run cannot be
    compared with the first.
    """

    measures: tuple[Measure, ...]
    cells: Callable[[Run], tuple[Cell, ...]]
    headline: Callable[[Run], tuple[Shown, ...]] | None = None
    main: str = ""
    references: Callable[[Run], Mapping[str, Mapping[str, float]]] = _no_references
    notes: Callable[[Run], Sequence[str]] = lambda _: ()
    tables: Mapping[str, TableMaker] = field(default_factory=dict)
    figures: Mapping[str, Callable[[Run], Figure | None]] = field(default_factory=dict)
    check_alike: Callable[[Run, Run, Sequence[str]], None] | None = None
