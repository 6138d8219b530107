"""Runs as data of pages: records, scenes and questions as JSON in scripts, and pictures as sent.

A page that was opened from disk may load scripts, but not fetch files. A script calls
`phyblockTake(build, name, text)`; the text is JSON, deflated, in base 64, so that nothing that a
model said is ever read as code.
"""

from __future__ import annotations

import base64
import hashlib
import json
import os
import re
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

import jinja2

from phyblock.data import AssemblyTask
from phyblock.domain import BLOCK_TYPES, Block, CandidateSet, Question, Scene
from phyblock.errors import DataError
from phyblock.files import atomic_write, digest_of_file
from phyblock.records.files import PromptLines, RecordLines
from phyblock.records.record import Record, Score, SentPrompt
from phyblock.resources import cache_dir
from phyblock.results.load import Design, Run
from phyblock.run.rescore import recorded_dataset
from phyblock.sim.geometry import solid_mesh
from phyblock.sim.pictures import COLOR_RGB
from phyblock.stable import hex_digest
from phyblock.tracks.base import kind_of, kinds
from phyblock.tracks.measures import by_settings

_LAYOUT = 6
"""Version of the scripts."""
_CHUNK_CHARACTERS = 400_000
_DIGITS = 24
PICTURES = "report/pictures/"
"""The folder of pictures that were sent, below that of a run."""
_DECIMALS = 6
"""Decimals of numbers that pages draw by."""
_ONLY_IN_TABLES = ("errors", "blocks", *Score.FURTHER)
IN_INDEX = frozenset(
    {
        *("sample", "track", "model", "key", "scene", "levels", "parents", "n_blocks", "seed"),
        *("variant", "outcome", "run"),
    }
)
"""Fields of records that an index has, or that are of no use on a page."""


class Pack:
    """Entries of one kind in numbered scripts, written as they fill.

    `starts` holds the number of the first entry of every script. Methods raise OSError where the
    disk refuses.
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
        """Write what is left."""
        if self._entries:
            name = f"{self._kind}-{len(self.starts)}"
            _write(self._folder, name, self._build, f"[{','.join(self._entries)}]")
            self.starts.append(self._count - len(self._entries))
            self._entries, self._size = [], 0


def write_script(folder: Path, name: str, build: str, data: Mapping[str, object]) -> None:
    """Write one object as the script `<name>.js`; raises OSError where the disk refuses."""
    _write(folder, name, build, _to_json(data))


def write_three(folder: Path) -> None:
    """Write three.js as the script `three.js`, which names it `THREE`.

    Its published build is of two modules, which a page that was opened from disk may not load; what
    they import and export becomes what functions take and return. Raises OSError where the disk
    refuses.
    """

    def exported(match: re.Match[str]) -> str:
        pairs = (name.rpartition(" as ") for name in match[1].split(","))
        return ",".join(f"{shown}:{own or shown}" for own, _, shown in pairs)

    core, module = (asset(f"three/three.{name}.min.js").decode() for name in ("core", "module"))
    core = re.sub(r"export\{([^}]*)\};?\s*$", lambda match: f"return{{{exported(match)}}}", core)
    source = r'from"\./three\.core\.min\.js";?'
    module = re.sub(rf"export\{{[^}}]*\}}{source}", "", module)
    module = re.sub(
        rf"import\{{([^}}]*)\}}{source}",
        lambda match: f"const{{{match[1].replace(' as ', ':')}}}=core;",
        module,
    )
    module = re.sub(
        r"export\{([^}]*)\};?\s*$", lambda match: f"return{{...core,{exported(match)}}}", module
    )
    script = f"window.THREE=(core=>{{{module}}})((()=>{{{core}}})());\n"
    (folder / "three.js").write_text(script, encoding="utf-8")


def _to_json(data: object) -> str:
    return json.dumps(data, ensure_ascii=True, separators=(",", ":"), allow_nan=False)


def _write(folder: Path, name: str, build: str, text: str) -> None:
    packed = base64.b64encode(zlib.compress(text.encode("ascii"), 9)).decode("ascii")
    script = f"phyblockTake('{build}','{name}','{packed}')\n"
    (folder / f"{name}.js").write_text(script, encoding="ascii")


def build_of(*told: object) -> str:
    """Return a name for what a page shows: the same runs, written again, have the same files."""
    return hex_digest(json.dumps([_LAYOUT, version("phyblock"), *told]))[:12]


class Place(NamedTuple):
    """The place of the newest record of a sample in `records.jsonl` [bytes], and its sort keys."""

    track: str
    key: str
    model: str
    seed: int
    start: int


def places_of(run: Run) -> list[Place]:
    """Return every sample once: by track, item, then model in the suite's order, and seed."""
    names = ("track", "item", "model", "seed", "start")
    places = map(Place, *(run.records[name].tolist() for name in names))
    tracks = {name: n for n, name in enumerate(run.design.suite.tracks)}
    models = {name: n for n, name in enumerate(run.design.model_names)}

    def order(place: Place) -> tuple[int, str, int, str, int]:
        track, model = tracks.get(place.track, len(tracks)), models.get(place.model, len(models))
        return track, place.key, model, place.model, place.seed

    return sorted(places, key=order)


def records_at(folder: Path, places: Iterable[Place]) -> Iterable[Record]:
    """Read the records at these places, one at a time."""
    return RecordLines(folder).at(place.start for place in places)


class Numbers(dict[Any, int]):
    """Distinct values, numbered from 0 in the order in which they come."""

    def __init__(self, values: Iterable[Any] = ()) -> None:
        super().__init__({value: n for n, value in enumerate(dict.fromkeys(values))})

    def of(self, value: Any) -> int:
        """Return the number of a value, the next one where it is new."""
        return self.setdefault(value, len(self))


class Columns(dict[str, list[Any]]):
    """Lists of one length, by name."""

    def __init__(self, *names: str) -> None:
        super().__init__({name: [] for name in names})

    def add(self, **row: Any) -> None:
        """Append a value to each list."""
        for name, value in row.items():
            self[name].append(value)


class SampleIndex:
    """Columns over all samples of a run, and over the items that they are about."""

    def __init__(self, design: Design) -> None:
        tracks = design.suite.tracks
        self._matcher = design.matcher
        self._listings = {
            name: (*kind_of(name).report().listings, *by_settings(design.suite)) for name in tracks
        }
        # A model and a track without any record are in the run as well.
        self._tracks, self._models = Numbers(tracks), Numbers(design.model_names)
        self.scenes, self.items = Numbers(), Numbers()
        self._outcomes, self._subtasks, self._variants = Numbers(), Numbers(), Numbers()
        self._about = Columns("scene", "levels", "subtask", "question")
        self._rows = Columns("track", "model", "item", "seed", "variant", "outcome", "correct")
        names = {listing.name: None for group in self._listings.values() for listing in group}
        self._scores = {name: Columns("tp", "fp", "fn", "wrong") for name in names}

    def add(self, record: Record, question: Callable[[Record], int]) -> None:
        """Append the sample of a record; of a new item, the number of its `question`."""
        item = (record.track, record.item)
        if item not in self.items:
            part = None if record.part is None else self._subtasks.of(record.part)
            about = {"scene": self.scenes.of(record.scene), "levels": record.levels}
            self._about.add(**about, subtask=part, question=question(record))
        self._rows.add(
            track=self._tracks.of(record.track),
            model=self._models.of(record.model),
            item=self.items.of(item),
            seed=record.seed,
            variant=self._variants.of(record.way.key),
            outcome=self._outcomes.of(record.outcome),
            correct=None if record.is_correct is None else int(record.is_correct),
        )
        listings = {listing.name: listing for listing in self._listings.get(record.track, ())}
        for name, columns in self._scores.items():
            listing = listings.get(name)
            listed = listing.score(record) if listing else None
            if listing is None or listed is None:
                columns.add(tp=None, fp=None, fn=None, wrong=None)
                continue
            # A bit for each type of wrong step.
            wrong = sum(1 << n for n, name in enumerate(listing.errors) if name in listed.errors)
            columns.add(tp=listed.tp, fp=listed.fp, fn=listed.fn, wrong=wrong)

    def columns(self) -> dict[str, Any]:
        """Return the index as the page takes it."""
        return {
            "tracks": list(self._tracks),
            "track_titles": [kinds()[name].title for name in self._tracks],
            "track_items": [kinds()[name].item for name in self._tracks],
            "models": list(self._models),
            "outcomes": list(self._outcomes),
            "subtasks": list(self._subtasks),
            "scenes": list(self.scenes),
            "seeds": sorted(set(self._rows["seed"])),
            "variants": list(self._variants),
            "listings": [
                [
                    {"name": one.name, "errors": one.errors, "is_counted": one.is_counted}
                    for one in self._listings.get(track, ())
                ]
                for track in self._tracks
            ],
            "matcher": self._matcher,
            "items": {
                "key": [key for _, key in self.items],
                **self._about,
            },
            "rows": {**self._rows, "scores": self._scores},
        }


def pack_samples(
    folder: Path,
    places: Iterable[Place],
    index: SampleIndex,
    packs: Mapping[str, Pack],
    sources: Sources,
    picture: Callable[[str], str | None],
    see: Callable[[Record, int], None],
) -> None:
    """Pack the newest record of every sample, its question and the prompts as sent; add it to the
    index.

    `picture` gives the address of a picture as seen from the page by the digest of its bytes. `see`
    is called with every record and its number.
    """
    sent_as = {
        line.sha256: packs["prompts"].add([message.fields() for message in line.messages])
        for _, line in PromptLines(folder)
    }

    def sent(prompt: SentPrompt | None) -> dict[str, Any] | None:
        if prompt is None:
            return None
        images = []
        for image in prompt.images:
            size = {"width_px": image.width_px, "height_px": image.height_px}
            images.append({"label": image.label, **size, "file": picture(image.sha256)})
        return {"template": prompt.template, "n": sent_as.get(prompt.messages), "images": images}

    for record in records_at(folder, places):
        index.add(record, lambda record: sources.question(record, packs["questions"]))
        entry = {name: value for name, value in record.fields().items() if name not in IN_INDEX}
        entry["prompt"] = sent(record.prompt)
        entry["scores"] = [
            {name: value for name, value in score.fields().items() if name not in _ONLY_IN_TABLES}
            for score in record.scores
        ]
        if record.asked_turns:
            turns = record.asked_turns
            entry["turns"] = [{**turn.fields(), "prompt": sent(turn.prompt)} for turn in turns]
        see(record, packs["records"].add(entry))


def pack_scenes(scenes: Iterable[str], sources: Sequence[Sources], pack: Pack) -> bool:
    """Pack the scenes of these names from the first source that has each; False if none has any."""
    is_drawn = False
    for scene in scenes:
        tasks = (source.tasks.get(scene) for source in sources)
        task = next((task for task in tasks if task is not None), None)
        is_drawn |= task is not None
        pack.add(task and scene_entry(task.scene, task.candidates))
    return is_drawn


def kit() -> dict[str, Any]:
    """Return shapes (vertices [m] and triangles in the body frame) and colors of all blocks."""
    shapes = {}
    for name in BLOCK_TYPES:
        mesh = solid_mesh(name)
        corners = [_rounded(corner) for corner in mesh.vertices_m.tolist()]
        shapes[name] = {"vertices": corners, "triangles": mesh.triangles.tolist()}
    return {"shapes": shapes, "colors": COLOR_RGB}


def scene_entry(scene: Scene, candidates: CandidateSet) -> dict[str, Any]:
    """Return a scene with its candidates, as pages take it.

    `depend` holds positions of blocks in the list, from 0; `candidate` is the number of the
    candidate that stands for the block in setting A, null where there is none.
    """
    blocks = []
    for vertex, block in enumerate(scene.blocks):
        depend, number = sorted(scene.graph.depends_on[vertex]), candidates.index_of(block.look)
        more = {"order": block.order, "depend": depend, "candidate": number}
        blocks.append({**_block_entry(block), **more})
    offered = [
        {"type": one.type, "color": one.color, "euler": _rounded(one.euler_deg)}
        for one in candidates.candidates
    ]
    return {"blocks": blocks, "candidates": offered}


def question_entry(question: Question) -> dict[str, Any]:
    """Return a question with the recipes of its pictures, as pages take it."""
    pictures = [
        {
            "label": picture.label,
            "view": list(picture.view_deg),
            "blocks": [_block_entry(block) for block in picture.blocks],
            "framed": [_block_entry(block) for block in picture.framed],
            "marks": [
                {"letter": mark.letter, "position": _rounded(mark.position_m)}
                for mark in picture.marks
            ],
        }
        for picture in question.pictures
    ]
    return {
        "id": question.id,
        "subtask": question.subtask,
        "text": question.text,
        "options": list(question.options),
        "answer": question.answer_letters,
        "pictures": pictures,
        "evidence": dict(question.evidence),
    }


def _block_entry(block: Block) -> dict[str, Any]:
    pose = {"position": _rounded(block.position_m), "euler": _rounded(block.euler_deg)}
    return {"type": block.type, "color": block.color, **pose}


def _rounded(values: Iterable[float]) -> list[float]:
    return [round(float(value), _DECIMALS) for value in values]


@dataclass(frozen=True)
class Sources:
    """Tasks by scene id, and items that are more than scenes by track; where there are none,
    `lacking` says why.
    """

    tasks: Mapping[str, AssemblyTask] = field(default_factory=dict)
    items: Mapping[str, Callable[[Record], Any]] = field(default_factory=dict)
    lacking: str = ""

    def question(self, record: Record, pack: Pack) -> int:
        """Pack the question that a record is about, as it was shown; -1 where there is none."""
        opener = self.items.get(record.track)
        shown = opener(record) if opener else None
        return pack.add(question_entry(shown.question)) if shown else -1


def open_sources(run: Run, data: Path | None) -> Sources:
    """Return the scenes of a run, from `data` or from where the run found them, and what else
    its tracks asked about. Without them a page shows every reply and score, but cannot draw.

    Raises DataError when `data` is given and is not what the run was made on.
    """
    try:
        dataset = recorded_dataset(run.path, run.manifest, data)
        openers = {name: kind_of(name).report().items for name in run.design.suite.tracks}
        facts = (run.path, run.manifest, dataset)
        items = {name: opener(*facts) for name, opener in openers.items() if opener}
        return Sources({task.scene.id: task for task in dataset.tasks}, items)
    except DataError as error:
        if data is not None:
            raise
        said = f"{error.problems[0].where}: {error.problems[0].message}"
        how = "phyblock report RUN --data FOLDER draws it from where it is now"
        return Sources(lacking=f"Nothing can be drawn without the data set ({said}); {how}.")


class SentPictures:
    """Pictures that were sent, put into `folder` as they are asked for by their digests.

    They are found in the picture cache and among the data set's own; nothing is rendered. Files are
    hard links into the cache where that is possible, else copies.
    """

    def __init__(self, folder: Path, earlier: Path, sources: Sources) -> None:
        """Take what `earlier` holds as there."""
        self._folder, self._earlier, self._sources = folder, earlier, sources

    @cached_property
    def _paths(self) -> dict[str, Path]:
        own = (task.composite for task in self._sources.tasks.values())
        paths = [*(cache_dir() / "pictures").glob("*/*.png"), *(path for path in own if path)]
        return {digest_of_file(path): path for path in paths}

    def name(self, digest: str) -> str | None:
        """Return the address of a picture from the page; None where it is not kept.

        Raises OSError where the disk refuses.
        """
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


def asset(name: str) -> bytes:
    """Return the content of a file that pages are made of."""
    return (files("phyblock.web") / "assets" / name).read_bytes()


def fill(template: str, scripts: Iterable[str], styles: Iterable[str], **facts: Any) -> str:
    """Return a page out of a template that is given `script`, `style`, the content security
    `policy` that lets these alone run, and `facts`; every text in it is escaped.
    """
    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    script, style = (
        "\n".join(asset(name).decode() for name in names) for names in (scripts, styles)
    )
    digests = (
        base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        for text in (script, style)
    )
    # `data:` lets the empty icon in that keeps browsers from asking for one.
    policy = (
        "default-src 'none'; script-src 'sha256-{}' 'self'; style-src 'sha256-{}'; "
        "img-src 'self' data:; base-uri 'none'; form-action 'none'"
    ).format(*digests)
    page = environment.from_string(asset(template).decode())
    return page.render(**facts, script=script, style=style, policy=policy)
