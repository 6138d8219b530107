"""From a cell of a table to the samples that its numbers were made from."""

from __future__ import annotations

from urllib.parse import urlencode

from phyblock.tables.load import Run
from phyblock.tracks.kind import kind_of

__all__ = ["mean_parts", "part_names", "samples_query"]


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
