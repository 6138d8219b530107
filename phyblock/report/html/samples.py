"""Records as the page shows them, in chunks, read one at a time."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from phyblock.datasets import QuestionTask
from phyblock.report.html.index import Item, Place, SampleIndex, item_key
from phyblock.report.html.pack import Pack
from phyblock.run.prompts import PromptLines
from phyblock.run.reading import RECORDS
from phyblock.tracks.vqa.pictures import Shown
from phyblock.tracks.vqa.track import asked

__all__ = ["pack_prompts", "pack_samples", "pictures_sent", "questions_asked"]

_IN_INDEX = frozenset(
    {
        *("sample", "track", "model", "key", "scene", "levels", "parents", "n_blocks", "seed"),
        "outcome",
    }
)


def pack_prompts(folder: Path, pack: Pack) -> dict[str, int]:
    """Pack the prompts of a run as they were sent, and number them by digest."""
    return {line["sha256"]: pack.add(line["messages"]) for _, line in PromptLines(folder)}


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
    """Whether the first record of any track tells of a picture that was sent."""
    first = {place.track: place for place in reversed(places)}
    return any(
        (record.get("prompt") or {}).get("images") for record in _records(folder, first.values())
    )


def questions_asked(
    folder: Path, places: Sequence[Place], questions: Mapping[str, QuestionTask]
) -> dict[Item, Shown]:
    """The question of every item that is one, as it was shown; {} without `questions`."""
    if not questions:
        return {}
    first = {Item(place.track, place.key): place for place in reversed(places)}
    asked_first = [place for place in first.values() if place.track == "vqa"]
    shown = {}
    for record in _records(folder, sorted(asked_first, key=lambda place: place.start)):
        about = record["question"]
        if about["id"] in questions:
            task = asked(questions[about["id"]], about["rotation"])
            shown[Item(record["track"], item_key(record))] = task.shown
    return shown


def _records(folder: Path, places: Iterable[Place]) -> Iterable[dict[str, Any]]:
    path = folder / RECORDS
    if not path.exists():
        return
    with path.open("rb") as file:
        for place in places:
            file.seek(place.start)
            yield json.loads(file.readline())


def _entry(
    record: Mapping[str, Any], prompts: Mapping[str, int], pictures: Mapping[str, str]
) -> dict[str, Any]:
    entry = {name: value for name, value in record.items() if name not in _IN_INDEX}
    entry["prompt"] = _prompt(record.get("prompt"), prompts, pictures)
    entry["scores"] = [_score(score) for score in record["scores"]]
    if record.get("turns") is not None:
        entry["turns"] = [
            {**turn, "prompt": _prompt(turn.get("prompt"), prompts, pictures)}
            for turn in record["turns"]
        ]
    return entry


def _prompt(
    prompt: Mapping[str, Any] | None, prompts: Mapping[str, int], pictures: Mapping[str, str]
) -> dict[str, Any] | None:
    if prompt is None:
        return None
    images = [
        {
            **{name: image[name] for name in ("label", "width_px", "height_px")},
            "file": pictures.get(image["sha256"]),
        }
        for image in prompt.get("images") or ()
    ]
    digest = prompt.get("messages")
    return {"template": prompt.get("template"), "n": prompts.get(digest or ""), "images": images}


def _score(score: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in score.items() if name != "errors"}
