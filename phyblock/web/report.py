"""The report of a run: a page that opens from disk, and a folder of data beside it."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any, Literal
from urllib.parse import urlencode

import pandas as pd

from phyblock.files import OutFolder, digest_of_file, writing
from phyblock.records.files import PROMPTS, RECORDS, STOPPED, read_stopped
from phyblock.records.manifest import MANIFEST
from phyblock.results.compare import compare_models, rank_text
from phyblock.results.estimates import headline_floors, headline_of, main_measure, main_values
from phyblock.results.load import Run
from phyblock.results.tables import TablesWritten, coverage_frame, shown_columns, table_files
from phyblock.results.text import NO_VALUE, captioned, number
from phyblock.tracks.base import kind_of
from phyblock.types import WITHOUT_REPLY
from phyblock.web.pack import (
    Pack,
    SampleIndex,
    Sources,
    build_of,
    fill,
    has_pictures,
    items_shown,
    keep_pictures,
    kit,
    open_sources,
    pack_samples,
    pack_scenes,
    places_of,
    question_entry,
    write_script,
    write_three,
)

_SCRIPTS = (
    *("dom.js", "chunks.js", "data.js", "solid.js", "filters.js", "search.js", "list.js"),
    *("steps.js", "poses.js", "runs.js", "stage.js", "markdown.js", "quotes.js", "overlay.js"),
    *("why.js", "reply.js", "sent.js", "detail.js", "tracks.js", "matrix.js", "results.js"),
    *("address.js", "app.js"),
)
_STYLES = ("base.css", "results.css", "samples.css", "reply.css", "matrix.css", "print.css")
REPORT_FILE = "report.html"
_FOLDER = "report"
_PICTURES = f"{_FOLDER}/pictures/"
_NOT_SHOWN = ("table1",)
"""Tables that a headline table replaces."""
_MOST_NAMED = 6
_MOST_CHARACTERS = 160
_INTERVAL = "Below the first value stands its 95 % interval, from leaving out each base scene."
_RANKS = (
    "Rank: the places that a model may have, by paired tests of all models with Holm's correction."
)


@dataclass(frozen=True)
class Cell:
    """A number as shown, with the lines under it; `value` sorts, None where there is none.

    `query` is the address of the samples that it was made from, as the page reads it.
    """

    text: str
    value: float | None = None
    below: tuple[str, ...] = ()
    query: str = ""


@dataclass(frozen=True)
class Row:
    """A model, or a value to hold models against; `strip` is its main value and interval [%].

    There is none without a value, and for a main measure that is no share. `rank` is the place that
    a model may have (`2`, or `1 to 3` where tests cannot tell), `lacking` says how many samples
    have no reply and why.
    """

    name: str
    kind: Literal["model", "baseline", "reference"]
    cells: tuple[Cell, ...]
    strip: tuple[float, float, float] | None = None
    rank: str = ""
    lacking: str = ""
    query: str = ""


@dataclass(frozen=True)
class Headline:
    """A headline table, whose first column is what models are ranked by: models, baselines,
    values for scale. Where it `has_strips`, as a share has, they draw it from 0 to 100 %.
    """

    track: str
    title: str
    columns: tuple[str, ...]
    rows: tuple[Row, ...]
    notes: tuple[str, ...]
    has_strips: bool

    @property
    def ranked(self) -> bool:
        """True if there are ranks at all."""
        return any(row.rank for row in self.rows)


def headlines(run: Run) -> list[Headline]:
    """Return the headline table of every track."""
    return [_headline(run, track) for track in run.design.suite.tracks]


def _headline(run: Run, track: str) -> Headline:
    """Return the headline table of a track."""
    kind, report, measure = kind_of(track), kind_of(track).report(), main_measure(run, track)
    columns = shown_columns(run, track)
    headings = tuple(column.heading for column in columns)
    values, floors = headline_of(run, track), headline_floors(run, track)
    ranks, lacking = rank_texts(run, track), shortfalls(run, track)
    order = dict.fromkeys((*main_values(run, track, ranked=True), *run.design.model_names))
    rows = []
    for name in sorted(order, key=lambda name: name in run.design.baselines):
        of_model = urlencode({"model": name})
        cells = []
        for column in columns:
            value = values.get((name, column.heading))
            query = f"{samples_query(run, track, column.cell)}&{of_model}"
            if value is None or math.isnan(value.value):
                cells.append(Cell(NO_VALUE, query=query))
                continue
            below: tuple[str, ...] = ()
            if column is columns[0] and not math.isnan(value.lo):
                below = (f"{number(value.lo)} to {number(value.hi)}",)
            cells.append(Cell(number(value.value), value.value, below, query))
        strip, first = None, values.get((name, headings[0]))
        if first and not math.isnan(first.value) and measure.is_share:
            strip = (first.value, first.value, first.value)
            strip = strip if math.isnan(first.lo) else (first.value, first.lo, first.hi)
        of_kind: Any = "baseline" if name in run.design.baselines else "model"
        query = f"{urlencode({'track': track})}&{of_model}"
        told = ranks.get(name, ""), lacking.get(name, "")
        rows.append(Row(name, of_kind, tuple(cells), strip, *told, query))
    # Floors that are baselines have rows already.
    names = dict.fromkeys(floor.name for floor in floors.values())
    if not names.keys() <= {row.name for row in rows}:
        known = [floors.get(heading) for heading in headings]
        plain = [Cell(number(one.value), one.value) if one else Cell("") for one in known]
        rows.append(Row(f"Floor: {', '.join(names)}", "reference", tuple(plain)))
    seeds = len(run.design.suite.seeds)
    notes = [
        *report.notes(run),
        *([_RANKS] if ranks else []),
        *([_INTERVAL] if any(row.cells[0].below for row in rows) else []),
        *([f"Values pool {seeds} seeds."] if seeds > 1 else []),
    ]
    title = captioned(kind.title, (*report.showing(run), *run.varied_words))
    return Headline(track, title, headings, tuple(rows), (" ".join(notes),), measure.is_share)


def rank_texts(run: Run, track: str) -> dict[str, str]:
    """Return the place that each model may have by its main value; {} where there are not two."""
    models = [name for name in main_values(run, track) if name not in run.design.baselines]
    if len(models) < 2:
        return {}
    rows = compare_models(run, models, track).ranks.to_dict("records")
    return {str(row["model"]): rank_text(row) for row in rows}


def samples_query(run: Run, track: str, cell: str) -> str:
    """Return the samples of a cell, in the words of the page's address."""
    parts, chosen = kind_of(track).report().part_names, {"track": track}
    if cell in parts or cell in _part_groups(run, track):
        chosen["subtask"] = cell
    elif cell.isdigit() and int(cell) in run.design.suite.levels:
        chosen["level"] = cell
    return urlencode(chosen)


def _part_groups(run: Run, track: str) -> dict[str, dict[str, Any]]:
    """Return the cells that are means of parts of a track: their headings and these parts."""
    report = kind_of(track).report()
    return {
        cell.name: {"title": cell.heading, "of": list(cell.of)}
        for cell in report.cells(run)
        if cell.of and all(name in report.part_names for name in cell.of)
    }


def cautions(run: Run) -> tuple[str, ...]:
    """Return what a reader must know before any number, the gravest first; () for a whole run."""
    table, stopped, told = coverage_frame(run), read_stopped(run.path), []
    expected, recorded = int(table["expected"].sum()), int(table["recorded"].sum())
    if recorded < expected:
        told.append(
            f"This run is not finished: {recorded:,} of {expected:,} samples have a record."
        )
    tracks = run.design.suite.tracks
    lacking = [
        f"{model}{f', {kind_of(track).title}' if len(tracks) > 1 else ''}: {said}."
        for track in tracks
        for model, said in shortfalls(run, track).items()
    ]
    told += lacking[:_MOST_NAMED]
    if (rest := len(lacking) - _MOST_NAMED) > 0:
        told.append(f"And {rest} more lack replies: see the table of coverage.")
    if stopped.run:
        told.append(f"The last session was stopped: {_short(stopped.run)}.")
    if run.is_cut:
        told.append("The last line of records.jsonl was cut off and is ignored.")
    limit, items = run.manifest.limit, run.design.items
    if cut := [name for name in tracks if limit and items.get(name, 0) >= limit]:
        asked = [(items[name], kind_of(name)) for name in cut]
        counts = ", ".join(f"{n:,} {kind.item}s of {kind.title}" for n, kind in asked)
        told.append(f"A limit was set: {counts} were asked about, not all of the suite.")
    return tuple(told)


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
        reasons.setdefault(str(row["model"]), Counter())[_short(message)] += 1
    found = {}
    for row in table[table["track"] == track].to_dict("records"):
        model, answered = str(row["model"]), row["recorded"] - sum(row[n] for n in WITHOUT_REPLY)
        if answered < row["expected"]:
            why = [_short(stopped[model])] if model in stopped else []
            why = why or [reason for reason, _ in reasons.get(model, Counter()).most_common(1)]
            found[model] = ": ".join([f"{answered:,} of {row['expected']:,} answered", *why])
    return found


def _short(message: str) -> str:
    """Return a message in one short line, without the stop at its end."""
    text = " ".join(message.split()).rstrip(".")
    return text if len(text) <= _MOST_CHARACTERS else f"{text[:_MOST_CHARACTERS].rstrip()} …"


def write_report(written: TablesWritten, data: Path | None = None) -> Path:
    """Write `report.html` and `report/` of a run whose tables were written; return the page.

    The page draws goals, candidates and assemblies from the scenes: `data` is where the data set is
    now, if it has moved; where it cannot be read, the page says so and shows the rest. Pictures
    that were sent lie beside the page as far as the picture cache has them. Raises DataError for a
    `data` that is not what the run was made on, StoreError where the folder cannot be written or
    something is in the way that phyblock never wrote.
    """
    run = written.run
    sources = open_sources(run, data)
    out = OutFolder(run.path)
    out.check(page_files())
    with out.alone(), writing(run.path / REPORT_FILE):
        paths = [run.path / name for name in (MANIFEST, RECORDS, PROMPTS, STOPPED)]
        build = build_of(sources.lacking, [digest_of_file(p) for p in paths if p.exists()])
        own = f"{_FOLDER}/{build}/"
        out.claim([REPORT_FILE])
        with out.making(own) as new:
            _write_data(run, sources, out, new, build)
            page = _page(written, build)
        (path,) = out.write({REPORT_FILE: page})
        # A page of an earlier build that is still open says that it was written again.
        lasting = (own, _PICTURES)
        out.remove(name for name in out.names(f"{_FOLDER}/") if not name.startswith(lasting))
    return path


def files_of(*, page: bool) -> tuple[str, ...]:
    """Return what a run folder may get: tables, and with `page` the page as well."""
    return table_files() + (page_files() if page else ())


def page_files() -> tuple[str, ...]:
    """Return the page and the folders beside it, by their names in a run folder."""
    return (REPORT_FILE, f"{_FOLDER}/", _PICTURES)


def report_files(folder: Path) -> dict[str, Path]:
    """Return the report's page and what it loads, by their names below the run folder."""
    below = sorted((folder / _FOLDER).rglob("*"))
    found = [folder / REPORT_FILE, *(path for path in below if path.is_file())]
    return {path.relative_to(folder).as_posix(): path for path in found if not path.is_symlink()}


def _write_data(run: Run, sources: Sources, out: OutFolder, new: Path, build: str) -> None:
    """Write the scripts and the pictures."""
    packs = {kind: Pack(new, kind, build) for kind in ("records", "scenes", "questions", "prompts")}
    places, tracks = places_of(run), run.design.suite.tracks
    asked = items_shown(run.path, places, sources.items)
    pictures: dict[str, str] = {}
    if has_pictures(run, places):
        with out.making(_PICTURES) as folder:
            kept = keep_pictures(run, sources, asked, places, folder, out.path / _PICTURES)
        pictures = {digest: f"{_PICTURES}{name}" for digest, name in kept.items()}
    index = SampleIndex(run.design)
    pack_samples(run.path, places, index, packs["records"], packs["prompts"], pictures)
    pack_scenes(index.scenes if sources.tasks else (), [sources], packs["scenes"])
    questions = {
        item: packs["questions"].add(question_entry(shown.question))
        for item, shown in asked.items()
    }
    for pack in packs.values():
        pack.close()
    names: dict[str, str] = {}
    groups: dict[str, dict[str, Any]] = {}
    for track in tracks:
        names |= kind_of(track).report().part_names
        groups |= _part_groups(run, track)
    content: dict[str, Any] = {
        **index.columns(questions),
        "model_kinds": {model.name: model.kind for model in run.manifest.models},
        "starts": {kind: pack.starts for kind, pack in packs.items()},
        "kit": kit(),
        "no_scenes": sources.lacking,
        "subtask_names": names,
        "subtask_groups": groups,
        "cautions": cautions(run),
        "shortfalls": {track: shortfalls(run, track) for track in tracks},
    }
    write_script(new, "index", build, content)
    write_three(new)


def _page(written: TablesWritten, build: str) -> str:
    """Return the HTML of the report; every text is escaped, and only our own scripts may run."""
    run = written.run
    manifest, design, coverage = run.manifest, run.design, coverage_frame(run)
    answered = int(coverage["recorded"].sum() - coverage[list(WITHOUT_REPLY)].sum().sum())
    expected = int(coverage["expected"].sum())
    facts = {
        "Data": manifest.dataset.name if manifest.dataset else "",
        "Scenes": f"{design.scenes:,}",
        "Models": f"{len(design.model_names)}",
        "Seeds": f"{len(design.suite.seeds)}",
        "Samples": f"{answered:,}" if answered == expected else f"{answered:,} of {expected:,}",
        "Made": manifest.created[:10],
        "phyblock": manifest.versions.get("phyblock"),
        "Run": manifest.identity[:12],
    }
    about = design.suite.description
    spans = partial(groupby, key=lambda column: column.group)
    return fill(
        "report.html.j2",
        _SCRIPTS,
        _STYLES,
        title=design.suite.name or run.path.name,
        # A suite that was cut short still speaks of all that is in it.
        about=f"The whole suite: {about}" if manifest.limit and about else about,
        facts=[(name, text) for name, text in facts.items() if text],
        cautions=cautions(run),
        models=frozenset(design.model_names),
        headlines=headlines(run),
        tables=[
            (table.view, [(name, len([*columns])) for name, columns in spans(table.view.columns)])
            for name, table in written.tables.items()
            if name not in _NOT_SHOWN
        ],
        folder=f"{_FOLDER}/{build}",
        build=build,
    )
