"""Records as the page shows them, in chunks, read one at a time."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from phyblock.data import AssemblyTask
from phyblock.records.files import PromptLines, RecordLines
from phyblock.records.record import Record, Score, SentPrompt
from phyblock.report.html.index import Item, Place, SampleIndex
from phyblock.report.html.pack import Pack
from phyblock.sim.pictures import PictureStyle
from phyblock.tracks.kind import kinds
from phyblock.tracks.measures import PageItems

__all__ = [
    "IN_INDEX",
    "items_shown",
    "pack_prompts",
    "pack_samples",
    "pictures_sent",
    "states_sent",
]

IN_INDEX = frozenset(
    {
        *("sample", "track", "model", "key", "scene", "levels", "parents", "n_blocks", "seed"),
        *("variant",),
        *("outcome", "run"),
    }
)
"""Fields of records that the index has, or that are of no use on a page."""


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
    for record in _records(folder, places):
        index.add(record)
        pack.add(_entry(record, prompts, pictures))


def pictures_sent(folder: Path, places: Sequence[Place]) -> bool:
    """Whether a model's first record of any track tells of a picture that was sent."""
    first = {(place.track, place.model): place for place in reversed(places)}
    return any(
        record.prompt is not None and record.prompt.images
        for record in _records(folder, first.values())
    )


def states_sent(
    folder: Path,
    places: Iterable[Place],
    tasks: Mapping[str, AssemblyTask],
    style: PictureStyle,
) -> Iterator[str]:
    """Names in the cache of the pictures that single turns of episodes were sent."""
    views = {name: kind.report().episodes for name, kind in kinds().items()}
    for record in _records(folder, (place for place in places if views.get(place.track))):
        view, task = views[record.track], tasks.get(record.scene)
        if view is not None and task is not None and record.prompt is not None:
            yield from view.state_keys(record, task, style)


def items_shown(
    folder: Path, places: Sequence[Place], known: Mapping[str, PageItems]
) -> dict[Item, Any]:
    """What every item of the tracks in `known` was about, as it was shown."""
    first = {
        Item(place.track, place.key): place for place in reversed(places) if place.track in known
    }
    first_asked = sorted(first.values(), key=lambda place: place.start)
    shown = {}
    for record in _records(folder, first_asked):
        found = known[record.track].shown(record)
        if found is not None:
            shown[Item(record.track, record.item)] = found
    return shown


def _records(folder: Path, places: Iterable[Place]) -> Iterable[Record]:
    return RecordLines(folder).at(place.start for place in places)


def _entry(
    record: Record, prompts: Mapping[str, int], pictures: Mapping[str, str]
) -> dict[str, Any]:
    entry = {name: value for name, value in record.fields().items() if name not in IN_INDEX}
    entry["prompt"] = _prompt(record.prompt, prompts, pictures)
    entry["scores"] = [_score(score.fields()) for score in record.scores]
    if record.asked_turns:
        entry["turns"] = [
            {**turn.fields(), "prompt": _prompt(turn.prompt, prompts, pictures)}
            for turn in record.asked_turns
        ]
    return entry


def _prompt(
    prompt: SentPrompt | None, prompts: Mapping[str, int], pictures: Mapping[str, str]
) -> dict[str, Any] | None:
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


_COUNTED = ("errors", "blocks", *Score.FURTHER)
"""Numbers of a score that stand in tables alone."""


def _score(score: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in score.items() if name not in _COUNTED}
