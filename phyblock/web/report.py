"""The report of a run: a page that opens from disk, and a folder of data beside it."""

from __future__ import annotations

import contextlib
import hashlib
import json
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from itertools import groupby
from pathlib import Path
from typing import Any, Literal
from urllib.parse import urlencode

import pandas as pd

from phyblock.data import AssemblyTask
from phyblock.files import OutFolder, writing
from phyblock.records.files import PROMPTS, RECORDS, STOPPED, read_stopped
from phyblock.records.manifest import MANIFEST
from phyblock.results.compare import compare_models
from phyblock.results.design import WITHOUT_REPLY
from phyblock.results.estimates import (
    Floor,
    Value,
    blind_baselines,
    headline_columns,
    headline_floors,
    headline_of,
    main_column,
    main_measure,
    track_measures,
)
from phyblock.results.figures import figure_files, figure_titles, write_figures
from phyblock.results.load import Run
from phyblock.results.tables import TablesWritten, coverage_frame, table_files
from phyblock.results.text import NO_VALUE, captioned, number, spread
from phyblock.run.store import run_folder
from phyblock.tracks.base import kind_of
from phyblock.tracks.items import in_order
from phyblock.tracks.measures import Better, HeadlineColumn
from phyblock.tracks.pictures import kit, picture_style, scene_entry
from phyblock.web.pack import (
    Item,
    Pack,
    PictureShelf,
    Place,
    SampleIndex,
    Sources,
    fill,
    images_of,
    items_shown,
    open_sources,
    pack_prompts,
    pack_samples,
    pictures_sent,
    read_places,
    states_sent,
    write_script,
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
_LAYOUT = 5
"""Version of the scripts' folder; those of the first were not listed as ours."""
_NOT_SHOWN = ("table1",)
"""Tables that a headline table replaces."""
_MOST_NAMED = 6
_MOST_CHARACTERS = 160
_NOT_BETTER = "†"
_BELOW = "Below each value stands its 95 % interval, from leaving out each base scene in turn."
_SEEDS = (
    "Values pool {} seeds; mean ± standard deviation over single seeds stands below the main one."
)
_RANKS = (
    "Rank: the places that a model may have, by paired tests of all models with Holm's correction."
)
_FLOOR = (
    "The floor is the best that is reached without seeing the goal; "
    f"{_NOT_BETTER} marks intervals that are not wholly better than it."
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
    """A headline table: `columns` head the cells, `references` are marked in every strip.

    The first column is what models are ranked by. Where it `has_strips`, as a share has, they draw
    it from 0 to 100 %.
    """

    track: str
    title: str
    columns: tuple[str, ...]
    rows: tuple[Row, ...]
    notes: tuple[str, ...]
    has_strips: bool
    references: Mapping[str, float]

    @property
    def ranked(self) -> bool:
        """True if there are ranks at all."""
        return any(row.rank for row in self.rows)


def headlines(run: Run) -> list[Headline]:
    """Return the headline table of every track: models by the main value, baselines, references."""
    return [_headline(run, track) for track in run.design.suite.tracks]


def _headline(run: Run, track: str) -> Headline:
    kind, report = kind_of(track), kind_of(track).report()
    main = main_column(run, track).heading
    columns = sorted(headline_columns(run, track), key=lambda column: column.heading != main)
    floors, references = headline_floors(run, track), report.references(run)
    published = report.published(run)
    rows = _model_rows(run, track, columns, floors, published)
    scales: dict[str, Mapping[str, float]] = {}
    if floors:
        names = ", ".join(dict.fromkeys(floor.name for floor in floors.values()))
        scales[f"Floor: {names}"] = {heading: floor.value for heading, floor in floors.items()}
    for name, numbers in {**scales, **references}.items():
        cells = [_plain(numbers.get(column.heading)) for column in columns]
        rows.append(Row(name, "reference", (*cells, *([Cell("")] if published else []))))
    seeds = len(run.design.suite.seeds)
    notes = [
        *report.notes(run),
        *([report.reference_note] if report.reference_note else []),
        *([_RANKS] if any(row.rank for row in rows) else []),
        *([_SEEDS.format(seeds)] if seeds > 1 else []),
        *([_FLOOR] if floors else []),
        *([_BELOW] if any(cell.below for row in rows for cell in row.cells) else []),
    ]
    return Headline(
        track,
        captioned(kind.title, (*report.showing(run), *run.varied_words)),
        (*(column.heading for column in columns), *(["Published"] if published else [])),
        tuple(rows),
        (" ".join(notes),),
        main_measure(run, track).is_share,
        {
            name.partition(" ")[0].rstrip(","): numbers[main]
            for name, numbers in references.items()
            if main in numbers
        },
    )


def _model_rows(
    run: Run,
    track: str,
    columns: Sequence[HeadlineColumn],
    floors: Mapping[str, Floor],
    published: Mapping[str, float],
) -> list[Row]:
    """Models, then baselines, the best first; the first column is the main one."""
    values, measures = headline_of(run, track), {one.name: one for one in track_measures(track)}
    better = [measures[column.measure].better for column in columns]
    queries = [samples_query(run, track, column.cell) for column in columns]
    own_floors = blind_baselines(run, track)
    ranks, lacking = rank_texts(run, track), shortfalls(run, track)
    rules = {model.name for model in run.manifest.models if model.is_baseline}
    rows = []
    for name in run.design.model_names:
        of_model = urlencode({"model": name})
        found = [values.get((name, column.heading)) for column in columns]
        cells = []
        for place, (column, value) in enumerate(zip(columns, found, strict=True)):
            floor = None if name in own_floors else floors.get(column.heading)
            query = f"{queries[place]}&{of_model}"
            cells.append(_cell(value, floor, better[place], query, seeds=not place))
        if published:
            cells.append(_plain(published.get(name), NO_VALUE))
        strip, main = None, found[0]
        if main and not math.isnan(main.value) and measures[columns[0].measure].is_share:
            ends = (main.value, main.value) if math.isnan(main.lo) else (main.lo, main.hi)
            strip = (main.value, *ends)
        query = f"{urlencode({'track': track})}&{of_model}"
        kind: Literal["model", "baseline"] = "baseline" if name in rules else "model"
        told = ranks.get(name, ""), lacking.get(name, "")
        rows.append(Row(name, kind, tuple(cells), strip, *told, query))

    def place_of(row: Row) -> tuple[bool, bool, float]:
        value = row.cells[0].value
        number = value or 0.0
        return row.kind != "model", value is None, number if better[0] == "lower" else -number

    return sorted(rows, key=place_of)


def _cell(
    value: Value | None, floor: Floor | None, better: Better, query: str, *, seeds: bool
) -> Cell:
    if value is None or math.isnan(value.value):
        return Cell(NO_VALUE, query=query)
    below = [] if math.isnan(value.lo) else [f"{number(value.lo)} to {number(value.hi)}"]
    if below and floor is not None and not floor.is_below(value, better):
        below[0] += f" {_NOT_BETTER}"
    if seeds and not math.isnan(value.sd):
        below.append(f"seeds {spread(value.mean, value.sd)}")
    return Cell(number(value.value), value.value, tuple(below), query)


def _plain(value: float | None, blank: str = "") -> Cell:
    """Return a number with nothing under it."""
    return Cell(blank) if value is None else Cell(number(value), value)


def rank_texts(run: Run, track: str) -> dict[str, str]:
    """Return the place that each model may have by its main value; {} where there are not two."""
    main, values = main_column(run, track).heading, headline_of(run, track)
    models = [
        model.name
        for model in run.manifest.models
        if not model.is_baseline
        and (value := values.get((model.name, main)))
        and not math.isnan(value.value)
    ]
    if len(models) < 2:
        return {}
    rows = compare_models(run, models, track).ranks.to_dict("records")
    return {
        str(row["model"]): " to ".join(str(n) for n in sorted({row["best"], row["worst"]}))
        for row in rows
    }


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
    table, stopped = coverage_frame(run), read_stopped(run.path)
    expected, recorded = int(table["expected"].sum()), int(table["recorded"].sum())
    told = [*_unanswered(run, table, stopped.models)]
    if recorded < expected:
        text = f"This run is not finished: {recorded:,} of {expected:,} samples have a record."
        told.insert(0, text)
    if stopped.run:
        told.append(f"The last session was stopped: {_short(stopped.run)}.")
    if run.is_cut:
        told.append("The last line of records.jsonl was cut off and is ignored.")
    limit, items = run.manifest.limit, run.design.items
    if cut := [name for name in run.design.suite.tracks if limit and items.get(name, 0) >= limit]:
        kinds = [(items[name], kind_of(name)) for name in cut]
        counts = ", ".join(f"{n:,} {kind.item}s of {kind.title}" for n, kind in kinds)
        told.append(f"A limit was set: {counts} were asked about, not all of the suite.")
    return tuple(told)


def _unanswered(run: Run, table: pd.DataFrame, stopped: Mapping[str, str]) -> Iterator[str]:
    """Yield sentences on models that lack replies: those without any first."""
    found: list[tuple[float, str]] = []
    reasons = _reasons(run)
    counted = "left out of its values" if run.design.outcomes_left_out else "counted as wrong"
    for model, rows in table.groupby("model", sort=False):
        names = ("expected", "api_error", "missing", "not_run")
        expected, failed, missing, not_run = (int(rows[name].sum()) for name in names)
        answered = expected - failed - missing - not_run
        if answered == expected:
            continue
        parts = []
        if model in stopped:
            parts.append(f"stopped ({_short(stopped[str(model)])})")
        if failed:
            many = "the one call" if failed == 1 else f"all {failed:,} calls"
            if answered:
                many = "1 call" if failed == 1 else f"{failed:,} calls"
            reason, times = reasons.get(str(model), ("", failed))
            often = "" if times == failed else f", {times:,} times"
            parts.append(f"{many} failed{f' ({reason}{often})' if reason else ''}")
        if missing:
            parts.append(f"{missing:,} of {expected:,} replies are missing, {counted}")
        if not_run:
            parts.append(f"{not_run:,} of {expected:,} samples were not asked")
        found.append((answered / expected, f"{model}: {'; '.join(parts)}."))
    texts = [text for _, text in sorted(found, key=lambda one: one[0])]
    yield from texts[:_MOST_NAMED]
    if (rest := len(texts) - _MOST_NAMED) > 0:
        yield f"And {rest} more models lack replies: see the table of coverage."


def shortfalls(run: Run, track: str) -> Mapping[str, str]:
    """Return by model that lacks replies in a track how many it has, and why it has no more."""
    table, reasons = coverage_frame(run), _reasons(run, track)
    stopped = read_stopped(run.path).models
    found = {}
    for row in table[table["track"] == track].to_dict("records"):
        answered = row["recorded"] - sum(row[name] for name in WITHOUT_REPLY)
        if answered < row["expected"]:
            model = str(row["model"])
            why = _short(stopped[model]) if model in stopped else reasons.get(model, ("",))[0]
            text = f"{answered:,} of {row['expected']:,} answered"
            found[model] = f"{text}: {why}" if why else text
    return found


def _reasons(run: Run, track: str = "") -> Mapping[str, tuple[str, int]]:
    """Return by model the most frequent reason of failed calls, and how often it was given."""
    rows = run.records.dropna(subset=["error_kind"])
    rows = rows[rows["track"] == track] if track else rows
    counted: dict[str, Counter[str]] = {}
    for row in rows[["model", "error_kind", "error_status", "error_message"]].to_dict("records"):
        status = row["error_status"]
        message = " ".join(str(row["error_message"] or row["error_kind"]).split())
        if not pd.isna(status) and str(status) not in message:
            message = f"HTTP {status}: {message}"
        counted.setdefault(str(row["model"]), Counter())[_short(message)] += 1
    return {model: reasons.most_common(1)[0] for model, reasons in counted.items()}


def _short(message: str) -> str:
    """Return a message in one short line, without the stop at its end."""
    text = " ".join(message.split()).rstrip(".")
    return text if len(text) <= _MOST_CHARACTERS else f"{text[:_MOST_CHARACTERS].rstrip()} …"


@dataclass(frozen=True)
class PageWritten:
    """The page, all `files` of it and of figures, and the `pictures` that were sent, beside it.

    `is_whole` says that nothing was lacking that a later writing might find.
    """

    path: Path
    files: tuple[Path, ...]
    pictures: tuple[Path, ...]
    is_whole: bool


def write_report(written: TablesWritten, data: Path | None = None, *, figures: bool = True) -> Path:
    """Write figures and page as `write_page` does, and return the page's path."""
    return write_page(written, data, figures=figures).path


def write_page(
    written: TablesWritten, data: Path | None = None, *, figures: bool = True
) -> PageWritten:
    """Write figures, `report.html` and `report/` of a run whose tables were written.

    The page draws goals, candidates and assemblies from the scenes: `data` is where the data set is
    now, if it has moved; where it cannot be read, the page says so and shows the rest. Pictures
    that were sent lie beside the page as far as the picture cache has them. Raises DataError for a
    `data` that is not what the run was made on, StoreError where the folder cannot be written or
    something is in the way that phyblock never wrote.
    """
    run = written.run
    sources = open_sources(run, data)
    out = run_folder(run.path)
    out.check(page_files())
    with out.alone(), writing(run.path / REPORT_FILE):
        drawn = write_figures(run) if figures else ()
        build = _build(run, sources)
        own = f"{_FOLDER}/{build}/"
        out.claim([REPORT_FILE])
        with out.making(own) as new:
            pictures, is_whole = _write_data(run, sources, out, new, build)
            scripts = [run.path / own / script.name for script in new.iterdir()]
            page = _page(written, drawn, build)
        (path,) = out.write({REPORT_FILE: page})
        # A page of an earlier build that is still open says that it was written again.
        lasting = (own, _PICTURES)
        out.remove(name for name in out.names(f"{_FOLDER}/") if not name.startswith(lasting))
    kept = tuple(run.path / address for address in pictures.values())
    return PageWritten(path, (*drawn, *scripts, path), kept, is_whole and not sources.lacking)


def files_of(*, page: bool) -> tuple[str, ...]:
    """Return what a run folder may get: tables, and with `page` figures and the page as well."""
    return table_files() + (figure_files() + page_files() if page else ())


def page_files() -> tuple[str, ...]:
    """Return the page and the folders beside it, by their names in a run folder."""
    return (REPORT_FILE, f"{_FOLDER}/", _PICTURES)


def _build(run: Run, sources: Sources) -> str:
    """Return a name for what the page shows: the same run, written again, has the same files."""
    digest = hashlib.sha256(f"{_LAYOUT} {version('phyblock')} {sources.lacking}".encode())
    for name in (MANIFEST, RECORDS, PROMPTS, STOPPED):
        with contextlib.suppress(FileNotFoundError), (run.path / name).open("rb") as file:
            while chunk := file.read(2**20):
                digest.update(chunk)
    return digest.hexdigest()[:12]


def _write_data(
    run: Run, sources: Sources, out: OutFolder, new: Path, build: str
) -> tuple[dict[str, str], bool]:
    """Write the scripts; return the pictures as `_keep_pictures` does."""
    kinds = ("records", "scenes", "questions", "prompts")
    packs = {kind: Pack(new, kind, build) for kind in kinds}
    places = read_places(run.path, run.design)
    asked = items_shown(run.path, places, sources.items)
    pictures: dict[str, str] = {}
    is_whole = True
    if pictures_sent(run.path, places):
        pictures, is_whole = _keep_pictures(run, sources, asked, places, out)
    prompts = pack_prompts(run.path, packs["prompts"])
    index = SampleIndex(run.design)
    pack_samples(run.path, places, index, packs["records"], prompts, pictures)
    for scene in index.scenes if sources.tasks else ():
        task = sources.tasks.get(scene)
        packs["scenes"].add(task and scene_entry(task.scene, task.candidates))
    questions = {
        item: packs["questions"].add(dict(sources.items[item.track].entry(shown)))
        for item, shown in asked.items()
    }
    for pack in packs.values():
        pack.close()
    names: dict[str, str] = {}
    groups: dict[str, dict[str, Any]] = {}
    for track in run.design.suite.tracks:
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
        "shortfalls": {track: shortfalls(run, track) for track in run.design.suite.tracks},
    }
    write_script(new, "index", build, content)
    return pictures, is_whole


def _keep_pictures(
    run: Run,
    sources: Sources,
    asked: Mapping[Item, Any],
    places: Sequence[Place],
    out: OutFolder,
) -> tuple[dict[str, str], bool]:
    """Return addresses of the pictures at hand, from the page, by digest; and if all are."""
    with out.making(_PICTURES) as new:
        shelf = PictureShelf(new, out.path / _PICTURES)
        for images in images_of(run):
            style = picture_style(images)
            if sources.tasks:
                shelf.add_scenes(_scenes(run, sources.tasks), images)
                shelf.add_kept(states_sent(run.path, places, sources.tasks, style))
            for track, items in sources.items.items():
                shown = [one for item, one in asked.items() if item.track == track]
                shelf.add_items(items, shown, style)
    return {digest: f"{_PICTURES}{name}" for digest, name in shelf.names.items()}, shelf.is_whole


def _scenes(run: Run, tasks: Mapping[str, AssemblyTask]) -> Iterator[AssemblyTask]:
    """Yield scenes that were asked about as such, in every form in which they were shown: their
    names are those of the items.
    """
    asked = run.records[run.records["item"] == run.records["scene"]]
    forms = asked["shown"].map(json.dumps)
    for scene, form in dict.fromkeys(zip(asked["scene"], forms, strict=True)):
        task, shown = tasks.get(scene), json.loads(form)
        if task is not None and shown:
            yield in_order(task, shown["order"], tasks.get(shown["goal"]))
        elif task is not None:
            yield task


def _page(written: TablesWritten, figures: Sequence[Path], build: str) -> str:
    """Return the HTML of the report; every text is escaped, and only our own scripts may run."""
    run, titles = written.run, figure_titles(written.run)
    manifest, design, table = run.manifest, run.design, coverage_frame(run)
    answered = int(table["recorded"].sum() - table[list(WITHOUT_REPLY)].sum().sum())
    expected = int(table["expected"].sum())
    done = f"{answered:,}" if answered == expected else f"{answered:,} of {expected:,}"
    facts = {
        "Data": manifest.dataset.name if manifest.dataset else "",
        "Scenes": f"{design.scenes:,}",
        "Models": f"{len(design.model_names)}",
        "Seeds": f"{len(design.suite.seeds)}",
        "Samples": done,
        "Made": manifest.created[:10],
        "phyblock": manifest.versions.get("phyblock"),
        "Run": manifest.identity[:12],
    }
    # A suite that was cut short still speaks of all that is in it.
    about = f"The whole suite: {design.suite.description}" if manifest.limit else ""
    spans = partial(groupby, key=lambda column: column.group)
    return fill(
        "report.html.j2",
        _SCRIPTS,
        _STYLES,
        title=design.suite.name or run.path.name,
        about=about if design.suite.description and about else design.suite.description,
        facts=[(name, text) for name, text in facts.items() if text],
        cautions=cautions(run),
        models=frozenset(design.model_names),
        headlines=headlines(run),
        figures=[
            (f"{path.parent.name}/{path.name}", titles.get(path.stem, path.stem))
            for path in figures
            if path.suffix == ".svg"
        ],
        tables=[
            (view, [(name, len([*columns])) for name, columns in spans(view.columns)])
            for name, view in written.views.items()
            if name not in _NOT_SHOWN
        ],
        folder=f"{_FOLDER}/{build}",
        build=build,
    )
