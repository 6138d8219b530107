"""Runs as data of pages: records, scenes and questions as JSON in scripts, and pictures as sent.

A page that was opened from disk may load scripts, but not fetch files. A script calls
`phyblockTake(build, name, text)`; the text is JSON, deflated, in base 64, so that nothing that a
model said is ever read as code.
"""

from __future__ import annotations

import base64
import errno
import hashlib
import json
import os
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

import jinja2

from phyblock.config.suite import FACTORS, ImagesSpec, with_values
from phyblock.data import AssemblyTask
from phyblock.errors import DataError
from phyblock.files import atomic_write
from phyblock.models import Image
from phyblock.records.files import PromptLines, RecordLines, run_records
from phyblock.records.record import Record, Score, SentPrompt
from phyblock.resources import cache_dir
from phyblock.results.design import Design
from phyblock.results.load import Run
from phyblock.run.plan import recorded_dataset
from phyblock.sim.pictures import PictureStyle
from phyblock.tracks.base import kind_of, kinds
from phyblock.tracks.measures import Listing, PageItems
from phyblock.tracks.pictures import Drawing, ScenePictures, Workshop

_CHUNK_CHARACTERS = 400_000
_COUNTED = ("tp", "fp", "fn", "wrong")
_DIGITS = 24
_MOST_COPIED_BYTES = 256 * 2**20
_NO_LINKS = (errno.EXDEV, errno.EPERM, errno.EMLINK, errno.ENOTSUP)
_ONLY_IN_TABLES = ("errors", "blocks", *Score.FURTHER)
IN_INDEX = frozenset(
    {
        *("sample", "track", "model", "key", "scene", "levels", "parents", "n_blocks", "seed"),
        *("variant", "outcome", "run"),
    }
)
"""Fields of records that the index has, or that are of no use on a page."""


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


def _to_json(data: object) -> str:
    return json.dumps(data, ensure_ascii=True, separators=(",", ":"), allow_nan=False)


def _write(folder: Path, name: str, build: str, text: str) -> None:
    packed = base64.b64encode(zlib.compress(text.encode("ascii"), 9)).decode("ascii")
    script = f"phyblockTake('{build}','{name}','{packed}')\n"
    (folder / f"{name}.js").write_text(script, encoding="ascii")


class Place(NamedTuple):
    """The place of the newest record of a sample in `records.jsonl` [bytes], and its sort keys."""

    track: str
    key: str
    model: str
    seed: int
    start: int


class Item(NamedTuple):
    """The subject of samples of one track."""

    track: str
    key: str


def read_places(folder: Path, design: Design) -> list[Place]:
    """Return every sample once: by track, item, then model in the suite's order, and seed.

    Raises StoreError for a line that is no record.
    """
    lines = run_records(folder)
    newest: dict[str, Place] = {}
    for _, record in lines:
        start = lines.start_bytes
        newest[record.sample] = Place(record.track, record.item, record.model, record.seed, start)
    tracks = {name: n for n, name in enumerate(design.suite.tracks)}
    models = {name: n for n, name in enumerate(design.model_names)}

    def order(place: Place) -> tuple[int, str, int, str, int]:
        track, model = tracks.get(place.track, len(tracks)), models.get(place.model, len(models))
        return track, place.key, model, place.model, place.seed

    return sorted(newest.values(), key=order)


class Numbers(dict[Any, int]):
    """Distinct values, numbered from 0 in the order in which they come."""

    def of(self, value: Any) -> int:
        """Return the number of a value, the next one where it is new."""
        return self.setdefault(value, len(self))


class SampleIndex:
    """Columns over all samples, and over the items that they are about."""

    def __init__(self, design: Design) -> None:
        self._design = design
        self._listings: dict[str, tuple[Listing, ...]] = {
            track: kind_of(track).report().listings(design) for track in design.suite.tracks
        }
        self.scenes, self.items = Numbers(), Numbers()
        # A model and a track without any record are in the run as well.
        self._tracks, self._models = Numbers(), Numbers()
        for numbers, names in (
            (self._tracks, design.suite.tracks),
            (self._models, design.model_names),
        ):
            for name in names:
                numbers.of(name)
        self._outcomes, self._subtasks, self._variants = Numbers(), Numbers(), Numbers()
        self._about: dict[str, list[Any]] = {"scene": [], "levels": [], "subtask": []}
        names = ("track", "model", "item", "seed", "variant", "outcome", "correct")
        self._rows: dict[str, list[Any]] = {name: [] for name in names}
        self._scores: dict[str, dict[str, list[float | None]]] = {
            listing.name: {part: [] for part in _COUNTED}
            for listings in self._listings.values()
            for listing in listings
        }

    def add(self, record: Record) -> None:
        """Append the sample of a record."""
        item = Item(record.track, record.item)
        if item not in self.items:
            part = record.part
            self._about["scene"].append(self.scenes.of(record.scene))
            self._about["levels"].append(record.levels)
            self._about["subtask"].append(None if part is None else self._subtasks.of(part))
        row = {
            "track": self._tracks.of(record.track),
            "model": self._models.of(record.model),
            "item": self.items.of(item),
            "seed": record.seed,
            "variant": self._variants.of(record.way.key),
            "outcome": self._outcomes.of(record.outcome),
            "correct": None if record.is_correct is None else int(record.is_correct),
        }
        for name, value in row.items():
            self._rows[name].append(value)
        listings = {listing.name: listing for listing in self._listings.get(record.track, ())}
        for setting, columns in self._scores.items():
            listing = listings.get(setting)
            listed = listing.score(record) if listing else None
            counts: Sequence[float | None] = [None] * len(_COUNTED)
            if listing and listed:
                # A bit for each type of wrong step.
                wrong = sum(
                    1 << n for n, name in enumerate(listing.errors) if name in listed.errors
                )
                counts = (listed.tp, listed.fp, listed.fn, wrong)
            for part, count in zip(_COUNTED, counts, strict=True):
                columns[part].append(count)

    def columns(self, questions: Mapping[Item, int]) -> dict[str, Any]:
        """Return the index as the page takes it; `questions` numbers items that have a question."""
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
            "matcher": self._design.matcher,
            "items": {
                "key": [item.key for item in self.items],
                **self._about,
                "question": [questions.get(item, -1) for item in self.items],
            },
            "rows": {**self._rows, "scores": self._scores},
        }


def records_at(folder: Path, places: Iterable[Place]) -> Iterable[Record]:
    """Read the records at these places, one at a time."""
    return RecordLines(folder).at(place.start for place in places)


def pack_prompts(folder: Path, pack: Pack) -> dict[str, int]:
    """Pack the prompts of a run as they were sent, and number them by digest."""
    return {
        line.sha256: pack.add([message.fields() for message in line.messages])
        for _, line in PromptLines(folder)
    }


def pack_samples(
    folder: Path,
    places: Iterable[Place],
    index: SampleIndex,
    pack: Pack,
    prompts: Mapping[str, int],
    pictures: Mapping[str, str],
) -> None:
    """Pack the newest record of every sample, and add it to the index.

    `pictures` are addresses of pictures as seen from the page, by the digest of their bytes.
    """

    def sent(prompt: SentPrompt | None) -> dict[str, Any] | None:
        if prompt is None:
            return None
        images = [
            {
                "label": image.label,
                "width_px": image.width_px,
                "height_px": image.height_px,
                "file": pictures.get(image.sha256),
            }
            for image in prompt.images
        ]
        return {"template": prompt.template, "n": prompts.get(prompt.messages), "images": images}

    for record in records_at(folder, places):
        index.add(record)
        entry = {name: value for name, value in record.fields().items() if name not in IN_INDEX}
        entry["prompt"] = sent(record.prompt)
        entry["scores"] = [
            {name: value for name, value in score.fields().items() if name not in _ONLY_IN_TABLES}
            for score in record.scores
        ]
        if record.asked_turns:
            entry["turns"] = [
                {**turn.fields(), "prompt": sent(turn.prompt)} for turn in record.asked_turns
            ]
        pack.add(entry)


def items_shown(
    folder: Path, places: Sequence[Place], known: Mapping[str, PageItems]
) -> dict[Item, Any]:
    """Return the subject of every item of the tracks in `known`, as it was shown."""
    first = {
        Item(place.track, place.key): place for place in reversed(places) if place.track in known
    }
    found = {}
    for record in records_at(folder, sorted(first.values(), key=lambda place: place.start)):
        shown = known[record.track].shown(record)
        if shown is not None:
            found[Item(record.track, record.item)] = shown
    return found


@dataclass(frozen=True)
class Sources:
    """Tasks by scene id, and items that are more than scenes by track; where there are none,
    `lacking` says why.
    """

    tasks: Mapping[str, AssemblyTask] = field(default_factory=dict)
    items: Mapping[str, PageItems] = field(default_factory=dict)
    lacking: str = ""


def open_sources(run: Run, data: Path | None) -> Sources:
    """Return the scenes of a run, from `data` or from where the run found them, and what else
    its tracks asked about. Without them a page shows every reply and score, but cannot draw.

    Raises DataError when `data` is given and is not what the run was made on.
    """
    try:
        dataset = recorded_dataset(run.path, run.manifest, run.design.suite.levels, data)
        openers = {name: kind_of(name).report().items for name in run.design.suite.tracks}
        items = {name: opener(run, dataset) for name, opener in openers.items() if opener}
        return Sources({task.scene.id: task for task in dataset.tasks}, items)
    except DataError as error:
        if data is not None:
            raise
        said = f"{error.problems[0].where}: {error.problems[0].message}"
        how = "phyblock report RUN --data FOLDER draws it from where it is now"
        return Sources(lacking=f"Nothing can be drawn without the data set ({said}); {how}.")


def images_of(run: Run) -> tuple[ImagesSpec, ...]:
    """Return what a run's suite says of pictures, in every condition that has other ones."""
    vary, images = run.design.suite.vary, run.section("images", ImagesSpec)
    found = {images: None}
    for variant in vary.variants:
        paths = ((FACTORS[factor] or (), factor, level) for factor, level in variant.levels)
        values = {
            path[1:]: vary.value(factor, level)
            for path, factor, level in paths
            if path[:1] == ("images",)
        }
        found[with_values(images, values)] = None
    return tuple(found)


def pictures_sent(folder: Path, places: Sequence[Place]) -> bool:
    """True if a model's first record of any track tells of a picture that was sent."""
    first = {(place.track, place.model): place for place in reversed(places)}
    return any(
        record.prompt is not None and record.prompt.images
        for record in records_at(folder, first.values())
    )


def states_sent(
    folder: Path, places: Iterable[Place], tasks: Mapping[str, AssemblyTask], style: PictureStyle
) -> Iterator[str]:
    """Yield names in the cache of the pictures that single turns of episodes were sent."""
    views = {name: kind.report().episodes for name, kind in kinds().items()}
    for record in records_at(folder, (place for place in places if views.get(place.track))):
        view, task = views[record.track], tasks.get(record.scene)
        if view is not None and task is not None and record.prompt is not None:
            yield from view.state_keys(record, task, style)


class PictureShelf:
    """A folder of pictures named by digest: `names` of those that are there, `is_whole` if all are.

    Nothing is rendered: a picture that is not in the cache is left out. Pictures are hard links
    into the cache; on a file system where that is not possible they are copied, up to 256 MiB.
    Methods raise OSError where the disk refuses.
    """

    def __init__(self, folder: Path, earlier: Path) -> None:
        """Put pictures into `folder` unless `earlier` holds them."""
        self.names: dict[str, str] = {}
        self.is_whole = True
        self._folder, self._earlier = folder, earlier
        self._cache = cache_dir() / "pictures"
        self._room = _MOST_COPIED_BYTES

    def add_scenes(self, tasks: Iterable[AssemblyTask], images: ImagesSpec) -> None:
        """Keep goals and candidates of tasks as they were shown, drawn as `images` says."""
        pictures = ScenePictures(Workshop(1, self._cache), images)
        for task in tasks:
            found, are_real = pictures.outline(task)
            keys = pictures.keys(task) if images.source == "render" else [""] * len(found)
            self._keep(found if are_real else None, keys)

    def add_items(self, items: PageItems, asked: Iterable[Any], style: PictureStyle) -> None:
        """Keep the pictures of what was asked about."""
        pictures = items.pictures(self._cache, style)
        for shown in asked:
            found, are_real = pictures.outline(shown)
            self._keep(found if are_real else None, pictures.keys(shown) if are_real else ())

    def add_kept(self, keys: Iterable[str]) -> None:
        """Keep pictures by their names in the cache."""
        shop = Workshop(1, self._cache)
        for key in dict.fromkeys(keys):
            found = shop.kept(Drawing("", key, bytes))
            self._keep(None if found is None else (found,), (key,))

    def _keep(self, images: Sequence[Image] | None, keys: Sequence[str]) -> None:
        if images is None:
            self.is_whole = False
            return
        for image, key in zip(images, keys, strict=True):
            name = f"{image.sha256[:_DIGITS]}.png"
            path, source = self._folder / name, self._cache / key[:2] / f"{key}.png"
            is_there = (self._earlier / name).exists() or path.exists()
            if is_there or self._put(path, image.data, source if key else None):
                self.names[image.sha256] = name
            else:
                self.is_whole = False

    def _put(self, path: Path, data: bytes, source: Path | None) -> bool:
        """Link or copy a picture; False where it would have to be copied and there is no room."""
        if source is not None and source.is_file():
            try:
                os.link(source, path)
            except OSError as error:
                if error.errno not in _NO_LINKS:
                    raise
            else:
                return True
        self._room -= len(data)
        if self._room < 0:
            return False
        atomic_write(path, data)
        return True


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
