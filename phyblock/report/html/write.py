"""Writing the report of a run: the page, and the folder of data beside it."""

from __future__ import annotations

import contextlib
import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from phyblock.data import AssemblyTask
from phyblock.files import OutFolder, writing
from phyblock.records.files import PROMPTS, RECORDS, STOPPED
from phyblock.records.manifest import MANIFEST
from phyblock.report.html.headline import headlines
from phyblock.report.html.index import Item, Place, SampleIndex, read_places
from phyblock.report.html.leads import mean_parts, part_names, table_leads
from phyblock.report.html.pack import Pack, write_script
from phyblock.report.html.page import Figure, render_page
from phyblock.report.html.samples import (
    items_shown,
    pack_prompts,
    pack_samples,
    pictures_sent,
    states_sent,
)
from phyblock.report.html.sent import PictureShelf
from phyblock.report.html.shown import images_of
from phyblock.report.html.sources import Sources, open_sources
from phyblock.report.html.standing import cautions, samples_done, shortfalls
from phyblock.results.figures import figure_titles, write_figures
from phyblock.results.load import Run
from phyblock.results.tables import TablesWritten
from phyblock.run.store import run_folder
from phyblock.tracks.opening import picture_policy
from phyblock.tracks.pictures import kit, scene_entry
from phyblock.tracks.showing import in_order

__all__ = ["REPORT_FILE", "PageWritten", "page_files", "write_page", "write_report"]

REPORT_FILE = "report.html"
_FOLDER = "report"
_PICTURES = "pictures"
_CHUNK_BYTES = 2**20
_LAYOUT = 4
"""Version of the scripts' folder; those of the first were not listed as ours."""
_NOT_SHOWN = ("table1",)
"""Tables that a headline table replaces."""


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
    """Write figures and page as `write_page` does; the page's path."""
    return write_page(written, data, figures=figures).path


def write_page(
    written: TablesWritten, data: Path | None = None, *, figures: bool = True
) -> PageWritten:
    """Write figures, `report.html` and `report/` of a run whose tables were.

    Goals, candidates and assemblies are drawn by the page from the scenes: `data` is where the
    data set is now, if it has moved; where it cannot be read, the page says so and shows the rest.
    Pictures that were sent lie beside the page as far as the picture cache has them. Raises
    DataError for a `data` that is not what the run was made on, StoreError where the folder cannot
    be written or something is in the way that we never wrote.
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
        lasting = (own, f"{_FOLDER}/{_PICTURES}/")
        out.remove(name for name in out.names(f"{_FOLDER}/") if not name.startswith(lasting))
    kept = tuple(run.path / address for address in pictures.values())
    whole = is_whole and not sources.lacking
    return PageWritten(path, (*drawn, *scripts, path), kept, whole)


def page_files() -> tuple[str, ...]:
    """The page and the folders beside it, by their names in a run folder."""
    return (REPORT_FILE, f"{_FOLDER}/", f"{_FOLDER}/{_PICTURES}/")


def _build(run: Run, sources: Sources) -> str:
    """A name for what the page shows: the same run, written again, has the same files."""
    digest = hashlib.sha256(f"{_LAYOUT} {version('phyblock')} {sources.lacking}".encode())
    for name in (MANIFEST, RECORDS, PROMPTS, STOPPED):
        with contextlib.suppress(FileNotFoundError), (run.path / name).open("rb") as file:
            while chunk := file.read(_CHUNK_BYTES):
                digest.update(chunk)
    return digest.hexdigest()[:12]


def _write_data(
    run: Run, sources: Sources, out: OutFolder, new: Path, build: str
) -> tuple[dict[str, str], bool]:
    """Write the scripts; the pictures as `_keep_pictures` says."""
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
    content: dict[str, Any] = {
        **index.columns(questions),
        "model_kinds": {model.name: model.kind for model in run.manifest.models},
        "starts": {kind: pack.starts for kind, pack in packs.items()},
        "kit": kit(),
        "no_scenes": sources.lacking,
        "subtask_names": part_names(run),
        "subtask_groups": mean_parts(run),
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
    """Addresses of the pictures at hand as seen from the page, by digest; whether all are."""
    place = f"{_FOLDER}/{_PICTURES}/"
    with out.making(place) as new:
        shelf = PictureShelf(new, out.path / place)
        for images in images_of(run):
            policy = picture_policy(images)
            if sources.tasks:
                shelf.add_scenes(_scenes(run, sources.tasks), policy)
                shelf.add_kept(states_sent(run.path, places, sources.tasks, policy.style))
            for track, items in sources.items.items():
                shown = [one for item, one in asked.items() if item.track == track]
                shelf.add_items(items, shown, policy.style)
    return {digest: f"{place}{name}" for digest, name in shelf.names.items()}, shelf.is_whole


def _scenes(run: Run, tasks: Mapping[str, AssemblyTask]) -> Iterator[AssemblyTask]:
    """Scenes that were asked about as such, in every form in which they were shown: their names
    are those of the items.
    """
    asked = run.records[run.records["item"] == run.records["scene"]]
    forms = asked["shown"].map(json.dumps)
    for scene, form in dict.fromkeys(zip(asked["scene"], forms, strict=True)):
        task, shown = tasks.get(scene), json.loads(form)
        if task is not None and shown:
            yield in_order(task, shown["order"], tasks.get(shown["goal"]), some=True)
        elif task is not None:
            yield task


def _page(written: TablesWritten, figures: Sequence[Path], build: str) -> str:
    run = written.run
    return render_page(
        about=_about(run),
        cautions=cautions(run),
        headlines=headlines(run),
        figures=_figures(run, figures),
        models=run.design.model_names,
        tables=[
            (view, table_leads(run, name, view))
            for name, view in written.views.items()
            if name not in _NOT_SHOWN
        ],
        folder=f"{_FOLDER}/{build}",
        build=build,
    )


def _about(run: Run) -> dict[str, Any]:
    manifest, design = run.manifest, run.design
    facts = {
        "Data": manifest.dataset.name if manifest.dataset else "",
        "Scenes": f"{design.scenes:,}",
        "Models": f"{len(design.model_names)}",
        "Seeds": f"{len(design.suite.seeds)}",
        "Samples": samples_done(run),
        "Made": manifest.created[:10],
        "phyblock": manifest.versions.get("phyblock"),
        "Run": manifest.identity[:12],
    }
    description = design.suite.description
    return {
        "title": design.suite.name or run.path.name,
        # A suite that was cut short still speaks of all that is in it.
        "description": f"The whole suite: {description}"
        if description and manifest.limit
        else description,
        "facts": [(name, text) for name, text in facts.items() if text],
    }


def _figures(run: Run, files: Sequence[Path]) -> list[Figure]:
    titles = figure_titles(run)
    return [
        Figure(f"{path.parent.name}/{path.name}", titles.get(path.stem, path.stem))
        for path in files
        if path.suffix == ".svg"
    ]
