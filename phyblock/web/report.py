"""The report of a run: a page that opens from disk, and a folder of data beside it."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Any

from phyblock.files import OutFolder, digest_of_file
from phyblock.records.files import MANIFEST, PROMPTS, RECORDS, STOPPED, read_stopped
from phyblock.results.load import Run
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


def cautions(run: Run) -> tuple[str, ...]:
    """Return warnings to read before any number, most important first; () for a complete run."""
    table, stopped, sentences = coverage_frame(run), read_stopped(run.path), []
    expected, recorded = int(table["expected"].sum()), int(table["recorded"].sum())
    if recorded < expected:
        sentences.append(
            f"This run is not finished: {recorded:,} of {expected:,} samples have a record."
        )
    tracks = run.design.suite.tracks
    sentences += [
        f"{model}{f', {kind_of(track).title}' if len(tracks) > 1 else ''}: {said}."
        for track in tracks
        for model, said in shortfalls(run, track).items()
    ]
    if stopped.run:
        sentences.append(f"The last session was stopped: {short(stopped.run)}.")
    if run.is_cut:
        sentences.append("The last line of records.jsonl was cut off and is ignored.")
    limit, items = run.manifest.limit, run.design.items
    if cut := [name for name in tracks if limit and items.get(name, 0) >= limit]:
        asked = [(items[name], kind_of(name)) for name in cut]
        counts = ", ".join(f"{n:,} {kind.item}s of {kind.title}" for n, kind in asked)
        sentences.append(f"A limit was set: {counts} were asked about, not all of the suite.")
    return tuple(sentences)


def write_report(written: TablesWritten, data: Path | None = None) -> Path:
    """Write `report.html` and `report/` of a run whose tables were written; return the page.

    The page draws goals, candidates and assemblies from the scenes: `data` is the new place of the
    data set, if it has moved; if it cannot be read, the page says so and shows the rest. Sent
    pictures are put beside the page if the picture cache has them. Raises DataError for `data`
    other than the run's, StoreError if the folder cannot be written or a file of others would be
    overwritten.
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
    """Return the content of a page on one run besides its numbers: facts, and all its tables."""
    run = written.run
    manifest, design, coverage = run.manifest, run.design, coverage_frame(run)
    answered = int(coverage["recorded"].sum() - coverage[list(WITHOUT_REPLY)].sum().sum())
    expected = int(coverage["expected"].sum())
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
        "cautions": cautions(run),
        "tables": [table.plain() for table in written.tables.values()],
    }
