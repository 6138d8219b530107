"""A question as an eye has it that reads nothing: its pictures and the marks in them, as pixels."""

from __future__ import annotations

from dataclasses import dataclass, replace

from phyblock.domain.question import LETTERS, Question, QuestionPicture
from phyblock.sim.render import Shot
from phyblock.sim.seeing import Top, mark_pixel, seen, surface_at

__all__ = ["Look", "Spot", "look_at"]


@dataclass(frozen=True, eq=False)
class Spot:
    """A mark: where it shows as (row, column) [pixels of `SEEN_PX`], and on what, if on a block."""

    pixel: tuple[int, int]
    surface: Top | None


@dataclass(frozen=True, eq=False)
class Look:
    """The pictures of a question at `SEEN_PX`, their floor left out.

    `options` are the pictures of options, none where options are no pictures; `spots` the marks A
    to D where they stand for the options, `other_spots` further marks such as X.
    """

    question: Question
    scene: Shot | None
    options: tuple[Shot, ...]
    spots: tuple[Spot, ...]
    other_spots: tuple[Spot, ...]


def look_at(question: Question) -> Look:
    """Draw what a question shows; nothing is drawn where its options are texts about no marks."""
    pictures = {picture.label: picture for picture in question.pictures}
    options = tuple(seen(pictures[letter]) for letter in LETTERS if letter in pictures)
    first = pictures.get("scene")
    marked = {mark.letter: mark for mark in first.marks} if first is not None else {}
    has_spots = not options and set(LETTERS) <= set(marked)
    if first is None or not (options or has_spots):
        return Look(question, None, options, (), ())
    plain = replace(first, marks=())
    shot = seen(plain)
    if not has_spots:
        return Look(question, shot, options, (), ())
    spots = {letter: _spot(plain, shot, mark.position_m) for letter, mark in marked.items()}
    others = tuple(spot for letter, spot in spots.items() if letter not in LETTERS)
    return Look(question, shot, options, tuple(spots[letter] for letter in LETTERS), others)


def _spot(plain: QuestionPicture, shot: Shot, position_m: tuple[float, float, float]) -> Spot:
    return Spot(mark_pixel(plain, position_m), surface_at(plain, shot, position_m))
