"""What a page is given of a request: its messages as a model is sent them, and what to pick.

Nothing else of an item is in it: no name, no scene, no answer.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from phyblock.models import Image, Request
from phyblock.tracks.by_hand import Choice, Picking

__all__ = ["Place", "pictures_of", "shown"]


@dataclass(frozen=True)
class Place:
    """Where a question stands: the item's number from 1, of how many, and the turn there."""

    number: int
    of: int
    turn: int = 1


def pictures_of(request: Request) -> tuple[Image, ...]:
    """Every picture of a request in the order sent."""
    return tuple(
        part for message in request.messages for part in message.parts if isinstance(part, Image)
    )


def shown(
    request: Request, picking: Picking, place: Place, addresses: Sequence[str]
) -> dict[str, Any]:
    """A question as the page takes it; `addresses` are those of its pictures, in order."""
    pictures = pictures_of(request)
    last = {picture.label: number for number, picture in enumerate(pictures)}
    left = iter(zip(pictures, addresses, strict=True))
    return {
        "number": place.number,
        "of": place.of,
        "turn": place.turn,
        "messages": [
            {"role": message.role, "parts": [_part(part, left) for part in message.parts]}
            for message in request.messages
        ],
        "choices": [
            {"name": choice.name, "text": choice.text, "spots": _spots(choice, pictures, last)}
            for choice in picking.choices
        ],
        "least": picking.least,
        "most": picking.most,
        "repeats": picking.repeats,
        "noun": picking.noun,
        "fields": [asdict(field) for field in picking.fields],
    }


def _part(part: str | Image, left: Iterator[tuple[Image, str]]) -> dict[str, Any]:
    if isinstance(part, str):
        return {"text": part}
    picture, address = next(left)
    return {
        "picture": address,
        "label": picture.label,
        "width": picture.width_px,
        "height": picture.height_px,
    }


def _spots(
    choice: Choice, pictures: Sequence[Image], last: Mapping[str, int]
) -> list[dict[str, Any]]:
    """Where a choice is seen, by the number of the picture and shares of its sides."""
    found = []
    for spot in choice.spots:
        number = last.get(spot.label)
        if number is not None:
            picture = pictures[number]
            box = spot.box(picture.width_px, picture.height_px)
            found.append({"picture": number, "box": box})
    return found
