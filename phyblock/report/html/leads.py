"""From a cell of a table to the samples that its numbers were made from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import takewhile
from urllib.parse import urlencode

from phyblock.plain_text import one_line
from phyblock.report.sensitivity import ITEMS
from phyblock.report.sensitivity_view import FACTOR, LEVEL, factor_name
from phyblock.report.varied import blocks_of
from phyblock.tables.load import Run
from phyblock.tables.outcomes import HEADINGS
from phyblock.tables.text_table import TextTable, level_name, track_text
from phyblock.tracks.kind import kind_of

__all__ = ["TableLeads", "mean_parts", "part_names", "samples_query", "table_leads"]

_NOT_RUN = "Not run"
"""Heads numbers of samples that there are not."""
_REFERENCE = "reference"
"""What the page's address calls the way of asking that names nothing."""


def samples_query(run: Run, track: str, cell: str) -> str:
    """The samples of a cell, in the words of the page's address."""
    parts, chosen = kind_of(track).report().part_names, {"track": track}
    if cell in parts or cell in _part_groups(run, track):
        chosen["subtask"] = cell
    elif cell.isdigit() and int(cell) in run.design.suite.levels:
        chosen["level"] = cell
    return urlencode(chosen)


def _part_groups(run: Run, track: str) -> dict[str, tuple[str, tuple[str, ...]]]:
    """By name of a cell that is the mean of parts of a track: its heading and these parts."""
    report = kind_of(track).report()
    return {
        cell.name: (cell.heading, cell.of)
        for cell in report.cells(run)
        if cell.of and all(name in report.part_names for name in cell.of)
    }


def part_names(run: Run) -> dict[str, str]:
    """What parts of tracks are called, by their short names."""
    names: dict[str, str] = {}
    for track in run.design.suite.tracks:
        names |= kind_of(track).report().part_names
    return names


def mean_parts(run: Run) -> dict[str, dict[str, object]]:
    """Means of parts of tracks: what they are called, and of which parts they are."""
    return {
        name: {"title": heading, "of": list(of)}
        for track in run.design.suite.tracks
        for name, (heading, of) in _part_groups(run, track).items()
    }


@dataclass(frozen=True)
class TableLeads:
    """Which samples the numbers of a table were made from, in the words of the page's address.

    Words of each column, and of each row with the whole table; None for a column without numbers,
    and for a row of which no samples are known.
    """

    columns: tuple[str | None, ...]
    rows: tuple[str | None, ...]


def table_leads(run: Run, name: str, table: TextTable) -> TableLeads:
    """What the headings and the texts of a table say of the samples behind its numbers."""
    tracks = run.design.suite.tracks
    of_table = [track for track in tracks if name in kind_of(track).report().tables] or tracks
    words = _words(run, of_table)
    models = {one_line(model): model for model in run.design.model_names}
    settings = {
        one.name for track in of_table for one in kind_of(track).report().listings(run.design)
    }
    columns = []
    for column in table.columns:
        named = {"setting": column.name} if column.name in settings else {}
        known = words.get(column.group.lower(), {}) | words.get(column.name.lower(), {}) | named
        is_bare = column.is_text or column.name == _NOT_RUN
        columns.append(None if is_bare else urlencode(known))
    is_of_ways = FACTOR in table.columns
    ways = _ways(run) if is_of_ways else {(): {}}
    rows: list[str | None] = []
    model = None
    # What is said behind the numbers of a row, as who is above a floor, is not what they are of.
    n_naming = len(list(takewhile(lambda column: column.is_text, table.columns)))
    for row in table.rows:
        chosen, naming = {"track": of_table[0]} if len(of_table) == 1 else {}, row[:n_naming]
        if row[0] in models:
            model, naming = models[row[0]], naming[1:]
        elif row[0]:
            # An empty name is the one above.
            model = None
        for text in naming:
            if text in settings:
                chosen["setting"] = text
            elif text.lower() in words:
                chosen |= words[text.lower()]
            elif model is None:
                model = models.get(text)
        texts = zip(table.columns, row, strict=True)
        of_way = (cell for column, cell in texts if is_of_ways and column in (FACTOR, LEVEL))
        way = ways.get(tuple(of_way))
        if model is None or "track" not in chosen or way is None:
            rows.append(None)
        else:
            rows.append(urlencode({**chosen, **way, "model": model}))
    return TableLeads(tuple(columns), tuple(rows))


def _words(run: Run, tracks: Sequence[str]) -> Mapping[str, dict[str, str]]:
    """What names in tables of these tracks choose among samples; names in small letters."""
    words: dict[str, dict[str, str]] = {}
    for level in run.design.suite.levels:
        words[level_name(str(level)).lower()] = {"level": str(level)}
    for track in tracks:
        for name in (kind_of(track).title.lower(), *track_text(track, run.design.suite.tracks)):
            words[name] = {"track": track}
        for short in kind_of(track).report().part_names:
            words[short.lower()] = {"subtask": short}
        for group, (heading, _) in _part_groups(run, track).items():
            for name in (heading.lower(), group.replace("_", " ")):
                words[name] = {"subtask": group}
    for outcome, heading in HEADINGS.items():
        words[heading.lower()] = {"outcome": outcome}
    return words


def _ways(run: Run) -> Mapping[tuple[str, ...], dict[str, str]]:
    """What rows about a factor, or about one of its levels, choose among samples, by these texts.

    Rows of several ways of asking among more are left out: no word of the address chooses them.
    """
    vary = run.design.suite.vary
    every = set(range(vary.n_variants))
    places: dict[tuple[str, ...], set[int]] = {(ITEMS,): every}
    for factor in vary.factors:
        blocks = blocks_of(vary, factor)
        places[factor,] = set(blocks.places.flat)
        for level, own in zip(blocks.levels, blocks.places, strict=True):
            places[factor, level] = set(own.flat)
    ways: dict[tuple[str, ...], dict[str, str]] = {}
    for (factor, *levels), chosen in places.items():
        texts = (one_line(factor_name(factor)), *map(one_line, levels))
        if chosen == every:
            ways[texts] = {}
        elif len(chosen) == 1:
            ways[texts] = {"variant": vary.variants[min(chosen)].key or _REFERENCE}
    return ways
