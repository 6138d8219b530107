"""The data of a ranking: models with values, ranks and facts, and the finding in words."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Any

import pandas as pd

from phyblock.bundle import portable_manifest
from phyblock.records.files import read_stopped
from phyblock.records.manifest import ManifestModel
from phyblock.records.record import Record
from phyblock.results.compare import Side, comparable, compare, ranks
from phyblock.results.estimates import (
    Floor,
    Value,
    headline_columns,
    headline_floors,
    headline_of,
    headline_rows,
    main_column,
    main_measure,
    track_estimates,
    track_notes,
)
from phyblock.results.load import Run, track_measures
from phyblock.results.tables import coverage_frame
from phyblock.results.text import number as rounded
from phyblock.text import counted
from phyblock.tracks.base import kind_of
from phyblock.tracks.measures import Measure
from phyblock.types import WITHOUT_REPLY
from phyblock.web.pack import Sources

_LABELS = ("published", "size_b", "served_at")
"""Parts of a manifest's model that do not decide its replies."""
_MOST_CHARACTERS = 160
_TELLING_BLOCKS = 6
"""A failure tells most where its goal has about so many blocks."""


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
    def is_verified(self) -> bool:
        """True if it came in a bundle and was scored again."""
        return self.unverified is not None

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
        in_setting = replace(design, suite=suite)
        values[setting] = headline_of(run, track, in_setting)
    return TrackValues(values, samples, _facts_of(run, track, samples, what.measure.best))


def _facts_of(
    run: Run, track: str, samples: Mapping[str, Mapping[Key, float]], best: float
) -> dict[str, dict[str, Any]]:
    """Return by model what its samples of a track took and came to; None where it is not known.

    `solved` samples are worth all that a sample can be; None where a sample may always be worth
    more. Costs [US dollars] are at the prices of the replies, cached ones included.
    """
    table = coverage_frame(run)
    outcomes = table[table["track"] == track].set_index("model").to_dict("index")

    def known(value: Any) -> Any:
        if not isinstance(value, float):
            return value
        return None if math.isnan(value) else float(f"{value:.6g}")

    errors, found = _error_shares(run, track), {}
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


def _error_shares(run: Run, track: str) -> dict[str, dict[str, float]]:
    """Return the share [%] of each type of wrong step by model, in the headline setting."""
    cell = run.cells(track)[-1].name
    rows = headline_rows(track_estimates(run, track), run.design)
    wanted = rows["measure"].str.startswith("wrong_") & (rows["cell"] == cell)
    found: dict[str, dict[str, float]] = {}
    for row in rows[wanted & rows["value"].notna()].to_dict("records"):
        name = str(row["measure"]).removeprefix("wrong_")
        found.setdefault(str(row["model"]), {})[name] = round(100 * float(row["value"]), 2)
    return found


def rank_ranges_of(
    track: str, entries: Sequence[Entry], runs: Sequence[SiteRun], values: AllValues
) -> Mapping[str, tuple[int, int]]:
    """Return best and worst rank of entries in a track, by name, Holm-corrected over all pairs.

    `entries` are those with a value in it. Only models have ranks, of which no sample was left out;
    {} where there are not two. A pair without a sample in common is not told apart. Raises
    SpecError for runs that cannot be compared.
    """
    sides = []
    for entry in entries:
        facts = values[entry.runs[track], track].facts[entry.model.name]
        if not entry.model.is_baseline and facts["done"] == facts["expected"]:
            sides.append(Side(entry.name, entry.model.name, runs[entry.runs[track]].run))
    if len(sides) < 2:
        return {}
    what = comparable(sides[0].run, track)
    table = compare(list(combinations(sides, 2)), what.parts[-1:], what).table
    known = table.assign(p=table["p"].fillna(1.0), p_holm=table["p_holm"].fillna(1.0))
    rows = ranks(known, what.measure).to_dict("records")
    return {str(row["model"]): (int(row["best"]), int(row["worst"])) for row in rows}


def board_of(
    runs: Sequence[SiteRun], entries: Sequence[Entry], values: AllValues
) -> dict[str, Any]:
    """Return what the first page shows, plain values.

    Raises SpecError for runs that cannot be compared.
    """
    first: dict[str, int] = {}
    for number, one in enumerate(runs):
        first |= {track: number for track in one.tracks if track not in first}
    numbers = {entry.name: _values(entry, values) for entry in entries}
    ranges: dict[str, Mapping[str, tuple[int, int]]] = {}
    tracks: list[dict[str, Any]] = []
    columns: list[dict[str, Any]] = []
    about: dict[str, Any]
    told: dict[str, Any]
    for track, place in first.items():
        kind, run, measure = kind_of(track), runs[place].run, main_measure(runs[place].run, track)
        heading = main_column(run, track).heading
        about = {"name": track, "title": kind.title, "item": kind.item, "main": heading}
        about |= {"unit": measure.unit, "better": measure.better}
        about["best"] = None if math.isnan(measure.best) else measure.best
        about["notes"] = list(track_notes(run, track))
        wrong = [one.name for one in track_measures(track) if one.name.startswith("wrong_")]
        about["errors"] = [name.removeprefix("wrong_") for name in wrong]
        floor = headline_floors(run, track).get(heading)
        about["floor"] = floor and {"name": floor.name, "value": round(floor.value, 4)}
        tracks.append({**about, "physics": kind.lets_go(run.manifest.suite)})
        measures = {one.name: one for one in track_measures(track)}
        for setting in values[place, track].values:
            for column in headline_columns(run, track):
                of = measures[column.measure]
                told = {"track": track, "setting": setting, "heading": column.heading}
                told |= {"unit": of.unit, "better": of.better, "cell": column.cell}
                columns.append({"id": _id(track, setting, column.heading), **told})
        main = _id(track, next(iter(values[place, track].values)), heading)
        ranked = [entry for entry in entries if main in numbers[entry.name]]
        models = [entry.name for entry in ranked if not entry.model.is_baseline]
        tracks[-1]["finding"] = _finding(floor, measure, [numbers[name][main] for name in models])
        ranges[track] = rank_ranges_of(track, ranked, runs, values)
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
    told = {"tracks": tracks, "columns": columns, "rows": rows}
    return {**told, "runs": [_run(one) for one in runs]}


def _finding(
    floor: Floor | None, measure: Measure, values: Sequence[Sequence[float | None]]
) -> str:
    """Say how many models, by their value and its interval, are above the strongest blind
    baseline; "" where there is none of either.
    """
    if floor is None or not values:
        return ""
    place = 1 if measure.better == "higher" else 2
    ends = [value[place] for value in values]
    sign = 1 if measure.better == "higher" else -1
    above = sum(end is not None and sign * (end - floor.value) > 0 for end in ends)
    rule = f"a rule that never sees the goal ({floor.name}, {rounded(floor.value)})"
    if not above:
        return f"No model is shown to beat {rule}."
    return f"{above} of {counted(len(values), 'model')} beat{'s' * (above == 1)} {rule}."


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
        "verified": one.is_verified,
        "unverified": one.unverified or (),
        "seeds": len(run.design.suite.seeds),
        "data": data.name if data else "",
        "version": data.version if data else None,
        "asked": list(dict.fromkeys(words)),
        "phyblock": manifest.versions.get("phyblock", ""),
    }


class Failures:
    """Finds samples that tell how models fail: of every type of error one, of other models where
    there are some.
    """

    def __init__(self, run: Run, known: frozenset[str]) -> None:
        """Take failures of models of a run in scenes that can be drawn, `known` by name."""
        self._run, self._known = run, known
        self._rules = {model.name for model in run.manifest.models if model.is_baseline}
        self.found: list[tuple[str, float, int, str]] = []

    def see(self, record: Record, row: int) -> None:
        """Take up a record that stands at a row of a page's samples."""
        if record.model not in self._rules and record.scene in self._known:
            for error, told in _failure(record, self._run):
                self.found.append((error, told, row, record.model))


def telling(failures: Sequence[Failures], most: int) -> list[dict[str, Any]]:
    """Return the samples that tell most: `row` and `error` of each."""
    found = [one for of_run in failures for one in of_run.found]
    frequent = Counter(error for error, *_ in found)
    chosen: dict[int, str] = {}
    models: set[str] = set()
    errors = sorted(frequent, key=lambda error: (frequent[error], error))
    while found and len(chosen) < most:
        before = len(chosen)
        for error in errors[: most - len(chosen)]:
            rest = [one for one in found if one[0] == error and one[2] not in chosen]
            if rest:
                _, _, row, model = min(rest, key=lambda one: (one[3] in models, -one[1], one[2]))
                chosen[row] = error
                models.add(model)
        if len(chosen) == before:
            break
    return [{"row": row, "error": error} for row, error in chosen.items()]


def _failure(record: Record, run: Run) -> Iterator[tuple[str, float]]:
    """Yield the type of a sample's first wrong step, and how much the sample tells: it goes well
    for some steps first, and its goal is neither tiny nor large.
    """
    design = run.design
    for score in record.scores:
        wanted = score.setting == design.setting and score.matcher in (None, design.matcher)
        if not wanted or score.why is None:
            continue
        first = next((n for n, why in enumerate(score.why) if why is not None), None)
        if first is not None and first >= 2:
            yield str(score.why[first]), min(first, 4) - abs(record.n_blocks - _TELLING_BLOCKS)
        return


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
