"""Relative dependency: which block rests on another, carries it, or has to be there before it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from phyblock.domain.question import Question, QuestionPicture, Subtask
from phyblock.domain.scene import Scene
from phyblock.making.questions.picture_view import (
    NAMED,
    View,
    goal_picture,
    require_seen,
    shown_picture,
)
from phyblock.making.questions.properties import recolored
from phyblock.making.questions.question_draft import Draft, UnfairError
from phyblock.making.questions.referring import Feature, names, resolve_one
from phyblock.making.questions.selection import pick, shuffled
from phyblock.making.questions.static_drafts import StaticMaker, draft, seen_blocks
from phyblock.making.questions.wording import slots_of
from phyblock.sim.contact import GROUND, support_graph

__all__ = ["DependencyMaker"]

_PLAIN: tuple[Feature, ...] = ("color", "type")
_TRIES = 12
Below = Mapping[int, frozenset[int]]
"""The orders that each block rests on, by its order."""


def _on(block: int, anchor: int, below: Below) -> bool:
    return anchor in below[block]


def _under(block: int, anchor: int, below: Below) -> bool:
    return block in below[anchor]


def _needed(block: int, anchor: int, below: Below) -> bool:
    return block in _all_below(anchor, below)


def _carried(block: int, anchor: int, below: Below) -> bool:
    return anchor in _all_below(block, below)


_RULES: Mapping[str, Callable[[int, int, Below], bool]] = {
    "on": _on,
    "under": _under,
    "needed": _needed,
    "carried": _carried,
}


class DependencyMaker(StaticMaker):
    """RD: exactly one of four blocks has the relation; contacts are found in the geometry."""

    subtask: Subtask = "RD"
    drafts_a_view = 16

    def seen_from(self, view: View, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """One block to ask about and four to choose from, drawn again and again."""
        below = support_graph(scene.blocks)
        for _ in range(_TRIES):
            shown = recolored(scene, rng)
            picture = goal_picture(shown, view)
            named = {
                block.order: expressions[0]
                for block in seen_blocks(picture, NAMED)
                if (expressions := names(block, picture, _PLAIN))
            }
            if len(named) >= 5:
                yield from _about_one(shown, picture, named, below, rng)

    def rederive(self, question: Question) -> tuple[int, ...]:
        """From the contacts of the blocks that the text and the options name."""
        picture, slots = shown_picture(question), slots_of(question)
        anchor = resolve_one(slots["block"], picture)
        named = [resolve_one(option, picture) for option in question.options]
        require_seen(picture, [block.order for block in (anchor, *named)], NAMED)
        rule = question.wording.split("-")[1] if question.wording else ""
        if rule not in _RULES or anchor in named:
            raise UnfairError("asks about no dependency, or a block about itself")
        below = support_graph(picture.blocks)
        right = [i for i, b in enumerate(named) if _RULES[rule](b.order, anchor.order, below)]
        if len(right) != 1:
            raise UnfairError(f"{len(right)} of the blocks fit")
        return (right[0],)


def _about_one(
    scene: Scene,
    picture: QuestionPicture,
    named: Mapping[int, str],
    below: Below,
    rng: np.random.Generator,
) -> Iterator[Draft]:
    types = {block.order: block.type for block in scene.blocks}
    anchor = pick(rng, list(named))
    for rule in shuffled(rng, list(_RULES))[:2]:
        rest = [order for order in named if order != anchor]
        right = [order for order in rest if _RULES[rule](order, anchor, below)]
        wrong = shuffled(rng, [order for order in rest if order not in right])[:3]
        if right and len(wrong) == 3:
            chosen = [pick(rng, right), *wrong]
            options = [f"the {named[order]}" for order in chosen]
            slots = {"block": named[anchor]}
            contacts = {str(o): sorted(below[o]) for o in (anchor, *chosen)}
            value = types[chosen[0]]
            yield draft(
                scene, picture, rng, f"rd-{rule}", slots, options, value, rule, rests_on=contacts
            )


def _all_below(order: int, below: Below) -> set[int]:
    below_it: set[int] = set()
    waiting = [order]
    while waiting:
        for other in below[waiting.pop()] - {GROUND} - below_it:
            below_it.add(other)
            waiting.append(other)
    return below_it
