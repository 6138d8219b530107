"""The report of a run: a page that opens from disk, and a folder of data beside it."""

from __future__ import annotations

from contextlib import ExitStack
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any

from phyblock.files import OutFolder, digest_of_file, writing
from phyblock.records.files import PROMPTS, RECORDS, STOPPED, read_stopped
from phyblock.records.manifest import MANIFEST
from phyblock.results.load import Run
from phyblock.results.tables import TablesWritten, coverage_frame, table_files
from phyblock.tracks.base import kind_of
from phyblock.types import WITHOUT_REPLY
from phyblock.web.board import (
    Failures,
    SiteRun,
    all_values,
    board_of,
    entries_of,
    short,
    shortfalls,
    telling,
)
from phyblock.web.pack import (
    PICTURES,
    Pack,
    SampleIndex,
    SentPictures,
    Sources,
    build_of,
    fill,
    kit,
    open_sources,
    pack_samples,
    pack_scenes,
    places_of,
    write_script,
    write_three,
)

_SCRIPTS = (
    *("dom.js", "chunks.js", "data.js", "solid.js", "filters.js", "search.js", "list.js"),
    *("steps.js", "poses.js", "runs.js", "stage.js", "markdown.js", "quotes.js", "overlay.js"),
    *("why.js", "reply.js", "sent.js", "detail.js", "tracks.js", "matrix.js", "table.js"),
    *("address.js", "ranking.js", "results.js", "app.js"),
)
_STYLES = (
    *("base.css", "site.css", "ranking.css", "results.css", "samples.css", "reply.css"),
    *("matrix.css", "print.css"),
)
REPORT_FILE = "report.html"
_FOLDER = "report"
_FAILURES = 6
_MOST_NAMED = 6


def _part_groups(run: Run, track: str) -> dict[str, dict[str, Any]]:
    """Return the cells that are means of parts of a track: their headings and these parts."""
    report = kind_of(track).report()
    return {
        cell.name: {"title": cell.heading, "of": list(cell.of)}
        for cell in run.cells(track)
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
        told.append(f"The last session was stopped: {short(stopped.run)}.")
    if run.is_cut:
        told.append("The last line of records.jsonl was cut off and is ignored.")
    limit, items = run.manifest.limit, run.design.items
    if cut := [name for name in tracks if limit and items.get(name, 0) >= limit]:
        asked = [(items[name], kind_of(name)) for name in cut]
        counts = ", ".join(f"{n:,} {kind.item}s of {kind.title}" for n, kind in asked)
        told.append(f"A limit was set: {counts} were asked about, not all of the suite.")
    return tuple(told)


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
            page = _page(written, sources, build)
        (path,) = out.write({REPORT_FILE: page})
        # A page of an earlier build that is still open says that it was written again.
        lasting = (own, PICTURES)
        out.remove(name for name in out.names(f"{_FOLDER}/") if not name.startswith(lasting))
    return path


def files_of(*, page: bool) -> tuple[str, ...]:
    """Return what a run folder may get: tables, and with `page` the page as well."""
    return table_files() + (page_files() if page else ())


def page_files() -> tuple[str, ...]:
    """Return the page and the folders beside it, by their names in a run folder."""
    return (REPORT_FILE, f"{_FOLDER}/", PICTURES)


def report_files(folder: Path) -> dict[str, Path]:
    """Return the report's page and what it loads, by their names below the run folder."""
    below = sorted((folder / _FOLDER).rglob("*"))
    found = [folder / REPORT_FILE, *(path for path in below if path.is_file())]
    return {path.relative_to(folder).as_posix(): path for path in found if not path.is_symlink()}


def _write_data(run: Run, sources: Sources, out: OutFolder, new: Path, build: str) -> None:
    """Write the scripts and the pictures."""
    packs = {kind: Pack(new, kind, build) for kind in ("records", "scenes", "questions", "prompts")}
    places, tracks = places_of(run), run.design.suite.tracks
    index, failures = SampleIndex(run.design), Failures(run, frozenset(sources.tasks))
    with ExitStack() as made:
        sent = None
        if (run.path / PROMPTS).exists():
            folder = made.enter_context(out.making(PICTURES))
            sent = SentPictures(folder, out.path / PICTURES, sources)
        picture = sent.name if sent else lambda _: None
        pack_samples(run.path, places, index, packs, sources, picture, failures.see)
    pack_scenes(index.scenes if sources.tasks else (), [sources], packs["scenes"])
    for pack in packs.values():
        pack.close()
    names: dict[str, str] = {}
    groups: dict[str, dict[str, Any]] = {}
    for track in tracks:
        names |= kind_of(track).report().part_names
        groups |= _part_groups(run, track)
    content: dict[str, Any] = {
        **index.columns(),
        "telling": telling([failures], _FAILURES),
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


def _page(written: TablesWritten, sources: Sources, build: str) -> str:
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
    one = (SiteRun(str(run.path), run, sources),)
    parts = [
        name
        for track in design.suite.tracks
        for name in (*kind_of(track).report().part_names, *_part_groups(run, track))
    ]
    board = {**board_of(one, entries_of(one), all_values(one)), "parts": parts}
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
        board=board,
        tables=[
            (table.view, [(name, len([*columns])) for name, columns in spans(table.view.columns)])
            for table in written.tables.values()
        ],
        folder=f"{_FOLDER}/{build}",
        build=build,
    )
