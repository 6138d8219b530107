"""What the makers of static subtasks share: one goal view, wordings, options that are texts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from phyblock.domain.question import Question
from phyblock.domain.scene import Block, Scene
from phyblock_making.questions.goal_view import goal_picture, shares
from phyblock_making.questions.question_draft import Draft, UnfairError
from phyblock_making.questions.referring import Feature, names
from phyblock_making.questions.wording import fill, wording_ids

__all__ = [
    "StaticMaker",
    "draft",
    "index_of",
    "name_one",
    "others",
    "pick",
    "seen_blocks",
    "shuffled",
    "window",
]

T = TypeVar("T")
_NAMES_DRAWN_FROM = 3


class StaticMaker:
    """Drafts cost little, so every scene is asked."""

    scenes_tried: int = 400
    drafts_a_scene: int = 12


def draft(
    scene: Scene,
    stem: str,
    rng: np.random.Generator,
    slots: Mapping[str, str],
    options: Sequence[str],
    value: str,
    kind: str = "",
    **evidence: Any,
) -> Draft:
    """A draft about the goal view, in a wording drawn from those of a stem; right option first."""
    wording = pick(wording_ids(stem), rng)
    return Draft(
        scene=scene,
        text=fill(wording, **slots),
        options=tuple(options),
        pictures=(goal_picture(scene),),
        wording=wording,
        value=value,
        kind=kind,
        evidence={"slots": dict(slots), **evidence},
    )


def pick(options: Sequence[T], rng: np.random.Generator) -> T:
    """One of the options, all alike."""
    return options[int(rng.integers(len(options)))]


def shuffled(items: Sequence[T], rng: np.random.Generator) -> list[T]:
    """The items in an order drawn with `rng`."""
    return [items[int(i)] for i in rng.permutation(len(items))]


def others(
    allowed: Sequence[str], right: str, rng: np.random.Generator, count: int = 3
) -> list[str]:
    """`count` of the allowed that are not the right one."""
    return shuffled([option for option in allowed if option != right], rng)[:count]


def seen_blocks(scene: Scene, least: float) -> list[Block]:
    """The blocks that show at least this share of themselves in the goal view."""
    seen = shares(scene.blocks)
    return [block for block in scene.blocks if seen[block.order] >= least]


def name_one(
    block: Block, scene: Scene, features: Sequence[Feature], rng: np.random.Generator
) -> str | None:
    """One of the shortest expressions that fit a block alone, or None when nothing does."""
    found = names(block, scene.blocks, features)
    return pick(found[:_NAMES_DRAWN_FROM], rng) if found else None


def window(values: Sequence[int], right: int, rng: np.random.Generator) -> tuple[int, ...] | None:
    """Four neighbors among the allowed values that hold the right one, in a place drawn evenly.

    The right one stands first. None where it is not allowed, or the place drawn does not exist.
    """
    if right not in values:
        return None
    start = values.index(right) - int(rng.integers(4))
    if start < 0 or start + 4 > len(values):
        return None
    chosen = values[start : start + 4]
    return (right, *(value for value in chosen if value != right))


def index_of(question: Question, right: str) -> tuple[int, ...]:
    """Where the right option stands; UnfairError unless exactly one option says so."""
    places = [i for i, option in enumerate(question.options) if option == right]
    if len(places) != 1:
        raise UnfairError(f"the right answer {right!r} is {len(places)} of the options")
    return (places[0],)
