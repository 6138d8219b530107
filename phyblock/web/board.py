"""Runs as numbers of a page: models with values, ranks and facts, and the finding in words."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pandas as pd

from phyblock.bundle import portable_manifest
from phyblock.data.base import AssemblyTask
from phyblock.errors import DataError
from phyblock.records.files import ManifestModel, read_stopped
from phyblock.records.record import Record
from phyblock.results.compare import Side, comparable, rank_ranges_of
from phyblock.results.estimates import (
    Floor,
    Value,
    headline_columns,
    headline_of,
    headline_rows,
    main_column,
    main_measure,
    strongest_floor,
    track_estimates,
    track_notes,
)
from phyblock.results.load import Run, track_measures
from phyblock.results.tables import coverage_frame
from phyblock.results.text import number as rounded
from phyblock.run.rescore import recorded_dataset
from phyblock.text import counted
from phyblock.tracks.base import kind_of
from phyblock.tracks.measures import Better
from phyblock.types import WITHOUT_REPLY

_LABELS = ("published", "size_b", "served_at")
"""Parts of a manifest's model that do not decide its replies."""
_MOST_CHARACTERS = 160


@dataclass(frozen=True)
class Sources:
    """Tasks by scene id, and items that are more than scenes by track; where there are none,
    `lacking` says why.
    """

    tasks: Mapping[str, AssemblyTask] = field(default_factory=dict)
    items: Mapping[str, Callable[[Record], Any]] = field(default_factory=dict)
    lacking: str = ""


def open_sources(run: Run, data: Path | None) -> Sources:
    """Return the scenes of a run, from `data` or from where the run found them, and what else
    its tracks asked about. Without them a page shows every reply and score, but cannot draw.

    Raises DataError when `data` is given and is not what the run was made on.
    """
    try:
        dataset = recorded_dataset(run.path, run.manifest, data)
        openers = {name: kind_of(name).report().items for name in run.design.suite.tracks}
        facts = (run.path, run.manifest, dataset)
        items = {name: opener(*facts) for name, opener in openers.items() if opener}
        return Sources({task.scene.id: task for task in dataset.tasks}, items)
    except DataError as error:
        if data is not None:
            raise
        said = f"{error.problems[0].where}: {error.problems[0].message}"
        how = "phyblock report RUN --data FOLDER draws it from where it is now"
        return Sources(lacking=f"Nothing can be drawn without the data set ({said}); {how}.")


@dataclass(frozen=True, eq=False)
class SiteRun:
    """A run that was opened: `where` is what the user calls it, `sources` are what can be drawn of
    it. `unverified` says what was taken as a bundle says it; None for a folder, which is not
    scored again.
    """

    where: str
    run: Run
    sources: Sources
    unverified: tuple[str, ...] | None = None

    @property
    def date(self) -> str:
        """The day on which it was begun, UTC."""
        return self.run.manifest.created[:10]

    @property
    def tracks(self) -> tuple[str, ...]:
        """The tracks of its suite."""
        return self.run.design.suite.tracks


@dataclass
class Entry:
    """A row: `runs` has the number of the run that asked each of its tracks. `name` is unique."""

    model: ManifestModel
    runs: dict[str, int] = field(default_factory=dict)
    name: str = ""


Key = tuple[str, str, int, str]
"""A sample of one model: scene, item, seed, variant."""


@dataclass(frozen=True, eq=False)
class TrackValues:
    """A track of a run: `values` by setting, model and heading; `samples` what each sample is worth
    by the main measure, in its unit, by model and `Key`, without those that have no value; `facts`
    by model.

    Settings are those of the run, or "" alone where the track knows none.
    """

    values: Mapping[str, Mapping[tuple[str, str], Value]]
    samples: Mapping[str, Mapping[Key, float]]
    facts: Mapping[str, Mapping[str, Any]]


AllValues = Mapping[tuple[int, str], TrackValues]
"""Values by number of the run, and track."""


def entries_of(runs: Sequence[SiteRun]) -> tuple[Entry, ...]:
    """Return every model of every run.

    A model that two runs asked in different tracks is one row, where it is the same model with the
    same parameters. Asked in the same track it is a row for each run, told apart by the date and
    the identity of the run.
    """
    found: list[tuple[str, Entry]] = []
    for number, one in enumerate(runs):
        # A run stands in the same row as a folder and as a bundle.
        for model in portable_manifest(one.run.manifest).models:
            told = {name: value for name, value in model.fields().items() if name not in _LABELS}
            identity = json.dumps(told, sort_keys=True, default=str)
            same = (
                entry
                for known, entry in found
                if known == identity and not set(one.tracks) & set(entry.runs)
            )
            entry = next(same, None)
            if entry is None:
                entry = Entry(model)
                found.append((identity, entry))
            entry.runs |= dict.fromkeys(one.tracks, number)
    entries = tuple(entry for _, entry in found)
    used = Counter(entry.model.name for entry in entries)
    for place, entry in enumerate(entries):
        entry.name, one = entry.model.name, runs[min(entry.runs.values())]
        if used[entry.name] > 1:
            entry.name += f" ({one.date}, run {one.run.manifest.identity[:8]})"
        if entry.name in {other.name for other in entries[:place]}:
            entry.name += f" ({place + 1})"
    return entries


def all_values(runs: Sequence[SiteRun]) -> AllValues:
    """Return the values of every track of every run."""
    return {
        (number, track): values_of(one.run, track)
        for number, one in enumerate(runs)
        for track in one.tracks
    }


def values_of(run: Run, track: str) -> TrackValues:
    """Return all values of a track."""
    what, estimates, design = comparable(run, track), track_estimates(run, track), run.design
    samples = {
        model: dict(zip(values.index, values.tolist(), strict=True))
        for model, values in what.values(run, what.parts[-1], design)
    }
    columns = headline_columns(run, track)
    shown = estimates[estimates["measure"].isin([column.measure for column in columns])]
    values: dict[str, Mapping[tuple[str, str], Value]] = {}
    for setting in design.suite.settings if shown["setting"].astype(bool).any() else ("",):
        suite = design.suite.model_copy(update={"settings": (setting,)} if setting else {})
        values[setting] = headline_of(run, track, replace(design, suite=suite))
    return TrackValues(values, samples, _facts_of(run, track, samples, what.measure.best))


def _facts_of(
    run: Run, track: str, samples: Mapping[str, Mapping[Key, float]], best: float
) -> dict[str, dict[str, Any]]:
    """Return by model what its samples of a track took and came to; None where it is not known.

    `solved` samples are worth all that a sample can be; None where a sample may always be worth
    more. `errors` are shares of wrong steps [%]. Costs [US dollars] are at the prices of the
    replies, cached ones included.
    """
    table = coverage_frame(run)
    outcomes = table[table["track"] == track].set_index("model").to_dict("index")

    def known(value: Any) -> Any:
        if not isinstance(value, float):
            return value
        return None if math.isnan(value) else float(f"{value:.6g}")

    errors: dict[str, dict[str, float]] = {}
    rows = headline_rows(track_estimates(run, track), run.design)
    rows = rows[rows["cell"] == run.cells(track)[-1].name]
    for row in rows[rows["value"].notna()].to_dict("records"):
        name = str(row["measure"])
        if name.startswith("wrong_"):
            of_model = errors.setdefault(str(row["model"]), {})
            of_model[name.removeprefix("wrong_")] = round(100 * float(row["value"]), 2)
    found = {}
    for model, row in outcomes.items():
        solved, whole = None, None
        if not math.isnan(best):
            solved = sum(value == best for value in samples.get(str(model), {}).values())
        if known(price := row["cost_per_100_usd"]) is not None and solved:
            whole = price / 100 * int(row["replies"]) / solved
        facts = {
            "expected": int(row["expected"]),
            "done": int(row["recorded"]),
            "failed": int(row["recorded"] - row["ok"]),
            "solved": solved,
            "prompt_tokens": row["prompt_tokens"],
            "completion_tokens": row["completion_tokens"],
            "latency_s": row["latency_median_s"],
            "usd_per_100": price,
            "usd_per_solved": whole,
            "errors": errors.get(str(model), {}),
        }
        found[str(model)] = {name: known(value) for name, value in facts.items()}
    return found


def board_of(
    runs: Sequence[SiteRun], entries: Sequence[Entry], values: AllValues
) -> dict[str, Any]:
    """Return the numbers that a page shows, as plain values.

    Raises SpecError for runs that cannot be compared.
    """
    first: dict[str, int] = {}
    for number, one in enumerate(runs):
        first |= {track: number for track in one.tracks if track not in first}
    numbers = {entry.name: _values(entry, values) for entry in entries}
    ranges: dict[str, Mapping[str, tuple[int, int]]] = {}
    tracks: list[dict[str, Any]] = []
    columns: list[dict[str, Any]] = []
    for track, place in first.items():
        run, of = runs[place].run, {one.name: one for one in track_measures(track)}
        columns += [
            {
                "id": _id(track, setting, column.heading),
                "track": track,
                "setting": setting,
                "heading": column.heading,
                "unit": of[column.measure].unit,
                "better": of[column.measure].better,
                "cell": column.cell,
            }
            for setting in values[place, track].values
            for column in headline_columns(run, track)
        ]
        heading = main_column(run, track).heading
        setting = next(iter(values[place, track].values))
        main = _id(track, setting, heading)
        ranked = [entry for entry in entries if main in numbers[entry.name]]
        models = [
            values[e.runs[track], track].values[setting][e.model.name, heading]
            for e in ranked
            if not e.model.is_baseline
        ]
        sides = [Side(e.name, e.model.name, runs[e.runs[track]].run) for e in ranked]
        ranges[track] = rank_ranges_of(sides, track)
        tracks.append(_track(track, run, models))
    lacking = {key: shortfalls(runs[key[0]].run, key[1]) for key in values}
    rows = []
    for entry in entries:
        name, of_tracks = entry.model.name, [(n, track) for track, n in entry.runs.items()]
        rows.append(
            {
                "name": entry.name,
                "model": name,
                "kind": entry.model.kind,
                "size_b": entry.model.size_b,
                "runs": dict(entry.runs),
                "values": numbers[entry.name],
                "ranks": {t: list(r[entry.name]) for t, r in ranges.items() if entry.name in r},
                "lacking": {k[1]: lacking[k][name] for k in of_tracks if name in lacking[k]},
                "facts": {key[1]: values[key].facts[name] for key in of_tracks},
            }
        )
    return {
        "tracks": tracks,
        "columns": columns,
        "rows": rows,
        "runs": [_run(one) for one in runs],
    }


def _track(track: str, run: Run, models: Sequence[Value]) -> dict[str, Any]:
    """Return a track of a page; `models` are the values of those that are no baselines."""
    kind, measure = kind_of(track), main_measure(run, track)
    report, heading = kind.report(), main_column(run, track).heading
    floor = strongest_floor(run, track)
    names = (one.name for one in track_measures(track))
    parts = report.part_names
    return {
        "name": track,
        "title": kind.title,
        "item": kind.item,
        "main": heading,
        "unit": measure.unit,
        "better": measure.better,
        "best": None if math.isnan(measure.best) else measure.best,
        "notes": list(track_notes(run, track)),
        "errors": [name.removeprefix("wrong_") for name in names if name.startswith("wrong_")],
        "floor": floor and {"name": floor.name, "value": round(floor.value, 4)},
        "physics": kind.lets_go(run.manifest.suite),
        "finding": _finding(floor, measure.better, models),
        "parts": dict(parts),
        "groups": {
            cell.name: {"title": cell.heading, "of": list(cell.of)}
            for cell in run.cells(track)
            if cell.of and all(name in parts for name in cell.of)
        },
    }


def _finding(floor: Floor | None, better: Better, models: Sequence[Value]) -> str:
    """Say how many models are above the strongest blind baseline; "" where there is none of
    either.
    """
    if floor is None or not models:
        return ""
    above = sum(floor.is_below(value, better) for value in models)
    rule = f"a rule that never sees the goal ({floor.name}, {rounded(floor.value)})"
    if not above:
        return f"No model is shown to beat {rule}."
    return f"{above} of {counted(len(models), 'model')} beat{'s' * (above == 1)} {rule}."


def _id(track: str, setting: str, heading: str) -> str:
    return "/".join(filter(None, (track, setting, heading)))


def _values(entry: Entry, values: AllValues) -> dict[str, list[float | None]]:
    """Return value and interval by column."""
    return {
        _id(track, setting, heading): [
            None if math.isnan(number) else round(number, 4)
            for number in (value.value, value.lo, value.hi)
        ]
        for track, number in entry.runs.items()
        for setting, of_setting in values[number, track].values.items()
        for (model, heading), value in of_setting.items()
        if model == entry.model.name and not math.isnan(value.value)
    }


def _run(one: SiteRun) -> dict[str, Any]:
    run, manifest, data = one.run, one.run.manifest, one.run.manifest.dataset
    words = [word for track in one.tracks for word in run.presentation(track)]
    return {
        "suite": run.design.suite.name,
        "id": manifest.identity[:12],
        "date": one.date,
        "verified": one.unverified is not None,
        "unverified": one.unverified or (),
        "seeds": len(run.design.suite.seeds),
        "data": data.name if data else "",
        "version": data.version if data else None,
        "asked": list(dict.fromkeys(words)),
    }


def shortfalls(run: Run, track: str) -> Mapping[str, str]:
    """Return by model that lacks replies in a track how many it has, and why it has no more."""
    table, stopped = coverage_frame(run), read_stopped(run.path).models
    failed = run.records[run.records["error_kind"].notna() & (run.records["track"] == track)]
    reasons: dict[str, Counter[str]] = {}
    for row in failed[["model", "error_kind", "error_status", "error_message"]].to_dict("records"):
        status = row["error_status"]
        message = " ".join(str(row["error_message"] or row["error_kind"]).split())
        if not pd.isna(status) and str(status) not in message:
            message = f"HTTP {status}: {message}"
        reasons.setdefault(str(row["model"]), Counter())[short(message)] += 1
    found = {}
    for row in table[table["track"] == track].to_dict("records"):
        model, answered = str(row["model"]), row["recorded"] - sum(row[n] for n in WITHOUT_REPLY)
        if answered < row["expected"]:
            why = [short(stopped[model])] if model in stopped else []
            why = why or [reason for reason, _ in reasons.get(model, Counter()).most_common(1)]
            found[model] = ": ".join([f"{answered:,} of {row['expected']:,} answered", *why])
    return found


def short(message: str) -> str:
    """Return a message in one short line, without the stop at its end."""
    text = " ".join(message.split()).rstrip(".")
    return text if len(text) <= _MOST_CHARACTERS else f"{text[:_MOST_CHARACTERS].rstrip()} …"
