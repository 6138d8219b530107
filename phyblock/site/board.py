"""The numbers of the leaderboard: columns, a row an entry, and the runs that they are of."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from phyblock.report.html.standing import shortfalls
from phyblock.results.estimates import (
    Value,
    headline_columns,
    main_column,
    main_measure,
    track_measures,
)
from phyblock.site.entries import Entry
from phyblock.site.ranking import rank_ranges_of
from phyblock.site.runs import SiteRun
from phyblock.site.values import AllValues, TrackValues, values_of
from phyblock.tracks.kind import kind_of

__all__ = ["all_values", "board_of"]

_DIGITS = 4


def all_values(runs: Sequence[SiteRun]) -> AllValues:
    """The values of every track of every run."""
    return {
        (number, track): values_of(one.run, track)
        for number, one in enumerate(runs)
        for track in one.run.design.suite.tracks
    }


def board_of(
    runs: Sequence[SiteRun], entries: Sequence[Entry], values: AllValues
) -> dict[str, Any]:
    """What the first page shows, plain values.

    Raises SpecError for runs that cannot be compared.
    """
    first = _first_runs(runs)
    return {
        "tracks": [_track(track, runs[number]) for track, number in first.items()],
        "columns": [
            column
            for track, number in first.items()
            for column in _columns(track, runs[number], values[number, track])
        ],
        "rows": _rows(runs, entries, values, first),
        "runs": [_run(one) for one in runs],
    }


def _first_runs(runs: Sequence[SiteRun]) -> dict[str, int]:
    """Every track with the number of the first run that has it."""
    found: dict[str, int] = {}
    for number, one in enumerate(runs):
        for track in one.run.design.suite.tracks:
            found.setdefault(track, number)
    return found


def _track(track: str, one: SiteRun) -> dict[str, Any]:
    kind, run = kind_of(track), one.run
    main = main_column(run, track)
    measure = main_measure(run, track)
    return {
        "name": track,
        "title": kind.title,
        "item": kind.item,
        "main": main.heading,
        "unit": measure.unit,
        "better": measure.better,
        "best": None if math.isnan(measure.best) else measure.best,
        "notes": list(kind.report().notes(run)),
        "physics": kind.physics(run.manifest.suite),
    }


def _columns(track: str, one: SiteRun, values: TrackValues) -> Iterator[dict[str, Any]]:
    measures = {measure.name: measure for measure in track_measures(track)}
    for setting in values.values:
        for column in headline_columns(one.run, track):
            measure = measures[column.measure]
            yield {
                "id": _id(track, setting, column.heading),
                "track": track,
                "setting": setting,
                "heading": column.heading,
                "unit": measure.unit,
                "better": measure.better,
                "share": measure.is_share,
            }


def _id(track: str, setting: str, heading: str) -> str:
    return "/".join(filter(None, (track, setting, heading)))


def _rows(
    runs: Sequence[SiteRun],
    entries: Sequence[Entry],
    values: AllValues,
    first: Mapping[str, int],
) -> list[dict[str, Any]]:
    ranges = {}
    for track, number in first.items():
        main = _id(track, next(iter(values[number, track].values)), _main(track, runs[number]))
        ranked = [entry for entry in entries if main in _values(entry, values)]
        ranges[track] = rank_ranges_of(track, ranked, runs, values)
    lacking = {key: shortfalls(runs[key[0]].run, key[1]) for key in values}
    return [
        {
            "name": entry.name,
            "model": entry.model.name,
            "kind": entry.model.kind,
            "size_b": entry.model.size_b,
            "runs": dict(entry.runs),
            "values": _values(entry, values),
            "ranks": {t: list(r[entry.name]) for t, r in ranges.items() if entry.name in r},
            "lacking": {
                track: lacking[number, track][entry.model.name]
                for track, number in entry.runs.items()
                if entry.model.name in lacking[number, track]
            },
            "facts": {
                track: _rounded(asdict(values[number, track].facts[entry.model.name]))
                for track, number in entry.runs.items()
            },
        }
        for entry in entries
    ]


def _main(track: str, one: SiteRun) -> str:
    return main_column(one.run, track).heading


def _values(entry: Entry, values: AllValues) -> dict[str, list[float | None]]:
    """Value and interval by column."""
    found = {}
    for track, number in entry.runs.items():
        for setting, of_setting in values[number, track].values.items():
            for (model, heading), value in of_setting.items():
                if model == entry.model.name and not math.isnan(value.value):
                    found[_id(track, setting, heading)] = _triple(value)
    return found


def _triple(value: Value) -> list[float | None]:
    return [
        None if math.isnan(number) else round(number, _DIGITS)
        for number in (value.value, value.lo, value.hi)
    ]


def _rounded(facts: Mapping[str, Any]) -> dict[str, Any]:
    return {
        name: float(f"{value:.6g}") if isinstance(value, float) else value
        for name, value in facts.items()
    }


def _run(one: SiteRun) -> dict[str, Any]:
    run, manifest = one.run, one.run.manifest
    showing = [
        word for track in run.design.suite.tracks for word in kind_of(track).report().showing(run)
    ]
    data = manifest.dataset
    return {
        "suite": run.design.suite.name,
        "id": manifest.identity[:12],
        "date": one.date,
        "verified": one.is_verified,
        "seeds": len(run.design.suite.seeds),
        "data": data.name if data else "",
        "version": data.version if data else None,
        "asked": list(dict.fromkeys((*showing, *run.varied_words))),
        "phyblock": manifest.versions.get("phyblock", ""),
    }
