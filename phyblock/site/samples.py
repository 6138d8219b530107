"""All samples of a site: an index of scores as columns, and what a replay needs, in chunks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from phyblock.records.files import RecordLines
from phyblock.records.record import Record
from phyblock.report.html.index import Numbers, read_places
from phyblock.report.html.pack import Pack
from phyblock.report.html.samples import IN_INDEX
from phyblock.results.load import Run
from phyblock.site.chunks import chunks
from phyblock.site.entries import Entry
from phyblock.site.runs import SiteRun
from phyblock.site.values import AllValues, TrackValues
from phyblock.tracks.kind import kind_of
from phyblock.tracks.pictures import scene_entry

__all__ = ["write_samples"]

_LONGEST_TEXT = 6000
"""Characters of a reply that a site shows; the bundle has all of it."""
_LONGEST_REASONING = 2000
_LEFT_OUT = IN_INDEX | {"reply", "scores", "turns", "prompt", "asked", "time", "counts"}
"""Fields of records that a replay needs otherwise or not at all; what tracks add, it has."""
_REPLY = ("text", "reasoning", "finish", "cost_usd", "usage", "latency_s")
_NOT_OF_TURN = ("reply", "prompt")
_TENTHS = 10


class _Items:
    """What was asked: columns, a row an item of a track."""

    def __init__(self) -> None:
        self._items = Numbers()
        self._about: dict[str, list[Any]] = {
            name: [] for name in ("scene", "levels", "part", "question")
        }

    def __contains__(self, key: tuple[str, str]) -> bool:
        return key in self._items

    def add(self, record: Record, scene: int, question: int) -> None:
        """Take the item of a record, whose scene and question have these numbers."""
        self._items.of((record.track, record.item))
        row = {"scene": scene, "levels": list(record.levels), "part": record.part}
        for name, value in {**row, "question": question}.items():
            self._about[name].append(value)

    def number(self, record: Record) -> int:
        return self._items.of((record.track, record.item))

    def fields(self) -> dict[str, Any]:
        tracks = Numbers()
        of_track = [tracks.of(track) for track, _ in self._items.values]
        keys = [key for _, key in self._items.values]
        return {
            "tracks": tracks.values,
            "items": {"track": of_track, "key": keys, **self._about},
        }


class _Samples:
    """What became of it: columns, a row a sample."""

    def __init__(self) -> None:
        self._outcomes, self._ways = Numbers(), Numbers()
        names = ("entry", "item", "seed", "way", "outcome", "score")
        self._rows: dict[str, list[int | None]] = {name: [] for name in names}

    def add(self, record: Record, entry: int, item: int, values: TrackValues) -> None:
        samples = values.samples.get(record.model, {})
        score = samples.get((record.scene, record.item, record.seed, record.way.key))
        row = {
            "entry": entry,
            "item": item,
            "seed": record.seed,
            "way": self._ways.of(record.way.key),
            "outcome": self._outcomes.of(record.outcome),
            "score": None if score is None else round(score * _TENTHS),
        }
        for name, value in row.items():
            self._rows[name].append(value)

    def fields(self) -> dict[str, Any]:
        return {
            "outcomes": self._outcomes.values,
            "ways": self._ways.values,
            "rows": self._rows,
        }


def write_samples(
    folder: Path,
    build: str,
    runs: Sequence[SiteRun],
    entries: Sequence[Entry],
    values: AllValues,
) -> dict[str, Any]:
    """Write the chunks of single samples; the index of all samples as columns, and of items.

    Raises OSError where the disk refuses, StoreError for a record that cannot be read.
    """
    packs = {kind: chunks(folder, kind, build) for kind in ("replays", "scenes", "questions")}
    scenes, items, samples = Numbers(), _Items(), _Samples()
    owner = {
        (number, track, entry.model.name): place
        for place, entry in enumerate(entries)
        for track, number in entry.runs.items()
    }
    for number, one in enumerate(runs):
        for record in _records(one.run):
            if (record.track, record.item) not in items:
                question = _question(one, record, packs["questions"])
                items.add(record, scenes.of(record.scene), question)
            samples.add(
                record,
                owner[number, record.track, record.model],
                items.number(record),
                values[number, record.track],
            )
            packs["replays"].add(_replay(record, one.run))
    drawn = [_scene(scene, runs) for scene in scenes.values]
    for entry in drawn:
        packs["scenes"].add(entry)
    for pack in packs.values():
        pack.close()
    return {
        **items.fields(),
        **samples.fields(),
        "scenes": scenes.values,
        "starts": {kind: pack.starts for kind, pack in packs.items()},
        "parts": _part_names(runs),
        "lacking": "" if any(drawn) else next((one.sources.lacking for one in runs), ""),
    }


def _records(run: Run) -> Iterator[Record]:
    """The newest record of every sample that is of the suite, model by model: what one model says
    packs best together.
    """
    order = {name: place for place, name in enumerate(run.design.model_names)}
    known = set(run.design.suite.tracks)
    places = [place for place in read_places(run.path, run.design) if place.track in known]
    places.sort(key=lambda place: order.get(place.model, len(order)))
    yield from RecordLines(run.path).at(place.start for place in places)


def _scene(scene: str, runs: Sequence[SiteRun]) -> dict[str, Any] | None:
    tasks = (one.sources.tasks.get(scene) for one in runs)
    task = next((task for task in tasks if task is not None), None)
    return None if task is None else scene_entry(task.scene, task.candidates)


def _question(one: SiteRun, record: Record, pack: Pack) -> int:
    """The number of what was asked, where it is more than a scene and at hand; else -1."""
    items = one.sources.items.get(record.track)
    shown = None if items is None else items.shown(record)
    return -1 if items is None or shown is None else pack.add(dict(items.entry(shown)))


def _replay(record: Record, run: Run) -> dict[str, Any]:
    fields = record.fields()
    entry = {
        name: value for name, value in fields.items() if name not in _LEFT_OUT and value is not None
    }
    if record.reply is not None:
        entry["reply"] = _reply(fields["reply"])
    entry["scores"] = [
        {name: score.get(name) for name in ("setting", "tp", "fp", "fn", "placed", "why")}
        for score in fields["scores"]
        if score.get("matcher") in (None, run.design.matcher) and score.get("placed") is not None
    ]
    if record.asked_turns:
        entry["turns"] = [
            {
                **{name: value for name, value in turn.items() if name not in _NOT_OF_TURN},
                "reply": _reply(turn["reply"]),
            }
            for turn in fields["turns"]
        ]
        entry.pop("reply", None)
    return entry


def _reply(reply: Mapping[str, Any]) -> dict[str, Any]:
    kept = {name: reply[name] for name in _REPLY if reply.get(name) not in (None, "")}
    for name, most in (("text", _LONGEST_TEXT), ("reasoning", _LONGEST_REASONING)):
        if len(text := kept.get(name, "")) > most:
            kept |= {name: text[:most], f"{name}_characters": len(text)}
    return kept


def _part_names(runs: Sequence[SiteRun]) -> dict[str, str]:
    names: dict[str, str] = {}
    for one in runs:
        for track in one.run.design.suite.tracks:
            names |= kind_of(track).report().part_names
    return names
