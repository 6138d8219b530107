"""The numbers of a page about runs: models with values, ranks and facts, and a summary sentence."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from textwrap import shorten
from typing import Any

import pandas as pd

from phyblock.domain.scene import AssemblyTask
from phyblock.errors import DataError
from phyblock.records.files import ManifestModel, read_stopped
from phyblock.results.compare import Side, comparable, rank_ranges_of
from phyblock.results.estimates import Headline, Value, headline_rows, track_estimates, track_notes
from phyblock.results.load import Run, track_measures
from phyblock.results.tables import coverage_frame
from phyblock.results.text import number as rounded
from phyblock.run.manifest import portable_manifest
from phyblock.run.rescore import recorded_dataset, reopen_tracks
from phyblock.text import counted
from phyblock.tracks.base import kind_of
from phyblock.types import WITHOUT_REPLY

_LABELS = ("published", "size_b", "served_at")
"""Parts of a manifest's model that do not affect its replies."""
_MOST_CHARACTERS = 160


@dataclass(frozen=True)
class Sources:
    """Tasks by scene id and other items by track and name; `lacking` is the reason for none."""

    tasks: Mapping[str, AssemblyTask] = field(default_factory=dict)
    items: Mapping[tuple[str, str], Any] = field(default_factory=dict)
    lacking: str = ""


def open_sources(run: Run, data: Path | None) -> Sources:
    """Return a run's scenes, from `data` or the manifest's path, and the other items of its tracks.

    Without them a page has no drawings. Raises DataError if `data` are not those of the run.
    """
    try:
        dataset = recorded_dataset(run.path, run.manifest, data)
        tracks = reopen_tracks(run.path, run.manifest, run.design.suite, dataset)
        own = (track for track in tracks if track.has_own_data())
        items = {(track.name, item.key): item for track in own for item in track.items}
        return Sources({task.scene.id: task for task in dataset.tasks}, items)
    except DataError as error:
        if data is not None:
            raise
        said = f"{error.problems[0].where}: {error.problems[0].message}"
        how = "phyblock report RUN --data FOLDER draws it from where it is now"
        return Sources(lacking=f"Nothing can be drawn without the data set ({said}); {how}.")


@dataclass
class Entry:
    """A row: `runs` has the number of the run of each of its tracks. `name` is unique."""

    model: ManifestModel
    runs: dict[str, int] = field(default_factory=dict)
    name: str = ""


@dataclass(frozen=True, eq=False)
class TrackValues:
    """A track of a run: `values` by setting, model and heading; `samples`, the values of samples by
    the main measure, in its unit, by model and by scene, item, seed and variant, without samples
    that have no value; `facts` by model.

    Settings are those of the run, or only "". Facts are those of the table of coverage, None if
    unknown; `solved` counts samples with the best possible value; `errors` are wrong steps [%].
    """

    values: Mapping[str, Mapping[tuple[str, str], Value]]
    samples: Mapping[str, Mapping[tuple[str, str, int, str], float]]
    facts: Mapping[str, Mapping[str, Any]]


@dataclass(frozen=True, eq=False)
class SiteRun:
    """A run given as `where`; `unverified` is what a bundle left unchecked, None for a folder."""

    where: str
    run: Run
    sources: Sources
    unverified: tuple[str, ...] | None = None

    @cached_property
    def values(self) -> Mapping[str, TrackValues]:
        """The values of each of its tracks."""
        return {track: values_of(self.run, track) for track in self.tracks}

    @property
    def tracks(self) -> tuple[str, ...]:
        """The tracks of its suite."""
        return self.run.design.suite.tracks


def entries_of(runs: Sequence[SiteRun]) -> tuple[Entry, ...]:
    """Return every model of every run.

    A model with the same parameters in different tracks of runs is one row, and so is a baseline
    with the same result in several. Others have a row for each run, with its time and identity.
    """
    found: list[tuple[dict[str, Any], Entry]] = []
    for number, one in enumerate(runs):
        # A run has the same row as a folder and as a bundle.
        for model in portable_manifest(one.run.manifest).models:
            fields = {name: value for name, value in model.fields().items() if name not in _LABELS}
            for known, entry in found:
                sides = [(one, runs[n], t) for t, n in entry.runs.items() if t in one.tracks]
                found_by = [[r.values[t].samples.get(model.name) for r in of] for *of, t in sides]
                if known == fields and all(model.is_baseline and a == b for a, b in found_by):
                    break
            else:
                entry = Entry(model)
                found.append((fields, entry))
            entry.runs = {**dict.fromkeys(one.tracks, number), **entry.runs}
    entries = tuple(entry for _, entry in found)
    names = [entry.model.name for entry in entries]
    for entry in entries:
        entry.name, begun = entry.model.name, runs[min(entry.runs.values())].run.manifest
        if names.count(entry.name) > 1:
            entry.name += f" ({begun.created[:19].replace('T', ' ')}, run {begun.run[:8]})"
    return entries


def values_of(run: Run, track: str) -> TrackValues:
    """Return all values of a track."""
    what, estimates, design = comparable(run, track), track_estimates(run, track), run.design
    samples = {
        model: dict(zip(values.index, values.tolist(), strict=True))
        for model, values in what.values(run, what.parts[-1], design)
    }
    columns = Headline(run, track).columns
    shown = estimates[estimates["measure"].isin([column.measure for column in columns])]
    values: dict[str, Mapping[tuple[str, str], Value]] = {}
    for setting in design.suite.settings if shown["setting"].astype(bool).any() else ("",):
        suite = design.suite.model_copy(update={"settings": (setting,)} if setting else {})
        values[setting] = Headline(run, track, replace(design, suite=suite)).values
    errors: dict[str, dict[str, float]] = {}
    rows = headline_rows(estimates, design)
    rows = rows[(rows["cell"] == run.cells(track)[-1].name) & rows["value"].notna()]
    rows = rows[rows["measure"].str.startswith("wrong_")]
    for model, name, value in zip(rows["model"], rows["measure"], rows["value"], strict=True):
        errors.setdefault(model, {})[name.removeprefix("wrong_")] = round(100 * float(value), 2)
    table, best, facts = coverage_frame(run), what.measure.best, {}
    for row in table[table["track"] == track].to_dict("records"):
        model = str(row["model"])
        solved = sum(value == best for value in samples.get(model, {}).values())
        facts[model] = {
            **{str(name): None if pd.isna(value) else value for name, value in row.items()},
            "solved": None if math.isnan(best) else solved,
            "errors": errors.get(model, {}),
        }
    return TrackValues(values, samples, facts)


def board_of(runs: Sequence[SiteRun], entries: Sequence[Entry]) -> dict[str, Any]:
    """Return the numbers of a page as plain values. Raises SpecError for incomparable runs."""
    first: dict[str, int] = {}
    for number, one in enumerate(runs):
        first |= {track: number for track in one.tracks if track not in first}
    # Value and interval by column.
    numbers: dict[str, dict[str, list[float | None]]] = {
        entry.name: {
            _id(track, setting, heading): [
                None if math.isnan(number) else round(number, 4)
                for number in (value.value, value.lo, value.hi)
            ]
            for track, place in entry.runs.items()
            for setting, of_setting in runs[place].values[track].values.items()
            for (model, heading), value in of_setting.items()
            if model == entry.model.name and not math.isnan(value.value)
        }
        for entry in entries
    }
    ranges: dict[str, Mapping[str, tuple[int, int]]] = {}
    tracks: list[dict[str, Any]] = []
    columns: list[dict[str, Any]] = []
    for track, place in first.items():
        run = runs[place].run
        headline = Headline(run, track)
        columns += [
            {
                "id": _id(track, setting, column.heading),
                "track": track,
                "setting": setting,
                "heading": column.heading,
                "unit": measure.unit,
                "better": measure.better,
                "cell": column.cell,
            }
            for setting in runs[place].values[track].values
            for column in headline.columns
            for measure in track_measures(track)
            if measure.name == column.measure
        ]
        heading = headline.main.heading
        setting = next(iter(runs[place].values[track].values))
        main = _id(track, setting, heading)
        ranked = [entry for entry in entries if main in numbers[entry.name]]
        models = [
            runs[e.runs[track]].values[track].values[setting][e.model.name, heading]
            for e in ranked
            if not e.model.is_baseline
        ]
        sides = [Side(e.name, e.model.name, runs[e.runs[track]].run) for e in ranked]
        ranges[track] = rank_ranges_of(sides, track)
        tracks.append(_track(track, run, models))
    lacking = [{track: shortfalls(one.run, track) for track in one.tracks} for one in runs]
    rows = []
    for entry in entries:
        name, of_tracks = entry.model.name, entry.runs.items()
        rows.append(
            {
                "name": entry.name,
                "model": name,
                "kind": entry.model.kind,
                "size_b": entry.model.size_b,
                "runs": entry.runs,
                "values": numbers[entry.name],
                "ranks": {t: list(r[entry.name]) for t, r in ranges.items() if entry.name in r},
                "lacking": {t: lacking[n][t][name] for t, n in of_tracks if name in lacking[n][t]},
                "facts": {t: runs[n].values[t].facts[name] for t, n in of_tracks},
            }
        )
    return {"tracks": tracks, "columns": columns, "rows": rows, "runs": list(map(_run, runs))}


def _id(track: str, setting: str, heading: str) -> str:
    return "/".join(filter(None, (track, setting, heading)))


def _track(track: str, run: Run, models: Sequence[Value]) -> dict[str, Any]:
    """Return a track of a page; `models`, without baselines, are compared with the blind ones."""
    kind, headline, finding = kind_of(track), Headline(run, track), ""
    measure, floor, parts = headline.measure, headline.floor, kind.report().part_names
    names = (one.name for one in track_measures(track))
    if floor is not None and models:
        above = sum(floor.is_below(value, measure.better) for value in models)
        said = f"{above} of {counted(len(models), 'model')} beat{'s' * (above == 1)}"
        rule = f"a rule that never sees the goal ({floor.name}, {rounded(floor.value)})"
        finding = f"{said if above else 'No model is shown to beat'} {rule}."
    return {
        "name": track,
        "title": kind.title,
        "item": kind.item,
        "main": headline.main.heading,
        "unit": measure.unit,
        "better": measure.better,
        "best": None if math.isnan(measure.best) else measure.best,
        "notes": track_notes(run, track),
        "errors": [name.removeprefix("wrong_") for name in names if name.startswith("wrong_")],
        "floor": floor and {"name": floor.name, "value": round(floor.value, 4)},
        "physics": kind.lets_go(run.manifest.suite),
        "finding": finding,
        "parts": dict(parts),
        "groups": {
            cell.name: {"title": cell.heading, "of": cell.of}
            for cell in run.cells(track)
            if cell.of and all(name in parts for name in cell.of)
        },
    }


def _run(one: SiteRun) -> dict[str, Any]:
    run, manifest, data = one.run, one.run.manifest, one.run.manifest.dataset
    words = [word for track in one.tracks for word in run.presentation(track)]
    return {
        "suite": run.design.suite.name,
        "limit": run.manifest.limit,
        "id": manifest.identity[:12],
        "date": manifest.created[:10],  # UTC
        "verified": one.unverified is not None,
        "unverified": one.unverified or (),
        "seeds": len(run.design.suite.seeds),
        "data": data.name if data else "",
        "version": data.version if data else None,
        "asked": list(dict.fromkeys(words)),
    }


def shortfalls(run: Run, track: str) -> Mapping[str, str]:
    """Return, for each model that lacks replies in a track, their number and the reason."""
    table, stopped = coverage_frame(run), read_stopped(run.path).models
    failed = run.records[run.records["error_kind"].notna() & (run.records["track"] == track)]
    causes = failed[["model", "error_kind", "error_status", "error_message"]]
    reasons: dict[str, Counter[str]] = {}
    for model, kind, status, message in zip(*(causes[name] for name in causes), strict=True):
        text = str(message or kind)
        if not pd.isna(status) and str(status) not in text:
            text = f"HTTP {status}: {text}"
        reasons.setdefault(model, Counter())[short(text)] += 1
    found = {}
    for row in table[table["track"] == track].to_dict("records"):
        model, answered = str(row["model"]), row["recorded"] - sum(row[n] for n in WITHOUT_REPLY)
        if answered < row["expected"]:
            often = [reason for reason, _ in reasons.get(model, Counter()).most_common(1)]
            why = [short(stopped[model])] if model in stopped else often
            found[model] = ": ".join([f"{answered:,} of {row['expected']:,} answered", *why])
    return found


def short(message: str) -> str:
    """Return a message as one short line, without a final period."""
    return shorten(message, _MOST_CHARACTERS, placeholder=" …").rstrip(".")
