"""Files of a page: its HTML, and beside it data as scripts, three.js, and pictures as sent.

A page that is opened from disk may load scripts, but not fetch files. Scripts call
`phyblockTake(build, name, text)` with deflated JSON in base 64: nothing in a reply is run as code.
"""

from __future__ import annotations

import base64
import hashlib
import itertools
import json
import os
import re
import textwrap
import zlib
from collections import ChainMap, defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields as dataclass_fields
from dataclasses import is_dataclass
from functools import cached_property, partial
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

import jinja2
from PIL import Image, ImageDraw, ImageFont

from phyblock.domain.blocks import BLOCK_TYPES
from phyblock.domain.scene import AssemblyTask
from phyblock.files import OutFolder, atomic_write, cache_dir, digest_of_file, writing
from phyblock.records.files import PromptLines, RecordLines
from phyblock.records.record import Record, SentPrompt
from phyblock.sim.geometry import solid_mesh
from phyblock.sim.pictures import COLOR_RGB, to_png
from phyblock.text import hex_digest
from phyblock.web.board import Entry, SiteRun, Sources

_LAYOUT = 7  # Version of the scripts.
_CHUNK_CHARACTERS = 400_000
_DIGITS = 24
_DECIMALS = 6  # Decimals of numbers used for drawing.
PICTURES = "report/pictures/"  # The folder of sent pictures in a run's folder.
_SCRIPTS = (
    *("dom.js", "data.js", "solid.js", "steps.js", "poses.js", "stage.js", "quotes.js"),
    *("sample.js", "list.js", "table.js", "charts.js", "results.js", "views.js", "app.js"),
)
_LEFT_OUT = frozenset(
    {
        *("sample", "track", "model", "key", "scene", "levels", "parents", "n_blocks", "seed"),
        *("variant", "outcome", "run", "time", "counts", "prompt", "turns", "reply", "scores"),
    }
)
"""Fields of records that the index has, or that a page does not show as they are."""
_OF_QUESTION = ("subtask", "text", "options", "answer_letters", "pictures", "evidence")
_CARD_PX = (1200, 630)
_INSTRUCTIVE_BLOCKS = 6  # A failure is most instructive if its goal has about this many blocks.


class Pack:
    """Entries of one kind in numbered scripts, written as they fill.

    `starts` has the first entry's number of each script. Methods raise OSError if a disk fails.
    """

    def __init__(self, folder: Path, kind: str, build: str) -> None:
        self.starts: list[int] = []
        self._folder, self._kind, self._build = folder, kind, build
        self._entries: list[str] = []
        self._size = self._count = 0

    def add(self, entry: object) -> int:
        """Append an entry and return its number."""
        text = _to_json(entry)
        if self._entries and self._size + len(text) > _CHUNK_CHARACTERS:
            self.close()
        self._entries.append(text)
        self._size += len(text)
        self._count += 1
        return self._count - 1

    def close(self) -> None:
        """Write the remaining entries."""
        if self._entries:
            name = f"{self._kind}-{len(self.starts)}"
            _write(self._folder, name, self._build, f"[{','.join(self._entries)}]")
            self.starts.append(self._count - len(self._entries))
            self._entries, self._size = [], 0


def _to_json(data: object) -> str:
    return json.dumps(data, ensure_ascii=True, separators=(",", ":"), allow_nan=False)


def _write(folder: Path, name: str, build: str, text: str) -> None:
    packed = base64.b64encode(zlib.compress(text.encode("ascii"), 9)).decode("ascii")
    script = f"phyblockTake('{build}','{name}','{packed}')\n"
    (folder / f"{name}.js").write_text(script, encoding="ascii")


def _write_three(folder: Path) -> None:
    """Write three.js as the script `three.js`, which names it `THREE`."""
    # Its published build has two modules, which a page opened from disk may not load; their imports
    # and exports become arguments and results of functions.
    core, module = (asset(f"three/three.{name}.min.js").decode() for name in ("core", "module"))
    names, source = r"(\{[^}]*\})", r'from"\./three\.core\.min\.js";?'
    exported = partial(re.sub, r"([\w$]+) as ([\w$]+)", r"\2:\1")
    core = re.sub(rf"export{names};?\s*$", lambda found: f"return{exported(found[1])}", core)
    module = re.sub(rf"export{names}{source}", "", module)
    module = re.sub(
        rf"import{names}{source}",
        lambda found: f"const{found[1].replace(' as ', ':')}=core;",
        module,
    )
    module = re.sub(
        rf"export{names};?\s*$", lambda found: f"return{{...core,...{exported(found[1])}}}", module
    )
    script = f"window.THREE=(core=>{{{module}}})((()=>{{{core}}})());\n"
    (folder / "three.js").write_text(script, encoding="utf-8")


def build_of(*contents: object) -> str:
    """Return a name for the content of a page: the same runs always have the same files."""
    return hex_digest(json.dumps([_LAYOUT, version("phyblock"), *contents]))[:12]


def pack_samples(
    folder: Path,
    build: str,
    runs: Sequence[SiteRun],
    entries: Sequence[Entry],
    *,
    failures: int,
    sent: SentPictures | None = None,
) -> dict[str, Any]:
    """Write the scripts of samples and three.js; return their index, columns of script `samples`.

    Each sample has its newest record, with the prompt if `sent` is given. Up to `failures` samples
    show how models fail. Raises OSError if the disk fails, StoreError for unreadable records.
    """
    kinds = ("records", "scenes", "questions", "prompts")
    packs = {kind: Pack(folder, kind, build) for kind in kinds}
    # Distinct values, numbered from 0 in the order in which they come.
    tracks, scenes, numbered, outcomes, ways, errors = (
        defaultdict[Any, int](itertools.count().__next__) for _ in range(6)
    )
    items: list[tuple[Any, ...]] = []
    rows: list[tuple[Any, ...]] = []
    found: list[_Failure] = []
    owner = {
        (number, track, entry.model.name): place
        for place, entry in enumerate(entries)
        for track, number in entry.runs.items()
    }
    for number, one in enumerate(runs):
        design, rules, prompts = one.run.design, one.run.design.baselines, {}
        if sent:
            for _, line in PromptLines(one.run.path):
                messages = [message.fields() for message in line.messages]
                prompts[line.sha256] = packs["prompts"].add(messages)
        order = {"track": design.suite.tracks, "model": design.model_names}
        held = one.run.records
        owned = [(number, *by) in owner for by in zip(held["track"], held["model"], strict=True)]
        held = held.loc[owned]
        held = held.assign(**{name: held[name].map(known.index) for name, known in order.items()})
        held = held.sort_values(["track", "item", "model", "seed"], kind="stable")
        for record in RecordLines(one.run.path).at(held["start"].tolist()):
            track, item = record.track, record.item
            if (track, item) not in numbered:
                asked = one.sources.items.get((track, item))
                question = -1
                if asked:
                    fields = {name: _plain(getattr(asked.question, name)) for name in _OF_QUESTION}
                    question = packs["questions"].add(fields)
                about = (tracks[track], item, scenes[record.scene], record.levels)
                items.append((*about, record.part, question))
            worth = one.values[track].samples.get(record.model, {})
            score = worth.get((record.scene, item, record.seed, record.way.key))
            course = record.course(design.matcher)
            wrong = [why for _, why in course.steps] if course else []
            rows.append(
                (
                    owner[number, track, record.model],
                    numbered[track, item],
                    record.seed,
                    ways[record.way.key],
                    outcomes[record.outcome],
                    None if score is None else round(score, 1),
                    # A bit for each type of wrong step.
                    sum(1 << errors[why] for why in dict.fromkeys(filter(None, wrong))),
                )
            )
            first = next((n for n, why in enumerate(wrong) if why), 0)
            # It goes well for some steps first.
            if first >= 2 and record.scene in one.sources.tasks and record.model not in rules:
                weight = min(first, 4) - abs(record.n_blocks - _INSTRUCTIVE_BLOCKS)
                found.append(_Failure(str(wrong[first]), record.model, weight, len(rows) - 1))
            packs["records"].add(_entry(record, design.matcher, prompts, sent))
    known = ChainMap(*(dict(one.sources.tasks) for one in runs))
    is_drawn = any(scene in known for scene in scenes)
    for scene in scenes:
        packs["scenes"].add(_scene(known[scene]) if scene in known else None)
    for pack in packs.values():
        pack.close()
    starts_of = {kind: pack.starts for kind, pack in packs.items()}
    shapes = {}
    for name in BLOCK_TYPES:
        mesh = solid_mesh(name)
        # In the body frame [m].
        corners = mesh.vertices_m.round(_DECIMALS).tolist()
        shapes[name] = {"vertices": corners, "triangles": mesh.triangles.tolist()}
    index = {
        "tracks": list(tracks),
        "scenes": list(scenes),
        "ways": list(ways),
        "outcomes": list(outcomes),
        "errors": list(errors),
        "items": _columns("track key scene levels part question", items),
        "rows": _columns("entry item seed way outcome score wrong", rows),
        "starts": {**starts_of, "scenes": starts_of["scenes"] if is_drawn else []},
        "lacking": "" if is_drawn else runs[0].sources.lacking,
        "telling": _instructive(found, failures),
        "kit": {"shapes": shapes, "colors": COLOR_RGB},
    }
    _write(folder, "samples", build, _to_json(index))
    _write_three(folder)
    return index


def _columns(names: str, rows: Sequence[tuple[Any, ...]]) -> dict[str, list[Any]]:
    return {name: [row[n] for row in rows] for n, name in enumerate(names.split())}


def _entry(
    record: Record, matcher: str, prompts: Mapping[str, int], sent: SentPictures | None
) -> dict[str, Any]:
    """Return a record as data of a page."""

    def prompt(one: SentPrompt | None) -> dict[str, Any]:
        if one is None or sent is None:
            return {}
        known = ("label", "width_px", "height_px")
        images = [
            {**{name: getattr(image, name) for name in known}, "file": sent.name(image.sha256)}
            for image in one.images
        ]
        number = prompts.get(one.messages)
        return {"prompt": {"template": one.template, "n": number, "images": images}}

    def reply(one: Mapping[str, Any]) -> dict[str, Any]:
        return {name: value for name, value in one.items() if value not in (None, "")}

    fields = record.fields()
    left = ((name, value) for name, value in fields.items() if name not in _LEFT_OUT)
    entry = {name: value for name, value in left if value is not None} | prompt(record.prompt)
    if record.asked_turns:
        turns = zip(fields["turns"], record.asked_turns, strict=True)
        entry["turns"] = [
            {**stored, "reply": reply(stored["reply"]), "prompt": None, **prompt(turn.prompt)}
            for stored, turn in turns
        ]
    if record.reply is not None:
        # An episode's replies are in its turns.
        own = reply(fields["reply"])
        entry["reply"] = {**own, "text": "", "reasoning": ""} if record.asked_turns else own
    entry["scores"] = [
        {name: score[name] for name in ("setting", "tp", "fp", "fn", "placed", "why")}
        for score in fields["scores"]
        if score.get("matcher") in (None, matcher) and score.get("placed") is not None
    ]
    return entry


class _Failure(NamedTuple):
    """The first wrong step of a sample, its model and row, and how instructive it is."""

    error: str
    model: str
    weight: float
    row: int


def _instructive(found: list[_Failure], most: int) -> list[int]:
    """Return rows of the most instructive samples, of all types of error and many models."""
    chosen: list[_Failure] = []

    def order(one: _Failure) -> tuple[int, int, float, int]:
        errors, models = ([other[n] for other in chosen] for n in (0, 1))
        return errors.count(one.error), models.count(one.model), -one.weight, one.row

    while len(chosen) < min(most, len(found)):
        chosen.append(min((one for one in found if one not in chosen), key=order))
    return [one.row for one in chosen]


def _plain(value: Any) -> Any:
    """Return dataclasses as data of a page: fields by names without units, numbers rounded."""
    if is_dataclass(value):
        named = ((re.sub("_(m|deg)$", "", one.name), one.name) for one in dataclass_fields(value))
        return {name: _plain(getattr(value, field)) for name, field in named}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    return round(value, _DECIMALS) if isinstance(value, float) else value


def _scene(task: AssemblyTask) -> dict[str, Any]:
    """Return a scene as data of a page; `depend` has places of blocks, `candidate` a number."""
    blocks = [
        {
            **_plain(block),
            "depend": sorted(task.scene.graph.depends_on[vertex]),
            "candidate": task.candidates.index_of(block.look),
        }
        for vertex, block in enumerate(task.scene.blocks)
    ]
    return {"blocks": blocks, "candidates": _plain(task.candidates.candidates)}


class SentPictures:
    """Sent pictures, put into `folder` on request by their digests.

    They come from the cache or the data set, as hard links if possible; nothing is rendered.
    """

    def __init__(self, folder: Path, earlier: Path, sources: Sources) -> None:
        """Pictures that `earlier` holds need not be added."""
        self._folder, self._earlier, self._sources = folder, earlier, sources

    @cached_property
    def _paths(self) -> dict[str, Path]:
        own = (task.composite for task in self._sources.tasks.values())
        paths = [*(cache_dir() / "pictures").glob("*/*.png"), *(path for path in own if path)]
        return {digest_of_file(path): path for path in paths}

    def name(self, digest: str) -> str | None:
        """Return a picture's address, or None if it is not kept. Raises OSError if a disk fails."""
        name = f"{digest[:_DIGITS]}.png"
        path = self._folder / name
        if not path.exists() and not (self._earlier / name).exists():
            if digest not in self._paths:
                return None
            try:
                os.link(self._paths[digest], path)
            except OSError:
                atomic_write(path, self._paths[digest].read_bytes())
        return f"{PICTURES}{name}"


def card_png(title: str, text: str, picture: Image.Image | None) -> bytes:
    """Return a PNG of 1200 x 630 pixels: a title, lines of text, and a picture beside or below."""
    card = Image.new("RGB", _CARD_PX, "#ffffff")
    is_wide = picture is not None and picture.width > picture.height
    if picture is not None:
        card.paste(picture, ((_CARD_PX[0] - picture.width) // 2, 300) if is_wide else (605, 35))
    draw, top = ImageDraw.Draw(card), 40 if is_wide else 110
    columns = (40, 66) if is_wide else (18, 30)
    for said, size, color, width in zip(
        (title, text), (58, 36), ("#16181d", "#3a4cc4"), columns, strict=True
    ):
        for line in (part for whole in said.splitlines() for part in textwrap.wrap(whole, width)):
            draw.text((50, top), line, color, ImageFont.load_default(size))
            top += round(1.25 * size)
        top += 36 if not is_wide else 12
    return to_png(card)


def asset(name: str) -> bytes:
    """Return the content of a bundled file of pages."""
    return (files("phyblock.web") / "assets" / name).read_bytes()


def write_page(
    out: OutFolder,
    name: str,
    below: str,
    build: str,
    make: Callable[[Path], Mapping[str, Any]],
    *,
    lasting: Sequence[str] = (),
) -> Path:
    """Write a page `name` and its data in the folder `below`/`build`/; return the page.

    `make` writes the data into the given folder and returns `title`, `description`, `board`, and
    the address of an `image` for links ("" for none). The page is written last and atomically; data
    of earlier builds are removed, except the `lasting` ones. An open earlier page says so.
    """
    own = f"{below}{build}/"
    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    script = "\n".join(asset(one).decode() for one in _SCRIPTS)
    style, icon = asset("style.css").decode(), base64.b64encode(asset("icon.svg")).decode()
    # Only phyblock's scripts may run, and every text is escaped.
    digests = (
        base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        for text in (script, style)
    )
    policy = (
        "default-src 'none'; script-src 'sha256-{}' 'self'; style-src 'sha256-{}'; "
        "img-src 'self' data:; base-uri 'none'; form-action 'none'"
    ).format(*digests)
    about = {"script": script, "style": style, "policy": policy, "icon": icon, "build": build}
    template = environment.from_string(asset("page.html.j2").decode())
    with out.alone(), writing(out.path / name):
        with out.making(own) as new:
            facts = make(new)
        (path,) = out.write({name: template.render(**facts, **about, folder=own.rstrip("/"))})
        out.remove(one for one in out.names(below) if not one.startswith((own, *lasting)))
    return path
