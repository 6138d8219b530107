"""The report of a run: a page that opens from disk, and a folder of data beside it."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Any

from phyblock.files import OutFolder, digest_of_file
from phyblock.records.files import MANIFEST, PROMPTS, RECORDS, STOPPED, read_stopped
from phyblock.results.tables import TablesWritten, coverage_frame, table_files
from phyblock.results.text import REPORT_FILE
from phyblock.tracks.base import kind_of
from phyblock.types import WITHOUT_REPLY
from phyblock.web.board import (
    SiteRun,
    board_of,
    entries_of,
    open_sources,
    short,
    shortfalls,
)
from phyblock.web.pack import PICTURES, SentPictures, build_of, pack_samples, write_page

_FOLDER = "report/"
_PAGE = (REPORT_FILE, _FOLDER, PICTURES)
"""The page and the folders beside it in a run folder."""
_FAILURES = 6


def write_report(written: TablesWritten, data: Path | None = None) -> Path:
    """Write `report.html` and `report/` of a run whose tables were written; return the page.

    The page draws goals, candidates and assemblies from the scenes: `data` is the data set's new
    place, if it has moved; if it cannot be read, the page says so and shows the rest. Sent pictures
    are put beside the page if the picture cache has them. Raises DataError for `data` other than
    the run's, StoreError if the folder cannot be written or holds a file of others.
    """
    run = written.run
    one = SiteRun(str(run.path), run, open_sources(run, data))
    out = OutFolder(run.path)
    out.check(_PAGE)
    paths = [run.path / name for name in (MANIFEST, RECORDS, PROMPTS, STOPPED)]
    build = build_of(one.sources.lacking, [digest_of_file(p) for p in paths if p.exists()])

    def make(new: Path) -> dict[str, Any]:
        entries = entries_of([one])
        with ExitStack() as made:
            sent = None
            if (run.path / PROMPTS).exists():
                folder = made.enter_context(out.making(PICTURES))
                sent = SentPictures(folder, out.path / PICTURES, one.sources)
            pack_samples(new, build, [one], entries, failures=_FAILURES, sent=sent)
        board = {**board_of([one], entries), **_about(written)}
        return {"title": board["title"], "description": board["about"], "image": "", "board": board}

    out.claim([REPORT_FILE])
    return write_page(out, REPORT_FILE, _FOLDER, build, make, lasting=[PICTURES])


def files_of(*, page: bool) -> tuple[str, ...]:
    """Return the files that a run folder may get: tables, and the page if it is wanted."""
    return (*table_files(), *(_PAGE if page else ()))


def report_files(folder: Path) -> dict[str, Path]:
    """Return the report's page and the files it loads, by their names in the run folder."""
    below = sorted((folder / _FOLDER).rglob("*"))
    found = [folder / REPORT_FILE, *(path for path in below if path.is_file())]
    return {path.relative_to(folder).as_posix(): path for path in found if not path.is_symlink()}


def _about(written: TablesWritten) -> dict[str, Any]:
    """Return the content of a page on one run besides its numbers: facts, all its tables, and
    `cautions`, warnings to read before any number, most important first.
    """
    run, manifest, design = written.run, written.run.manifest, written.run.design
    coverage, stopped, cautions = coverage_frame(run), read_stopped(run.path), []
    expected, recorded = int(coverage["expected"].sum()), int(coverage["recorded"].sum())
    if recorded < expected:
        said = f"{recorded:,} of {expected:,} samples have a record"
        cautions.append(f"This run is not finished: {said}.")
    tracks = design.suite.tracks
    cautions += [
        f"{model}{f', {kind_of(track).title}' if len(tracks) > 1 else ''}: {said}."
        for track in tracks
        for model, said in shortfalls(run, track).items()
    ]
    if stopped.run:
        cautions.append(f"The last session was stopped: {short(stopped.run)}.")
    if run.is_cut:
        cautions.append("The last line of records.jsonl was cut off and is ignored.")
    limit, items = manifest.limit, design.items
    if cut := [name for name in tracks if limit and items.get(name, 0) >= limit]:
        counts = ", ".join(
            f"{items[name]:,} {kind_of(name).item}s of {kind_of(name).title}" for name in cut
        )
        cautions.append(f"A limit was set: {counts} were asked about, not all of the suite.")
    answered = recorded - int(coverage[list(WITHOUT_REPLY)].sum().sum())
    facts = {
        "Data": manifest.dataset.name if manifest.dataset else "",
        "Scenes": f"{design.scenes:,}",
        "Models": f"{sum(not model.is_baseline for model in manifest.models)}",
        "Baselines": str(sum(model.is_baseline for model in manifest.models) or ""),
        "Seeds": f"{len(design.suite.seeds)}",
        "Samples": f"{answered:,}" if answered == expected else f"{answered:,} of {expected:,}",
        "Made": manifest.created[:10],
        "phyblock": manifest.versions.get("phyblock") or "",
        "Run": manifest.identity[:12],
    }
    about = design.suite.description
    return {
        "title": design.suite.name or run.path.name,
        # The description of a limited suite is still about the whole suite.
        "about": f"The whole suite: {about}" if manifest.limit and about else about,
        "facts": [(name, text) for name, text in facts.items() if text],
        "cautions": cautions,
        "tables": [table.plain() for table in written.tables.values()],
    }
