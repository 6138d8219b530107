"""Several runs as one leaderboard: a static folder that opens from disk or from any web server."""

from __future__ import annotations

import base64
import io
import os
import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from PIL import Image, ImageDraw, ImageFont
from pydantic import BaseModel

from phyblock.bundle import opened_bundle
from phyblock.errors import DataError, Problem, SpecError, StoreError
from phyblock.files import LIST, OutFolder, digest_of_file, writing
from phyblock.records.files import RECORDS
from phyblock.records.manifest import MANIFEST
from phyblock.records.record import Record
from phyblock.results.load import Run, load_run
from phyblock.sim.pictures import PictureStyle, goal_png, to_png
from phyblock.tracks.base import CARRYING, kind_of
from phyblock.web.board import (
    AllValues,
    Entry,
    Failures,
    SiteRun,
    all_values,
    board_of,
    entries_of,
    telling,
)
from phyblock.web.pack import (
    IN_INDEX,
    Columns,
    Numbers,
    Pack,
    asset,
    build_of,
    fill,
    kit,
    open_sources,
    pack_scenes,
    places_of,
    records_at,
    write_script,
    write_three,
)

INDEX = "index.html"
_DATA = "data/"
_PARTIAL = re.compile(r"\.[0-9a-f]{32}\.part")
_SCRIPTS = (
    *("dom.js", "chunks.js", "solid.js", "steps.js", "poses.js", "runs.js", "stage.js"),
    *("quotes.js", "overlay.js", "why.js", "store.js", "table.js", "chart.js", "ranking.js"),
    *("board.js", "views.js", "replay.js", "site.js"),
)
_STYLES = ("base.css", "samples.css", "reply.css", "site.css", "ranking.css")
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
_LONGEST = {"text": 6000, "reasoning": 2000}
"""Characters of a reply that a site shows; the bundle has all of it."""
_LEFT_OUT = IN_INDEX | {"reply", "scores", "turns", "prompt", "asked", "time", "counts"}
"""Fields of records that a replay needs otherwise or not at all; those that tracks add, it has."""
_FAILURES = 4
_ABOUT = (
    "A vision-language model sees a picture of a structure and sixteen numbered blocks, and says "
    "which blocks to place, in which order."
)
_REPLY = ("text", "reasoning", "finish", "cost_usd", "usage", "latency_s")


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
        kind = kind_of(track)
        if kind.options is not None:
            held.append((kind.section, run.design.suite.section(kind.options), _CONTROLS))
        for name, values, without in held:
            for key in type(values).model_fields.keys() - without:
                yield f"{name}.{key}", str(getattr(values, key))


def _card(title: str, finding: str, runs: Sequence[SiteRun], samples: Mapping[str, Any]) -> bytes:
    """Return the picture of a site for links to it: its title and finding, and a goal, as PNG of
    1200 x 630 pixels.
    """
    card = Image.new("RGB", (1200, 630), "#ffffff")
    scenes = samples["scenes"]
    for failure in samples["telling"]:
        scene = scenes[samples["items"]["scene"][samples["rows"]["item"][failure["row"]]]]
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
    failures = [Failures(one.run, frozenset(one.sources.tasks)) for one in runs]
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
                items.add(
                    track=tracks.of(track),
                    key=item,
                    scene=scenes.of(record.scene),
                    levels=list(record.levels),
                    part=record.part,
                    question=one.sources.question(record, packs["questions"]),
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
            failures[number].see(record, packs["replays"].add(_replay(record, one.run)))
    is_drawn = pack_scenes(scenes, [one.sources for one in runs], packs["scenes"])
    for pack in packs.values():
        pack.close()
    parts: dict[str, str] = {}
    for track in tracks:
        parts |= kind_of(track).report().part_names
    return {
        "telling": telling(failures, _FAILURES),
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
