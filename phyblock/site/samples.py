"""All samples of a site: an index of scores as columns, and what a replay needs, in chunks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from phyblock.records import Record
from phyblock.records.reading import any_records
from phyblock.report.html.index import read_places
from phyblock.report.html.pack import Pack
from phyblock.report.html.samples import IN_INDEX
from phyblock.site.chunks import chunks
from phyblock.site.entries import Entry
from phyblock.site.runs import SiteRun
from phyblock.site.values import AllValues
from phyblock.tables.load import Run
from phyblock.tracks.drawable import scene_entry
from phyblock.tracks.kind import kind_of

__all__ = ["write_samples"]

_LONGEST_TEXT = 6000
"""Characters of a reply that a site shows; the bundle has all of it."""
_LONGEST_REASONING = 2000
_LEFT_OUT = IN_INDEX | {"reply", "scores", "turns", "prompt", "asked", "time", "counts"}
"""Fields of records that a replay needs otherwise or not at all; what tracks add, it has."""
_REPLY = ("text", "reasoning", "finish", "cost_usd", "usage", "latency_s")
_NOT_OF_TURN = ("reply", "prompt")
_TENTHS = 10


class _Numbers:
    """Distinct values in the order they came, by number."""

    def __init__(self) -> None:
        self._numbers: dict[Any, int] = {}

    def of(self, value: Any) -> int:
        return self._numbers.setdefault(value, len(self._numbers))

    def __contains__(self, value: Any) -> bool:
        return value in self._numbers

    @property
    def values(self) -> list[Any]:
        return list(self._numbers)


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
    tracks, scenes, items, outcomes, ways = (_Numbers() for _ in range(5))
    about: dict[str, list[Any]] = {name: [] for name in ("scene", "levels", "part", "question")}
    names = ("entry", "item", "seed", "way", "outcome", "score")
    rows: dict[str, list[int | None]] = {name: [] for name in names}
    owner = {
        (number, track, entry.model.name): place
        for place, entry in enumerate(entries)
        for track, number in entry.runs.items()
    }
    for number, one in enumerate(runs):
        for record in _records(one.run):
            item = (tracks.of(record.track), record.item)
            if item not in items:
                items.of(item)
                about["scene"].append(scenes.of(record.scene))
                about["levels"].append(list(record.levels))
                about["part"].append(record.part)
                about["question"].append(_question(one, record, packs["questions"]))
            samples = values[number, record.track].samples.get(record.model, {})
            score = samples.get((record.scene, record.item, record.seed, record.way.key))
            row = {
                "entry": owner[number, record.track, record.model],
                "item": items.of(item),
                "seed": record.seed,
                "way": ways.of(record.way.key),
                "outcome": outcomes.of(record.outcome),
                "score": None if score is None else round(score * _TENTHS),
            }
            for name, value in row.items():
                rows[name].append(value)
            packs["replays"].add(_replay(record, one.run))
    drawn = [_scene(scene, runs) for scene in scenes.values]
    for entry in drawn:
        packs["scenes"].add(entry)
    for pack in packs.values():
        pack.close()
    return {
        "tracks": tracks.values,
        "scenes": scenes.values,
        "outcomes": outcomes.values,
        "ways": ways.values,
        "items": {
            "track": [track for track, _ in items.values],
            "key": [key for _, key in items.values],
            **about,
        },
        "rows": rows,
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
    yield from any_records(run.path).at(place.start for place in places)


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
