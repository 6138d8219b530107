"""Absolute position: heights and distances in centimeters, on the grid that blocks stand on."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from phyblock.domain.question import Question, QuestionPicture, Subtask
from phyblock.domain.scene import Block, Scene
from phyblock.sim.support import bounds_m
from phyblock_making.questions.block_measures import top_m
from phyblock_making.questions.choices import pick, shuffled
from phyblock_making.questions.coloring import recolored
from phyblock_making.questions.goal_view import (
    NAMED,
    View,
    center_m,
    goal_picture,
    require_seen,
    shown_picture,
)
from phyblock_making.questions.question_draft import Draft, UnfairError
from phyblock_making.questions.referring import Feature, names, resolve_one
from phyblock_making.questions.static_drafts import (
    StaticMaker,
    draft,
    index_of,
    seen_blocks,
)
from phyblock_making.questions.wording import slots_of

__all__ = ["DistanceMaker"]

_PLAIN: tuple[Feature, ...] = ("color", "type")
_SCALES: Mapping[str, str] = {
    "cube": "the edges of a cube are 5 cm long",
    "cylinder": "a cylinder is 10 cm long and 5 cm thick",
    "arch": "an arch is 10 cm long, 5 cm wide and 5 cm high",
}
_LADDERS: tuple[tuple[float, ...], ...] = (
    (2.5, 5, 7.5, 10),
    (5, 7.5, 10, 15),
    (7.5, 10, 12.5, 17.5),
    (10, 12.5, 17.5, 22.5),
    (12.5, 15, 20, 25),
    (15, 20, 25, 32.5),
)
"""Values in centimeters that stand together as options: each at least 20 % from the next."""
_EXACT_CM = 0.1
_TRIES = 4
_SIDE_M = 0.001


def _top(one: Block, other: Block | None) -> float:
    del other
    return top_m(one)


def _bottom(one: Block, other: Block | None) -> float:
    del other
    return float(bounds_m(one)[0, 2])


def _apart(one: Block, other: Block | None) -> float:
    assert other is not None
    x, y, _ = np.abs(center_m(one) - center_m(other)).tolist()
    if min(x, y) > _SIDE_M:
        raise UnfairError("the blocks stand askew, so that their distance cannot be counted")
    return float(max(x, y))


def _rise(one: Block, other: Block | None) -> float:
    assert other is not None
    return abs(top_m(one) - top_m(other))


_RULES: Mapping[str, Callable[[Block, Block | None], float]] = {
    "top": _top,
    "bottom": _bottom,
    "apart": _apart,
    "rise": _rise,
}


class DistanceMaker(StaticMaker):
    """AP: a block of known size, named in the text, stands in the picture as the scale."""

    subtask: Subtask = "AP"

    def seen_from(self, view: View, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Heights of blocks and distances of pairs, as far as they are on the grid."""
        for _ in range(_TRIES):
            shown = recolored(scene, rng)
            picture = goal_picture(shown, view)
            seen = seen_blocks(picture, NAMED)
            scales = [kind for kind in _SCALES if any(block.type == kind for block in seen)]
            named = {
                block.order: expressions[0]
                for block in seen
                if (expressions := names(block, picture, _PLAIN))
            }
            blocks = [block for block in seen if block.order in named]
            if scales:
                scale = _SCALES[pick(rng, scales)]
                yield from _of_blocks(shown, picture, blocks, named, scale, rng)

    def rederive(self, question: Question) -> tuple[int, ...]:
        """From the places of the blocks that the text names."""
        picture, slots = shown_picture(question), slots_of(question)
        named = [resolve_one(slots[name], picture) for name in ("block", "other") if name in slots]
        require_seen(picture, [block.order for block in named], NAMED)
        _require_scale(slots["scale"], picture)
        rule = question.wording.split("-")[1] if question.wording else ""
        if rule not in _RULES:
            raise UnfairError(f"the wording {question.wording!r} asks for no length")
        if rule == "apart" and not _are_joined(named[0], named[-1], picture.blocks):
            raise UnfairError("the blocks are parts of structures that stand apart")
        right_cm = _grid_cm(_RULES[rule](named[0], named[-1]))
        try:
            values = sorted(float(option.removesuffix(" cm")) for option in question.options)
        except ValueError as error:
            raise UnfairError("some option is no length in centimeters") from error
        if any(high < 1.2 * low for low, high in itertools.pairwise(values)):
            raise UnfairError("two values are less than 20 % apart")
        return index_of(question, _shown(right_cm))


def _of_blocks(
    scene: Scene,
    picture: QuestionPicture,
    blocks: Sequence[Block],
    named: Mapping[int, str],
    scale: str,
    rng: np.random.Generator,
) -> Iterator[Draft]:
    pairs = shuffled(rng, list(itertools.permutations(blocks, 2)))[:6]
    for one, other in pairs:
        for rule in shuffled(rng, list(_RULES))[:2]:
            slots = {"block": named[one.order], "scale": scale}
            if rule in ("apart", "rise"):
                slots["other"] = named[other.order]
            if rule == "apart" and not _are_joined(one, other, scene.blocks):
                continue
            try:
                right = _grid_cm(_RULES[rule](one, other))
            except UnfairError:
                continue
            ladders = [ladder for ladder in _LADDERS if right in ladder]
            if ladders:
                ladder = pick(rng, ladders)
                values = [right, *(value for value in ladder if value != right)]
                options = [_shown(value) for value in values]
                stem, evidence = f"ap-{rule}", {"length_cm": right}
                yield draft(scene, picture, rng, stem, slots, options, options[0], rule, **evidence)


def _are_joined(one: Block, other: Block, blocks: Sequence[Block]) -> bool:
    """Whether the two belong to one structure, by what rests on what above the ground."""
    reached, waiting = {one.order}, [one.order]
    while waiting:
        order = waiting.pop()
        touching = {b.order for b in blocks if order in b.depend}
        touching.update(*(b.depend for b in blocks if b.order == order))
        waiting += sorted(touching - reached)
        reached |= touching
    return other.order in reached


def _grid_cm(length_m: float) -> float:
    """The length in centimeters where it is a multiple of 2.5 cm; else UnfairError."""
    steps = round(length_m * 100 / 2.5)
    if abs(length_m * 100 - 2.5 * steps) > _EXACT_CM:
        raise UnfairError(f"{length_m * 100:.1f} cm is no multiple of 2.5 cm")
    return 2.5 * steps


def _shown(length_cm: float) -> str:
    return f"{length_cm:g} cm"


def _require_scale(scale: str, picture: QuestionPicture) -> None:
    kinds = [kind for kind, text in _SCALES.items() if text == scale]
    orders = [block.order for block in picture.blocks if block.type in kinds]
    for order in orders:
        try:
            require_seen(picture, [order], NAMED)
        except UnfairError:
            continue
        return
    raise UnfairError("the block that gives the scale cannot be seen")
