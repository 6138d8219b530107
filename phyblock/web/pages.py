"""The report of a run and the leaderboard of several: pages that open from disk, with data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from phyblock.bundle import opened_bundle
from phyblock.config.yaml import shown
from phyblock.errors import DataError, Problem, SpecError
from phyblock.files import OutFolder, digest_of_file
from phyblock.records.files import MANIFEST, PROMPTS, RECORDS, STOPPED, read_stopped
from phyblock.results.load import Run, load_run
from phyblock.results.tables import TablesWritten, coverage_frame, table_files
from phyblock.results.text import REPORT_FILE
from phyblock.sim.pictures import Lookout, PictureStyle
from phyblock.tracks.base import kind_of
from phyblock.types import WITHOUT_REPLY
from phyblock.web import pack
from phyblock.web.board import SiteRun, board_of, entries_of, open_sources, short, shortfalls

_FOLDER = "report/"
_PAGE = (REPORT_FILE, _FOLDER, pack.PICTURES)  # The page and the folders beside it in a run folder.
INDEX = "index.html"
_DATA = "data/"
_CONTROLS = frozenset({"blind", "prompt", "path", "size_px"})
"""Fields of pictures and of a track's section that may differ, or are compared by digest."""
_ABOUT = (
    "Can vision-language models build what they see? A model gets a picture of a structure and of "
    "sixteen numbered blocks, and names the blocks to place, in order."
)


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
    build = pack.build_of(one.sources.lacking, [digest_of_file(p) for p in paths if p.exists()])

    def make(new: Path) -> dict[str, Any]:
        entries = entries_of([one])
        with ExitStack() as made:
            sent = None
            if (run.path / PROMPTS).exists():
                folder = made.enter_context(out.making(pack.PICTURES))
                sent = pack.SentPictures(folder, out.path / pack.PICTURES, one.sources)
            pack.pack_samples(new, build, [one], entries, failures=6, sent=sent)
        board = {**board_of([one], entries), **_about(written)}
        return {"title": board["title"], "description": board["about"], "image": "", "board": board}

    out.claim([REPORT_FILE])
    return pack.write_page(out, REPORT_FILE, _FOLDER, build, make, lasting=[pack.PICTURES])


def files_of(*, page: bool) -> tuple[str, ...]:
    """Return the files that a run folder may get: tables, and the page if it is wanted."""
    return (*table_files(), *(_PAGE if page else ()))


def report_files(folder: Path) -> dict[str, Path]:
    """Return the report's page and the files it loads, by their names in the run folder."""
    below = sorted((folder / _FOLDER).rglob("*"))
    found = [folder / REPORT_FILE, *(path for path in below if path.is_file())]
    return {path.relative_to(folder).as_posix(): path for path in found if not path.is_symlink()}


def _about(written: TablesWritten) -> dict[str, Any]:
    """Return facts, tables and `cautions` of a run: warnings, the most important first."""
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


@dataclass
class SiteWritten:
    """A site: its page, numbers of models (with baselines) and samples, why nothing is drawn."""

    path: Path
    models: int
    samples: int = 0
    lacking: str = ""


def write_site(
    paths: Sequence[Path], out: Path, data: Sequence[Path] = (), title: str = "PhyBlock leaderboard"
) -> SiteWritten:
    """Write run folders and bundles as one static folder, the same bytes for the same runs.

    The page is written last and atomically: an interrupted build leaves an existing site as it was.
    Raises SpecError for runs that cannot share a table, StoreError for what is no run, does not
    verify, or files of others, DataError if a bundle's data are not found.
    """
    folder = OutFolder(out)
    folder.check([INDEX, _DATA])
    with ExitStack() as kept:
        runs = open_runs(paths, data, kept)
        check_runs(runs)
        entries = entries_of(runs)
        board = board_of(runs, entries) | {"title": title, "about": _ABOUT}
        finding = board["tracks"][0]["finding"]
        built_from = []
        for one in runs:
            # The manifest of a bundle names this machine's data.
            manifest = digest_of_file(one.run.path / MANIFEST)
            is_verified = one.unverified is not None
            known = one.run.manifest.identity if is_verified else manifest
            records = digest_of_file(one.run.path / RECORDS)
            built_from.append([known, records, is_verified, bool(one.sources.lacking)])
        build = pack.build_of(title, built_from)
        facts = {"title": title, "description": f"{_ABOUT} {finding}".strip(), "board": board}
        facts["image"] = f"{_DATA}{build}/card.png"
        made = SiteWritten(out / INDEX, len(entries))

        def make(new: Path) -> dict[str, Any]:
            index = pack.pack_samples(new, build, runs, entries, failures=4)
            goal = None
            for row in index["telling"][:1]:
                scene = index["scenes"][index["items"]["scene"][index["rows"]["item"][row]]]
                task = next(one.sources.tasks[scene] for one in runs if scene in one.sources.tasks)
                goal = Lookout(task.scene, PictureStyle(size_px=560)).image(task.scene.blocks)
            (new / "card.png").write_bytes(pack.card_png(title, finding, goal))
            made.samples, made.lacking = len(index["rows"]["entry"]), index["lacking"]
            return facts

        pack.write_page(folder, INDEX, _DATA, build, make)
    return made


def open_runs(paths: Sequence[Path], data: Sequence[Path], kept: ExitStack) -> tuple[SiteRun, ...]:
    """Open runs in the order given; bundles stay unpacked as long as `kept` is open.

    `data` are more folders with data. Raises SpecError for a run that is given twice, StoreError if
    a path is not a run or does not verify, and DataError if a bundle's data are not found.
    """
    opened: list[SiteRun] = []
    seen: dict[tuple[str, str], str] = {}
    for path in paths:
        where, unverified = str(path), None
        if path.is_file():
            verified = kept.enter_context(opened_bundle(path, data))
            unverified = verified.unverified
            run = load_run(verified.folder)
        else:
            run = load_run(path)
        # Runs of other models may have the same identity; a run and its bundle began together.
        begun = run.manifest.run, run.manifest.created
        if begun in seen:
            message = f"is the same run as {seen[begun]}"
            raise SpecError(Problem(where, message, "identity", begun[0], hint="give it once"))
        seen[begun] = where
        sources = open_sources(run, None)
        for folder in data:
            if sources.lacking:
                with suppress(DataError):
                    sources = open_sources(run, folder)
        opened.append(SiteRun(where, run, sources, unverified))
    return tuple(opened)


def check_runs(runs: Sequence[SiteRun]) -> None:
    """Raise SpecError naming all that keeps a run from sharing a table with an earlier one.

    All runs must use one version of one data set. Runs that share a track must agree in its items,
    prompt, pictures (in any size) and counts.
    """
    problems: list[Problem] = []
    for number, one in enumerate(runs):
        for first in runs[:number]:
            shared = [track for track in one.tracks if track in first.tracks]
            found, wanted = (_facts(side.run, shared) for side in (one, first))
            message, hint = f"cannot share a table with {first.where}", "make a site of each"
            if (limit := one.run.manifest.limit) != (other := first.run.manifest.limit):
                hint += f"; their limits (--limit) are {limit or 'none'} and {other or 'none'}"
            differences = [
                Problem(one.where, message, name, str(value), str(was), hint)
                for name, value in found.items()
                # The prompt of a recording is unknown, and a baseline has none.
                if None not in (value, was := wanted.get(name)) and value != was
            ]
            problems += differences
            if differences:
                break
    if problems:
        raise SpecError(problems)


def _facts(run: Run, shared: Sequence[str]) -> dict[str, Any]:
    """Return the facts that have to agree, by name; None for unknown ones."""
    manifest, suite, data = run.manifest, run.design.suite, run.manifest.dataset
    found: dict[str, Any] = {
        "dataset.name": data and data.name,
        "dataset.version": data and data.version,
    }
    if shared:
        found |= {
            "dataset.sha256": data and data.sha256[:12],
            "questions.version": manifest.questions and manifest.questions.version,
            "scoring.matchers": suite.scoring.matchers[0],
            **{f"scoring.{name}": getattr(suite.scoring, name) for name in ("level1", "missing")},
            "settings": ", ".join(suite.settings),
            "answer_format": suite.answer_format,
            "vary": ", ".join(suite.vary.factors) or "nothing",
        }
    for track in shared:
        identity, kind = manifest.tracks.get(track, {}), kind_of(track)
        for key, value in identity.items():
            if isinstance(value, Mapping) and {"name", "version"} <= value.keys():
                # A prompt is known by its name and digest.
                value = f"{value['name']} ({str(value['version'])[:12]})"
            # Digests of pictures change with their size.
            if key != "pictures":
                found[f"tracks.{track}.{key}"] = value
        drawn = [("images", suite.images)] if identity.get("pictures") is not None else []
        own = [(kind.section, suite.section(kind.options))] if kind.options is not None else []
        for name, values in (*drawn, *own):
            for key in type(values).model_fields.keys() - _CONTROLS:
                found[f"{name}.{key}"] = shown(getattr(values, key))
    return found
