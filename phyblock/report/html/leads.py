"""From a cell of a table to the samples that its numbers were made from."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import takewhile
from urllib.parse import urlencode

from phyblock.results.design import HEADINGS, NOT_RUN
from phyblock.results.load import Run
from phyblock.results.sensitivity import FACTOR, ITEMS, LEVEL, blocks_of, factor_name
from phyblock.results.tables import layouts_of
from phyblock.results.text import Column, TextTable, level_name, track_text
from phyblock.text import one_line
from phyblock.tracks.kind import kind_of

__all__ = ["TableLeads", "mean_parts", "part_names", "samples_query", "table_leads"]

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
    of_table = [track for track in tracks if name in (layouts_of(track) or (track,))] or tracks
    words = _Vocabulary(
        _words(run, of_table),
        frozenset(
            listed.name
            for track in of_table
            for listed in kind_of(track).report().listings(run.design)
        ),
    )
    shared = {"track": of_table[0]} if len(of_table) == 1 else {}
    named, ways = _named_in_rows(run, table, words), _ways_of_rows(run, table)
    return TableLeads(
        tuple(_column_lead(column, words) for column in table.columns),
        tuple(
            _row_lead({**shared, **chosen}, way, model)
            for (model, chosen), way in zip(named, ways, strict=True)
        ),
    )


@dataclass(frozen=True)
class _Vocabulary:
    """What texts of tables choose among samples: `of_names` in small letters, and `settings`."""

    of_names: Mapping[str, dict[str, str]]
    settings: frozenset[str]

    def chosen_by(self, text: str) -> dict[str, str] | None:
        """What a text in a row chooses; None for one that is no such word."""
        return {"setting": text} if text in self.settings else self.of_names.get(text.lower())


def _column_lead(column: Column, words: _Vocabulary) -> str | None:
    if column.is_text or column.name == NOT_RUN:
        return None
    named = {"setting": column.name} if column.name in words.settings else {}
    of_group, of_name = (
        words.of_names.get(text.lower(), {}) for text in (column.group, column.name)
    )
    return urlencode(of_group | of_name | named)


def _row_lead(
    chosen: Mapping[str, str], way: Mapping[str, str] | None, model: str | None
) -> str | None:
    if model is None or "track" not in chosen or way is None:
        return None
    return urlencode({**chosen, **way, "model": model})


def _named_in_rows(
    run: Run, table: TextTable, words: _Vocabulary
) -> Iterator[tuple[str | None, dict[str, str]]]:
    """The model that each row is of, None for none, and what its other names choose."""
    models = {one_line(model): model for model in run.design.model_names}
    # What is said behind the numbers of a row, as who is above a floor, is not what they are of.
    n_naming = len(list(takewhile(lambda column: column.is_text, table.columns)))
    model = None
    for row in table.rows:
        naming = row[:n_naming]
        if row[0] in models:
            model, naming = models[row[0]], naming[1:]
        elif row[0]:
            # An empty name is the one above.
            model = None
        chosen: dict[str, str] = {}
        for text in naming:
            of_text = words.chosen_by(text)
            if of_text is not None:
                chosen |= of_text
            elif model is None:
                model = models.get(text)
        yield model, chosen


def _ways_of_rows(run: Run, table: TextTable) -> Iterator[dict[str, str] | None]:
    """What each row chooses among ways of asking; None where no word of the address does."""
    is_of_ways = FACTOR in table.columns
    ways = _ways(run) if is_of_ways else {(): {}}
    for row in table.rows:
        texts = zip(table.columns, row, strict=True)
        of_way = (text for column, text in texts if is_of_ways and column in (FACTOR, LEVEL))
        yield ways.get(tuple(of_way))


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
