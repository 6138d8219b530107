"""The index of all samples: what filters and the list need, as columns."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from phyblock.records.files import run_records
from phyblock.records.record import Record
from phyblock.results.design import Design
from phyblock.tracks.kind import kind_of, kinds
from phyblock.tracks.measures import Listing

__all__ = ["Item", "Numbers", "Place", "SampleIndex", "read_places"]

_COUNTED = ("tp", "fp", "fn", "wrong")


class Place(NamedTuple):
    """Where the newest record of a sample stands in `records.jsonl` [bytes], and what sorts it."""

    track: str
    key: str
    model: str
    seed: int
    start: int


class Item(NamedTuple):
    """What samples of one track are about."""

    track: str
    key: str


def read_places(folder: Path, design: Design) -> list[Place]:
    """Every sample once: by track, item, then model in the suite's order, and seed.

    Raises StoreError for a line that is no record.
    """
    lines = run_records(folder)
    newest: dict[str, Place] = {}
    for _, record in lines:
        start = lines.start_bytes
        newest[record.sample] = Place(record.track, record.item, record.model, record.seed, start)
    tracks = {name: n for n, name in enumerate(design.suite.tracks)}
    models = {name: n for n, name in enumerate(design.model_names)}
    return sorted(
        newest.values(),
        key=lambda place: (
            tracks.get(place.track, len(tracks)),
            place.key,
            models.get(place.model, len(models)),
            place.model,
            place.seed,
        ),
    )


class Numbers:
    """Numbers distinct values from 0, in the order in which they come."""

    def __init__(self, values: Iterable[Any] = ()) -> None:
        self._numbers: dict[Any, int] = {}
        for value in values:
            self.of(value)

    def of(self, value: Any) -> int:
        """The number of a value, the next one where it is new."""
        return self._numbers.setdefault(value, len(self._numbers))

    def __contains__(self, value: Any) -> bool:
        """Whether a value has a number."""
        return value in self._numbers

    @property
    def values(self) -> list[Any]:
        """All values, by number."""
        return list(self._numbers)


class SampleIndex:
    """Columns over all samples, and over the items that they are about."""

    def __init__(self, design: Design) -> None:
        self._listings: dict[str, tuple[Listing, ...]] = {
            track: kind_of(track).report().listings(design) for track in design.suite.tracks
        }
        self._scenes, self._items = Numbers(), Numbers()
        # A model and a track without any record are in the run as well.
        self._tracks, self._models = Numbers(design.suite.tracks), Numbers(design.model_names)
        self._outcomes = Numbers()
        self._subtasks, self._variants = Numbers(), Numbers()
        self._seeds: set[int] = set()
        self._about: dict[str, list[Any]] = {"scene": [], "levels": [], "subtask": []}
        names = ("track", "model", "item", "seed", "variant", "outcome", "correct")
        self._rows: dict[str, list[Any]] = {name: [] for name in names}
        self._scores: dict[str, dict[str, list[float | None]]] = {
            listing.name: {part: [] for part in _COUNTED}
            for listings in self._listings.values()
            for listing in listings
        }
        self._matcher = design.matcher

    @property
    def scenes(self) -> list[str]:
        """Ids of the scenes in the order of their numbers."""
        return self._scenes.values

    @property
    def items(self) -> list[Item]:
        """The items in the order of their numbers."""
        return self._items.values

    def add(self, record: Record) -> None:
        """Append the sample of a record."""
        item = Item(record.track, record.item)
        if item not in self._items:
            self._add_item(record)
        self._seeds.add(record.seed)
        row = {
            "track": self._tracks.of(record.track),
            "model": self._models.of(record.model),
            "item": self._items.of(item),
            "seed": record.seed,
            "variant": self._variants.of(record.way.key),
            "outcome": self._outcomes.of(record.outcome),
            "correct": None if record.is_correct is None else int(record.is_correct),
        }
        for name, value in row.items():
            self._rows[name].append(value)
        listings = {listing.name: listing for listing in self._of(record.track)}
        for setting, columns in self._scores.items():
            for part, count in _score(record, listings.get(setting)).items():
                columns[part].append(count)

    def _add_item(self, record: Record) -> None:
        part = record.part
        self._about["scene"].append(self._scenes.of(record.scene))
        self._about["levels"].append(record.levels)
        self._about["subtask"].append(None if part is None else self._subtasks.of(part))

    def _of(self, track: str) -> tuple[Listing, ...]:
        return self._listings.get(track, ())

    def columns(self, questions: Mapping[Item, int]) -> dict[str, Any]:
        """The index as the page takes it; `questions` numbers the items that have a question."""
        items = self.items
        return {
            "tracks": self._tracks.values,
            "track_titles": [kinds()[name].title for name in self._tracks.values],
            "track_items": [kinds()[name].item for name in self._tracks.values],
            "models": self._models.values,
            "outcomes": self._outcomes.values,
            "subtasks": self._subtasks.values,
            "scenes": self.scenes,
            "seeds": sorted(self._seeds),
            "variants": self._variants.values,
            "listings": [
                [
                    {"name": one.name, "errors": one.errors, "is_counted": one.is_counted}
                    for one in self._of(track)
                ]
                for track in self._tracks.values
            ],
            "matcher": self._matcher,
            "items": {
                "key": [item.key for item in items],
                **self._about,
                "question": [questions.get(item, -1) for item in items],
            },
            "rows": {**self._rows, "scores": self._scores},
        }


def _score(record: Record, listing: Listing | None) -> dict[str, float | None]:
    """What a listing says of a sample, with a bit for each type of wrong step."""
    listed = listing.score(record) if listing else None
    if listing is None or listed is None:
        return dict.fromkeys(_COUNTED)
    wrong = sum(1 << n for n, name in enumerate(listing.errors) if name in listed.errors)
    return dict(zip(_COUNTED, (listed.tp, listed.fp, listed.fn, wrong), strict=True))
