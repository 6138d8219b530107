"""Writing the report of a run: the page, and the folder of data beside it."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from phyblock.domain import SUBTASK_NAMES
from phyblock.files import writing
from phyblock.folders import OutFolder
from phyblock.records import MANIFEST, PROMPTS, RECORDS
from phyblock.report.figures import FIGURES, write_figures
from phyblock.report.html.drawable import kit, question_entry, scene_entry
from phyblock.report.html.headline import assembly_headline
from phyblock.report.html.headline_tracks import steps_headline, vqa_headline
from phyblock.report.html.index import Item, SampleIndex, read_places
from phyblock.report.html.pack import Pack, write_script
from phyblock.report.html.page import Figure, render_page
from phyblock.report.html.samples import (
    pack_prompts,
    pack_samples,
    pictures_sent,
    questions_asked,
)
from phyblock.report.html.sent import PictureShelf
from phyblock.report.html.sources import Sources, open_sources
from phyblock.report.load import Run
from phyblock.report.write import TablesWritten
from phyblock.run.folder import run_folder
from phyblock.tasks.question_pictures import Shown

__all__ = ["REPORT_FILE", "page_files", "write_report"]

REPORT_FILE = "report.html"
_FOLDER = "report"
_PICTURES = "pictures"
_CHUNK_BYTES = 2**20
_LAYOUT = 2
"""Version of the scripts' folder; those of the first were not listed as ours."""
_FIGURES = {
    "f1-levels": "F1 by level",
    "f1-radar": "F1 by level, as in the paper",
    "settings": "Setting A against setting B",
    "error-types": "Wrong steps by type",
    "f1-size": "F1 by model size",
    "f1-cost": "F1 by cost",
    "vqa-subtasks": "VQA accuracy by subtask",
    "step-progress": "Blocks placed, turn by turn",
    "scenes": "The scenes of the run by level",
}
_NOT_SHOWN = ("table1",)
"""Tables that a headline table replaces."""


def write_report(
    written: TablesWritten, data: Path | None = None, figures: Sequence[str] = FIGURES
) -> Path:
    """Write figures, `report.html` and `report/` of a run whose tables were; the page's path.

    Goals, candidates and assemblies are drawn by the page from the scenes: `data` is where the
    data set is now, if it has moved; where it cannot be read, the page says so and shows the rest.
    Pictures that were sent lie beside the page as far as the picture cache has them. `figures`
    names those to draw. Raises DataError for a `data` that is not what the run was made on,
    StoreError where the folder cannot be written or something is in the way that we never wrote.
    """
    run = written.run
    sources = open_sources(run.manifest, run.design, data)
    out = run_folder(run.path)
    out.check(page_files())
    with out.alone(), writing(run.path / REPORT_FILE):
        drawn = write_figures(run, figures)
        build = _build(run, sources)
        own = f"{_FOLDER}/{build}/"
        out.claim([REPORT_FILE])
        with out.making(own) as new:
            _write_data(run, sources, out, new, build)
            page = _page(written, drawn, build)
        (path,) = out.write({REPORT_FILE: page})
        # A page of an earlier build that is still open says that it was written again.
        lasting = (own, f"{_FOLDER}/{_PICTURES}/")
        out.remove(name for name in out.names(f"{_FOLDER}/") if not name.startswith(lasting))
    return path


def page_files() -> tuple[str, ...]:
    """The page and the folders beside it, by their names in a run folder."""
    return (REPORT_FILE, f"{_FOLDER}/", f"{_FOLDER}/{_PICTURES}/")


def _build(run: Run, sources: Sources) -> str:
    """A name for what the page shows: the same run, written again, has the same files."""
    digest = hashlib.sha256(f"{_LAYOUT} {version('phyblock')} {sources.lacking}".encode())
    for name in (MANIFEST, RECORDS, PROMPTS):
        with contextlib.suppress(FileNotFoundError), (run.path / name).open("rb") as file:
            while chunk := file.read(_CHUNK_BYTES):
                digest.update(chunk)
    return digest.hexdigest()[:12]


def _write_data(run: Run, sources: Sources, out: OutFolder, new: Path, build: str) -> None:
    kinds = ("records", "scenes", "questions", "prompts")
    packs = {kind: Pack(new, kind, build) for kind in kinds}
    places = read_places(run.path, run.design)
    asked = questions_asked(run.path, places, sources.questions)
    pictures = {}
    if pictures_sent(run.path, places):
        pictures = _keep_pictures(run, sources, asked, out)
    prompts = pack_prompts(run.path, packs["prompts"])
    index = SampleIndex(run.design)
    pack_samples(run.path, places, index, packs["records"], prompts, pictures)
    for scene in index.scenes if sources.tasks else ():
        task = sources.tasks.get(scene)
        packs["scenes"].add(task and scene_entry(task.scene, task.candidates))
    questions = {
        item: packs["questions"].add(question_entry(shown.question))
        for item, shown in asked.items()
    }
    for pack in packs.values():
        pack.close()
    content: dict[str, Any] = {
        **index.columns(questions),
        "starts": {kind: pack.starts for kind, pack in packs.items()},
        "kit": kit(),
        "no_scenes": sources.lacking,
        "subtask_names": SUBTASK_NAMES,
    }
    write_script(new, "index", build, content)


def _keep_pictures(
    run: Run, sources: Sources, asked: Mapping[Item, Shown], out: OutFolder
) -> dict[str, str]:
    """Addresses of the pictures at hand as seen from the page, by digest."""
    place = f"{_FOLDER}/{_PICTURES}/"
    with out.making(place) as new:
        shelf = PictureShelf(new, out.path / place, run.manifest["suite"])
        if set(run.design.suite.tracks) - {"vqa"}:
            known = (sources.tasks.get(scene) for scene in _scenes(run))
            shelf.add_scenes(task for task in known if task is not None)
        if asked:
            shelf.add_questions(asked.values())
    return {digest: f"{place}{name}" for digest, name in shelf.names.items()}


def _scenes(run: Run) -> list[str]:
    return list(run.records.loc[run.records["track"] != "vqa", "scene"].unique())


def _page(written: TablesWritten, figures: Sequence[Path], build: str) -> str:
    run = written.run
    headlines = [assembly_headline(run), vqa_headline(run), steps_headline(run)]
    return render_page(
        about=_about(run),
        headlines=[headline for headline in headlines if headline],
        figures=_figures(figures),
        tables=[view for name, view in written.views.items() if name not in _NOT_SHOWN],
        folder=f"{_FOLDER}/{build}",
        build=build,
    )


def _about(run: Run) -> dict[str, Any]:
    manifest, design = run.manifest, run.design
    suite = manifest["suite"]
    versions = manifest.get("versions") or {}
    facts = {
        "Data": (manifest.get("dataset") or {}).get("name"),
        "Scenes": f"{design.scenes:,}",
        "Models": f"{len(design.model_names)}",
        "Seeds": f"{len(design.suite.seeds)}",
        "Samples": f"{len(run.records):,}",
        "Made": str(manifest.get("created", ""))[:10],
        "phyblock": versions.get("phyblock"),
        "Run": str(manifest["identity"])[:12],
    }
    return {
        "title": design.suite.name or run.path.name,
        "description": suite.get("description") or "",
        "facts": [(name, text) for name, text in facts.items() if text],
    }


def _figures(files: Sequence[Path]) -> list[Figure]:
    return [
        Figure(f"{path.parent.name}/{path.name}", _FIGURES.get(path.stem, path.stem))
        for path in files
        if path.suffix == ".svg"
    ]
