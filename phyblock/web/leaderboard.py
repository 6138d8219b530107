"""Several runs as one leaderboard: a static folder that opens from disk or from any web server."""

from __future__ import annotations

import base64
import io
import json
import math
import os
import re
import textwrap
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field, replace
from itertools import combinations
from pathlib import Path
from typing import Any

from PIL import Image, ImageDraw, ImageFont
from pydantic import BaseModel

from phyblock.bundle import named, opened_bundle, portable_manifest
from phyblock.errors import DataError, Problem, SpecError, StoreError
from phyblock.files import LIST, OutFolder, digest_of_file, writing
from phyblock.records.files import RECORDS
from phyblock.records.manifest import MANIFEST, ManifestModel
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
    track_measures,
)
from phyblock.results.load import Run, load_run
from phyblock.results.tables import cost_frame, coverage_frame
from phyblock.results.text import number as rounded
from phyblock.sim.pictures import PictureStyle, goal_png, to_png
from phyblock.text import counted
from phyblock.tracks.base import CARRYING, kind_of
from phyblock.tracks.measures import Measure
from phyblock.web.pack import (
    IN_INDEX,
    Columns,
    Numbers,
    Pack,
    Sources,
    asset,
    build_of,
    fill,
    kit,
    open_sources,
    pack_scenes,
    places_of,
    question_entry,
    records_at,
    write_script,
    write_three,
)
from phyblock.web.report import shortfalls

INDEX = "index.html"
_DATA = "data/"
_PARTIAL = re.compile(r"\.[0-9a-f]{32}\.part")
_SCRIPTS = (
    *("dom.js", "chunks.js", "solid.js", "steps.js", "poses.js", "runs.js", "stage.js"),
    *("quotes.js", "overlay.js", "why.js", "store.js", "table.js", "chart.js", "board.js"),
    *("views.js", "replay.js", "site.js"),
)
_STYLES = ("base.css", "samples.css", "reply.css", "site.css")
_MAY_DIFFER = ("pictures",)
"""Parts of a track's identity: digests of pictures, which change with their size."""
_CONTROLS = frozenset({"blind", "wrong_image", "prompt", "path"})
"""Parts of a track's section of the suite that are shown with the run, or known by their digest."""
_HINTS = {
    "sha256": "give all runs the same levels and --limit, or make a site of each",
    CARRYING: "run the older one again, as phyblock score leaves what was carried out as it was, "
    "or make a site of each",
}
"""Hints by the last part of the name of what differs."""
_LABELS = ("published", "size_b", "served_at")
"""Parts of a manifest's model that do not decide its replies."""
_LONGEST = {"text": 6000, "reasoning": 2000}
"""Characters of a reply that a site shows; the bundle has all of it."""
_LEFT_OUT = IN_INDEX | {"reply", "scores", "turns", "prompt", "asked", "time", "counts"}
"""Fields of records that a replay needs otherwise or not at all; those that tracks add, it has."""
_ABOUT = (
    "A vision-language model sees a picture of a structure and sixteen numbered blocks, and says "
    "which blocks to place, in which order."
)
_TELLING_BLOCKS = 6
"""A failure tells most where its goal has about so many blocks."""
_REPLY = ("text", "reasoning", "finish", "cost_usd", "usage", "latency_s")


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


@dataclass(frozen=True)
class SiteWritten:
    """A site: its page, how many models and samples it shows, and its size without pictures."""

    path: Path
    models: int
    samples: int
    size_bytes: int
    lacking: str


def write_site(
    paths: Sequence[Path], out: Path, data: Sequence[Path] = (), title: str = "PhyBlock leaderboard"
) -> SiteWritten:
    """Put run folders and bundles into one static folder, the same bytes for the same runs.

    The page is written last and whole, so that a build that was stopped never looks like a site,
    and one that was there stays as it is until then. Raises SpecError for runs that cannot stand in
    one table, StoreError for what is no run, a bundle that does not verify, or a folder that holds
    what we did not write, DataError for a bundle whose data are not at hand.
    """
    if not paths:
        raise SpecError(Problem("site", "needs a run", allowed="run folders and bundles"))
    folder = OutFolder(out)
    _check_place(folder)
    with ExitStack() as kept:
        runs = open_runs(paths, data, kept)
        check_runs_alike(runs)
        entries, values = entries_of(runs), all_values(runs)
        board = board_of(runs, entries, values)
        told: list[Any] = [title]
        for one in runs:
            # The manifest of a bundle names this machine's data.
            manifest = one.run.manifest.identity if one.is_verified else None
            manifest = manifest or digest_of_file(one.run.path / MANIFEST)
            records = digest_of_file(one.run.path / RECORDS)
            told.append([manifest, records, one.is_verified, bool(one.sources.lacking)])
        build = build_of(*told)
        own = f"{_DATA}{build}/"
        with folder.alone(), writing(out):
            with folder.making(own) as new:
                samples = _write_samples(new, build, runs, entries, values)
                write_script(new, "board", build, {**board, "title": title})
                write_script(new, "samples", build, {**samples, "kit": kit()})
                write_three(new)
                finding = board["tracks"][0]["finding"]
                image = _card(title, finding, runs, samples)
                (new / "card.png").write_bytes(image)
                size = sum(path.stat().st_size for path in new.iterdir())
            facts = {"title": title, "folder": f"{_DATA}{build}", "build": build}
            facts |= {"description": f"{_ABOUT} {finding}".strip(), "image": f"{own}card.png"}
            facts["icon"] = base64.b64encode(asset("icon.svg")).decode()
            page = fill("site.html.j2", _SCRIPTS, _STYLES, **facts)
            (path,) = folder.write({INDEX: page})
            folder.remove(name for name in folder.names(_DATA) if not name.startswith(own))
    n_samples, lacking = len(samples["rows"]["entry"]), str(samples["lacking"])
    return SiteWritten(path, len(entries), n_samples, size + len(page.encode()), lacking)


def _check_place(folder: OutFolder) -> None:
    """Raise StoreError unless the folder is new, empty, or one that a site was written into."""
    out = folder.path
    if out.exists() and not out.is_dir():
        raise StoreError(Problem(str(out), "is no folder"))
    with writing(out, "choose another folder with --out"):
        found = {entry.name for entry in os.scandir(out)} if out.exists() else set()
    strangers = sorted(n for n in found if n != LIST and not _PARTIAL.fullmatch(n))
    if strangers and INDEX not in folder.names(INDEX) and not folder.names(_DATA):
        shown = ", ".join(strangers[:3]) + (", ..." if len(strangers) > 3 else "")
        message, hint = "is not empty and holds no site", "name a new or an empty folder with --out"
        raise StoreError(Problem(str(out), message, found=shown, hint=hint))
    folder.check([INDEX, _DATA])


def open_runs(paths: Sequence[Path], data: Sequence[Path], kept: ExitStack) -> tuple[SiteRun, ...]:
    """Open runs in the order given; bundles stay unpacked as long as `kept` is open.

    `data` are folders to look for data in, beside where runs found them and what comes with
    phyblock. Raises SpecError for a run that is given twice, StoreError for what is no run or does
    not verify, and DataError for a bundle whose data are not at hand.
    """
    opened: list[SiteRun] = []
    seen: dict[str, str] = {}
    for path in paths:
        where, unverified = str(path), None
        if path.is_file():
            verified = kept.enter_context(opened_bundle(path, data))
            unverified = verified.unverified
            with named(verified.folder, where):
                run = load_run(verified.folder)
        else:
            run = load_run(path)
        identity = run.manifest.identity
        if identity in seen:
            message = f"is the same run as {seen[identity]}"
            raise SpecError(Problem(where, message, "identity", identity[:16], hint="give it once"))
        seen[identity] = where
        sources = open_sources(run, None)
        for folder in data:
            if sources.lacking:
                with suppress(DataError):
                    sources = open_sources(run, folder)
        opened.append(SiteRun(where, run, sources, unverified))
    return tuple(opened)


def check_runs_alike(runs: Sequence[SiteRun]) -> None:
    """Raise SpecError naming all in which a run differs from the first that it could be held
    against, so that they cannot stand in one table.

    All must be of one version of one data set. Those that share a track must have asked about the
    same items of it, in the same words, shown alike in any size, and count in the same way.
    """
    problems: list[Problem] = []
    for number, one in enumerate(runs):
        differences = (list(_differences(one, first)) for first in runs[:number])
        problems += next(filter(None, differences), [])
    if problems:
        raise SpecError(problems)


def _differences(one: SiteRun, first: SiteRun) -> Iterator[Problem]:
    shared = [track for track in one.tracks if track in first.tracks]
    told, wanted = (dict(_facts(side.run, shared)) for side in (one, first))
    message = f"cannot stand in one table with {first.where}"
    for name, value in told.items():
        # A recording was asked elsewhere, and a baseline is asked in no words.
        if None not in (value, other := wanted.get(name)) and value != other:
            hint = _HINTS.get(name.rpartition(".")[2], "make a site of each")
            yield Problem(one.where, message, name, str(value), str(other), hint)


def _facts(run: Run, shared: Sequence[str]) -> Iterator[tuple[str, Any]]:
    """Yield what has to agree, by name; None where it is not said."""
    manifest, suite = run.manifest, run.design.suite
    if (data := manifest.dataset) is not None:
        yield "dataset.name", data.name
        yield "dataset.version", data.version
    if not shared:
        return
    if data is not None:
        yield "dataset.sha256", data.sha256[:12]
    if (asked := manifest.questions) is not None:
        yield "questions.version", asked.version
    yield "scoring.matchers", suite.scoring.matchers[0]
    yield "scoring.level1", suite.scoring.level1
    yield "scoring.missing", suite.scoring.missing
    yield "settings", ", ".join(suite.settings)
    yield "answer_format", suite.answer_format
    yield "vary", ", ".join(suite.vary.factors) or "nothing"
    for track in shared:
        identity = manifest.tracks.get(track, {})
        for key, value in identity.items():
            if isinstance(value, Mapping) and {"name", "version"} <= value.keys():
                # A prompt by its name and digest.
                value = f"{value['name']} ({str(value['version'])[:12]})"
            if key not in _MAY_DIFFER:
                yield f"tracks.{track}.{key}", value
        held: list[tuple[str, BaseModel, frozenset[str]]] = []
        if identity.get("pictures") is not None:
            held.append(("images", run.design.suite.images, frozenset({"size_px"})))
        if (section := kind_of(track).section) is not None:
            held.append((section[0], run.design.suite.section(section[1]), _CONTROLS))
        for name, values, without in held:
            for key in type(values).model_fields.keys() - without:
                yield f"{name}.{key}", str(getattr(values, key))


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
    costs, outcomes = (
        frame[frame["track"] == track].set_index("model").to_dict("index")
        for frame in (cost_frame(run), coverage_frame(run))
    )

    def known(value: Any) -> Any:
        if not isinstance(value, float):
            return value
        return None if math.isnan(value) else float(f"{value:.6g}")

    errors, found = _error_shares(run, track), {}
    for model, row in outcomes.items():
        cost, solved, whole = costs[model], None, None
        if not math.isnan(best):
            solved = sum(value == best for value in samples.get(str(model), {}).values())
        if known(price := cost["cost_per_100_usd"]) is not None and solved:
            whole = price / 100 * int(row["replies"]) / solved
        facts = {
            "expected": int(row["expected"]),
            "done": int(row["recorded"]),
            "failed": int(row["recorded"] - row["ok"]),
            "solved": solved,
            "prompt_tokens": cost["prompt_tokens"],
            "completion_tokens": cost["completion_tokens"],
            "latency_s": cost["latency_median_s"],
            "usd_per_100": price,
            "usd_per_solved": whole,
            "errors": errors.get(str(model), {}),
        }
        found[str(model)] = {name: known(value) for name, value in facts.items()}
    return found


def _error_shares(run: Run, track: str) -> dict[str, dict[str, float]]:
    """Return the share [%] of each type of wrong step by model, in the headline setting."""
    cell = kind_of(track).report().cells(run)[-1].name
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
        about["notes"] = list(kind.report().notes(run))
        floor = headline_floors(run, track).get(heading)
        about["floor"] = floor and {"name": floor.name, "value": round(floor.value, 4)}
        tracks.append({**about, "physics": kind.physics(run.manifest.suite)})
        measures = {one.name: one for one in track_measures(track)}
        for setting in values[place, track].values:
            for column in headline_columns(run, track):
                of = measures[column.measure]
                told = {"track": track, "setting": setting, "heading": column.heading}
                told |= {"unit": of.unit, "better": of.better, "share": of.is_share}
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


def _card(title: str, finding: str, runs: Sequence[SiteRun], samples: Mapping[str, Any]) -> bytes:
    """Return the picture of a site for links to it: its title and finding, and a goal, as PNG of
    1200 x 630 pixels.
    """
    card = Image.new("RGB", (1200, 630), "#ffffff")
    scenes = samples["scenes"]
    for telling in samples["telling"]:
        scene = scenes[samples["items"]["scene"][samples["rows"]["item"][telling["row"]]]]
        tasks = (one.sources.tasks.get(scene) for one in runs)
        if (task := next(filter(None, tasks), None)) is not None:
            goal = goal_png(task.scene, PictureStyle(size_px=560))
            card.paste(Image.open(io.BytesIO(goal)).convert("RGB"), (605, 35))
            break
    draw, top = ImageDraw.Draw(card), 110
    for text, size, color, width in ((title, 58, "#16181d", 18), (finding, 36, "#3a4cc4", 30)):
        for line in textwrap.wrap(text, width):
            draw.text((50, top), line, color, ImageFont.load_default(size))
            top += round(1.25 * size)
        top += 36
    return to_png(card)


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
    showing = [word for track in one.tracks for word in kind_of(track).report().showing(run)]
    return {
        "suite": run.design.suite.name,
        "id": manifest.identity[:12],
        "date": one.date,
        "verified": one.is_verified,
        "unverified": one.unverified or (),
        "seeds": len(run.design.suite.seeds),
        "data": data.name if data else "",
        "version": data.version if data else None,
        "asked": list(dict.fromkeys((*showing, *run.varied_words))),
        "phyblock": manifest.versions.get("phyblock", ""),
    }


def _write_samples(
    folder: Path,
    build: str,
    runs: Sequence[SiteRun],
    entries: Sequence[Entry],
    values: AllValues,
) -> dict[str, Any]:
    """Write the scripts of single samples; return the index of all samples and items as columns.

    Raises OSError where the disk refuses, StoreError for a record that cannot be read.
    """
    packs = {kind: Pack(folder, kind, build) for kind in ("replays", "scenes", "questions")}
    failures: dict[str, list[tuple[float, int, str]]] = {}
    scenes, numbered, tracks, outcomes, ways = (Numbers() for _ in range(5))
    items = Columns("track", "key", "scene", "levels", "part", "question")
    rows = Columns("entry", "item", "seed", "way", "outcome", "score")
    owner = {
        (number, track, entry.model.name): place
        for place, entry in enumerate(entries)
        for track, number in entry.runs.items()
    }
    for number, one in enumerate(runs):
        # Model by model: what one model says packs best together.
        order = Numbers(one.run.design.model_names)
        places = [p for p in places_of(one.run) if p.track in one.tracks]
        places.sort(key=lambda place: order.of(place.model))
        for record in records_at(one.run.path, places):
            track, item = record.track, record.item
            if (track, item) not in numbered:
                known = one.sources.items.get(track)
                shown = known.shown(record) if known else None
                items.add(
                    track=tracks.of(track),
                    key=item,
                    scene=scenes.of(record.scene),
                    levels=list(record.levels),
                    part=record.part,
                    question=packs["questions"].add(question_entry(shown.question))
                    if known and shown
                    else -1,
                )
            worth = values[number, track].samples.get(record.model, {})
            score = worth.get((record.scene, item, record.seed, record.way.key))
            rows.add(
                entry=owner[number, track, record.model],
                item=numbered.of((track, item)),
                seed=record.seed,
                way=ways.of(record.way.key),
                outcome=outcomes.of(record.outcome),
                score=None if score is None else round(score * 10),
            )
            replay = packs["replays"].add(_replay(record, one.run))
            if (
                not entries[rows["entry"][-1]].model.is_baseline
                and record.scene in one.sources.tasks
            ):
                for error, worth_seeing in _failure(record, one.run):
                    found = (worth_seeing, replay, record.model)
                    failures.setdefault(error, []).append(found)
    is_drawn = pack_scenes(scenes, [one.sources for one in runs], packs["scenes"])
    for pack in packs.values():
        pack.close()
    parts: dict[str, str] = {}
    for track in tracks:
        parts |= kind_of(track).report().part_names
    telling: dict[int, str] = {}
    models: set[str] = set()
    for error, found_in in sorted(failures.items(), key=lambda pair: len(pair[1])):
        # Of every type of error another model's and another sample, where there is one.
        rest = [one for one in found_in if one[1] not in telling]
        if rest:
            _, row, model = min(rest, key=lambda one: (one[2] in models, -one[0], one[1]))
            telling[row] = error
            models.add(model)
    return {
        "telling": [{"row": row, "error": error} for row, error in telling.items()],
        "tracks": list(tracks),
        "items": items,
        "outcomes": list(outcomes),
        "ways": list(ways),
        "rows": rows,
        "scenes": list(scenes),
        "starts": {kind: pack.starts for kind, pack in packs.items()},
        "parts": parts,
        "lacking": "" if is_drawn else runs[0].sources.lacking,
    }


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


def _replay(record: Record, run: Run) -> dict[str, Any]:
    """Return what a page shows of a record."""
    fields = record.fields()
    entry = {
        name: value for name, value in fields.items() if name not in _LEFT_OUT and value is not None
    }
    if record.asked_turns:
        entry["turns"] = [
            {
                **{name: turn[name] for name in turn if name != "prompt"},
                "reply": _cut(turn["reply"]),
            }
            for turn in fields["turns"]
        ]
    elif record.reply is not None:
        entry["reply"] = _cut(fields["reply"])
    entry["scores"] = [
        {name: score.get(name) for name in ("setting", "tp", "fp", "fn", "placed", "why")}
        for score in fields["scores"]
        if score.get("matcher") in (None, run.design.matcher) and score.get("placed") is not None
    ]
    return entry


def _cut(reply: Mapping[str, Any]) -> dict[str, Any]:
    """Return what is shown of a reply, long texts cut."""
    kept = {name: reply[name] for name in _REPLY if reply.get(name) not in (None, "")}
    for name, most in _LONGEST.items():
        if len(text := kept.get(name, "")) > most:
            kept |= {name: text[:most], f"{name}_characters": len(text)}
    return kept
