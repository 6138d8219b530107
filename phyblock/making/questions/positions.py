"""Relative position: where one block is from another, and which block is outermost or nearest."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

import numpy as np

from phyblock.domain.question import Question, QuestionPicture, Subtask
from phyblock.domain.scene import Block, Scene
from phyblock.making.questions.measures import offset_m, top_m
from phyblock.making.questions.picture_view import (
    NAMED,
    View,
    center_m,
    goal_picture,
    outermost,
    picture_axes,
    require_seen,
    shown_picture,
)
from phyblock.making.questions.properties import recolored
from phyblock.making.questions.question_draft import Draft, UnfairError
from phyblock.making.questions.referring import Feature, names, resolve_one
from phyblock.making.questions.selection import pick, shuffled
from phyblock.making.questions.static_drafts import StaticMaker, draft, index_of, seen_blocks
from phyblock.making.questions.wording import slots_of, stem_of
from phyblock.sim.contact import bounds_m

__all__ = ["PositionMaker"]

_PLAIN: tuple[Feature, ...] = ("color", "type")
_CORNERS: tuple[str, ...] = (
    "in front and to the left",
    "in front and to the right",
    "behind and to the left",
    "behind and to the right",
)
_UPRIGHT: tuple[str, ...] = (
    "above it",
    "below it",
    "to its left, at the same height",
    "to its right, at the same height",
)
_CLEAR_M = 0.03
_ABOVE_M = 0.015
_LEVEL_M = 0.005
_TRIES = 5
_FOURS = 6
_SIDES = ("farthest left", "farthest right")
_RANKED = ("highest", "lowest", "front", "back")
"""Told by wordings of their own, because they are not about the picture but about the ground."""
_GAP_M = 0.024
_NEARER = 0.75
"""The nearest block is at most this share of the next one's distance away."""


class PositionMaker(StaticMaker):
    """RP: as seen in the picture; scenes are recolored so that most blocks have a name."""

    subtask: Subtask = "RP"
    drafts_a_view = 16

    def seen_from(self, view: View, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Pairs of blocks, and choices of one of four."""
        for _ in range(_TRIES):
            shown = recolored(scene, rng)
            picture = goal_picture(shown, view)
            named = {
                block.order: expressions[0]
                for block in seen_blocks(picture, NAMED)
                if (expressions := names(block, picture, _PLAIN))
            }
            for _ in range(_FOURS):
                yield from _of_four(shown, picture, named, rng)
            yield from _of_pairs(shown, picture, named, rng)

    def rederive(self, question: Question) -> tuple[int, ...]:
        """From the places of the blocks that the text or the options name."""
        picture, slots = shown_picture(question), slots_of(question)
        if "block" not in slots:
            named = [resolve_one(option, picture) for option in question.options]
            anchor = resolve_one(slots["other"], picture) if "other" in slots else None
            seen = [*named, anchor] if anchor else named
            require_seen(picture, [block.order for block in seen], NAMED)
            if anchor:
                return (named.index(_nearest(anchor, named)),)
            kind = slots.get("extreme") or stem_of(question.wording).removeprefix("rp-")
            return (named.index(_extreme(kind, named, picture)),)
        one, other = (resolve_one(slots[name], picture) for name in ("block", "other"))
        require_seen(picture, [one.order, other.order], NAMED)
        corners = set(question.options) == set(_CORNERS)
        right = (_corner if corners else _upright)(one, other, picture.view_deg)
        return index_of(question, right)


def _of_pairs(
    scene: Scene, picture: QuestionPicture, named: dict[int, str], rng: np.random.Generator
) -> Iterator[Draft]:
    blocks = [block for block in scene.blocks if block.order in named]
    pairs = shuffled(rng, list(itertools.permutations(blocks, 2)))[:2]
    for one, other in pairs:
        slots = {"block": named[one.order], "other": named[other.order]}
        for stem, words, rule in (
            ("corner", _CORNERS, _corner),
            ("upright", _UPRIGHT, _upright),
        ):
            try:
                right = rule(one, other, picture.view_deg)
            except UnfairError:
                continue
            options = [right, *(word for word in words if word != right)]
            offset = [round(float(x), 6) for x in offset_m(one, other, picture.view_deg)]
            yield draft(
                scene, picture, rng, f"rp-{stem}", slots, options, right, stem, offset_m=offset
            )


def _of_four(
    scene: Scene, picture: QuestionPicture, named: dict[int, str], rng: np.random.Generator
) -> Iterator[Draft]:
    blocks = [block for block in scene.blocks if block.order in named]
    chosen = shuffled(rng, blocks)[:5]
    if len(chosen) < 5:
        return
    anchor, four = chosen[0], chosen[1:]
    kind = pick(rng, (*_SIDES, *_RANKED, "nearest"))
    try:
        is_near = kind == "nearest"
        right = _nearest(anchor, four) if is_near else _extreme(kind, four, picture)
    except UnfairError:
        return
    ranked = [right, *(block for block in four if block is not right)]
    options = [f"the {named[block.order]}" for block in ranked]
    slots = {"other": named[anchor.order]} if is_near else {}
    if kind in _SIDES:
        slots = {"extreme": kind}
    stem = "extreme" if kind in _SIDES else kind
    orders = {"ranked": [block.order for block in ranked]}
    yield draft(scene, picture, rng, f"rp-{stem}", slots, options, right.type, kind, **orders)


def _corner(one: Block, other: Block, view: View) -> str:
    """Which quarter of the floor round `other` holds `one`, as the viewer sees it."""
    across, away, _ = offset_m(one, other, view)
    if min(abs(across), abs(away)) < _CLEAR_M:
        raise UnfairError("is neither clearly to a side nor clearly in front or behind")
    depth = "behind" if away > 0 else "in front"
    return f"{depth} and to the {'right' if across > 0 else 'left'}"


def _upright(one: Block, other: Block, view: View) -> str:
    """Over or under it, or beside it at its height; UnfairError for all that lies between."""
    across, away, _ = offset_m(one, other, view)
    low, high = bounds_m(one)[:, 2] - bounds_m(other)[::-1, 2]
    if max(abs(across), abs(away)) < _ABOVE_M and (low > -_LEVEL_M or high < _LEVEL_M):
        return "above it" if low > -_LEVEL_M else "below it"
    bottoms = abs(bounds_m(one)[0, 2] - bounds_m(other)[0, 2])
    if abs(across) > _CLEAR_M and bottoms < _LEVEL_M:
        return f"to its {'right' if across > 0 else 'left'}, at the same height"
    raise UnfairError("is neither over, under nor beside it")


def _nearest(anchor: Block, blocks: Sequence[Block]) -> Block:
    """The block whose middle is clearly nearest to that of another."""
    far = {b.order: float(np.linalg.norm(center_m(b) - center_m(anchor))) for b in blocks}
    ranked = sorted(blocks, key=lambda block: far[block.order])
    if far[ranked[0].order] > _NEARER * far[ranked[1].order]:
        raise UnfairError("two blocks are about as near")
    return ranked[0]


def _extreme(extreme: str, blocks: Sequence[Block], picture: QuestionPicture) -> Block:
    """The one of `blocks` that is clearly farthest to a side, to the front, or reaches highest."""
    if extreme in _RANKED:
        away = picture_axes(picture.view_deg)[1]
        upright = extreme in ("highest", "lowest")
        sign = -1.0 if extreme in ("highest", "back") else 1.0
        reach = {
            b.order: sign * (top_m(b) if upright else float(center_m(b) @ away)) for b in blocks
        }
        ranked = sorted(blocks, key=lambda block: reach[block.order])
        if reach[ranked[1].order] - reach[ranked[0].order] < _GAP_M:
            raise UnfairError(f"two blocks are about as {extreme}")
        return ranked[0]
    if extreme not in _SIDES:
        raise UnfairError(f"{extreme!r} is no place")
    orders = [block.order for block in blocks]
    order = outermost(orders, picture, to_left=extreme == "farthest left")
    if order is None:
        raise UnfairError(f"two blocks are about the {extreme}")
    return blocks[orders.index(order)]
