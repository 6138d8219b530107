"""Relative rotation: by how much one of two blocks of a type is turned about the vertical."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from phyblock.domain.question import Question, QuestionPicture, Subtask
from phyblock.domain.scene import Block, Scene
from phyblock.sim.support import (
    FIT_TOLERANCE_M,
    bounds_m,
    drop_height_m,
    find_overlaps,
    support_graph,
)
from phyblock_making.questions.block_measures import turned_about_vertical, vertical_turns_deg
from phyblock_making.questions.choices import pick, shuffled
from phyblock_making.questions.coloring import with_own_colors
from phyblock_making.questions.goal_view import (
    NAMED,
    STUDIED,
    View,
    are_seen,
    goal_picture,
    require_seen,
    shown_picture,
)
from phyblock_making.questions.question_draft import Draft, UnfairError
from phyblock_making.questions.referring import resolve_one, shape_word
from phyblock_making.questions.static_drafts import (
    StaticMaker,
    draft,
    index_of,
    seen_blocks,
)
from phyblock_making.questions.wording import slots_of

__all__ = ["RotationMaker"]


@dataclass(frozen=True)
class _Rule:
    """How turns about the vertical are told of a sort of block, and what can be told apart."""

    kind: str
    phrase_of: Callable[[int], str]
    options: tuple[str, ...]


def _angle(turn_deg: int) -> str:
    return f"{abs(turn_deg)} degrees"


def _turn(turn_deg: int) -> str:
    direction = "" if turn_deg in (0, 180) else f" {_direction(turn_deg)}"
    return f"{abs(turn_deg)} degrees{direction}"


def _direction(turn_deg: int) -> str:
    return "counterclockwise" if turn_deg > 0 else "clockwise"


_ANGLE = _Rule("angle", _angle, tuple(map(_angle, (0, 30, 60, 90))))
"""A block that a half turn about the vertical maps to itself."""
_TURN = _Rule("turn", _turn, tuple(map(_turn, (0, 90, -90, 180))))
"""A block without such a symmetry."""
_PAIRS = 6
_NEAR_M = 0.002


class RotationMaker(StaticMaker):
    """RR: a block that carries nothing is turned on the spot; both have colors of their own."""

    subtask: Subtask = "RR"

    def seen_from(self, view: View, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Pairs of a type, one of them turned so that an angle drawn comes out."""
        carrying = {order for block in scene.blocks for order in block.depend}
        seen = {block.order for block in seen_blocks(goal_picture(scene, view), NAMED)}
        pairs = [
            (one, other)
            for one, other in itertools.permutations(scene.blocks, 2)
            if {one.order, other.order} <= seen
            and one.order not in carrying
            and _rule(one)
            and vertical_turns_deg(one, other)
        ]
        for one, other in shuffled(rng, pairs)[:_PAIRS]:
            rule = _rule(one)
            made = _turned(view, scene, one, other, rule, rng) if rule else None
            if made is not None:
                yield made

    def rederive(self, question: Question) -> tuple[int, ...]:
        """From the orientations in the picture, up to the symmetry of the type."""
        picture, slots = shown_picture(question), slots_of(question)
        one, other = (resolve_one(slots[name], picture) for name in ("block", "other"))
        require_seen(picture, [one.order, other.order], STUDIED)
        rule = _rule(one)
        turns = [rule.phrase_of(turn) for turn in vertical_turns_deg(one, other)] if rule else []
        if not turns or not rule:
            raise UnfairError("are not of one type, or not turned about the vertical alone")
        also_true = {phrase for phrase in turns if phrase != turns[0]} & set(question.options)
        if question.wording and not question.wording.startswith(f"rr-{rule.kind}-"):
            raise UnfairError("asks for a direction that is not there, or not for one that is")
        if also_true:
            raise UnfairError(f"{min(also_true)} is as true")
        return index_of(question, turns[0])


def _turned(
    view: View, scene: Scene, one: Block, other: Block, rule: _Rule, rng: np.random.Generator
) -> Draft | None:
    """A draft in which `one` stands at an angle drawn to `other`; None when it does not fit."""
    phrase = pick(rng, rule.options)
    colored = with_own_colors(scene, [one.order, other.order], rng)
    mine, its = (next(b for b in colored.blocks if b.order == x.order) for x in (one, other))
    for turn in shuffled(rng, range(0, 360, 15)):
        moved = turned_about_vertical(mine, turn) if turn else mine
        if phrase in [rule.phrase_of(t) for t in vertical_turns_deg(moved, its)[:1]]:
            blocks = tuple(moved if b.order == one.order else b for b in colored.blocks)
            picture = goal_picture(replace(colored, blocks=blocks), view)
            if _is_sound(picture, moved, mine, its):
                return _draft(colored, picture, (mine, its), rule, phrase, rng)
    return None


def _draft(
    scene: Scene,
    picture: QuestionPicture,
    pair: tuple[Block, Block],
    rule: _Rule,
    phrase: str,
    rng: np.random.Generator,
) -> Draft:
    options = [phrase, *(option for option in rule.options if option != phrase)]
    noun = shape_word(pair[0].type)
    slots = {"block": f"{pair[0].color} {noun}", "other": f"{pair[1].color} {noun}"}
    stem = f"rr-{rule.kind}"
    return draft(scene, picture, rng, stem, slots, options, phrase, rule.kind, turned=phrase)


def _rule(block: Block) -> _Rule | None:
    """How turns of a block are told; None when a quarter turn already maps it to itself."""
    return {(0,): _TURN, (0, 180): _ANGLE}.get(vertical_turns_deg(block, block))


def _is_sound(picture: QuestionPicture, moved: Block, before: Block, other: Block) -> bool:
    """Whether the moved block fits, rests on what it rested on, and both show enough."""
    near = [b for b in picture.blocks if b is not moved and _is_near(b, moved, before)]
    if drop_height_m(moved, near) > FIT_TOLERANCE_M:
        return False
    if any(moved.order in (o.first, o.second) for o in find_overlaps([*near, moved])):
        return False
    rests_on = [support_graph([*near, block])[moved.order] for block in (moved, before)]
    if rests_on[0] != rests_on[1]:
        return False
    return are_seen(picture, (moved.order, other.order), STUDIED)


def _is_near(block: Block, *others: Block) -> bool:
    """Whether the box round a block comes close to that round one of the others."""
    low, high = bounds_m(block)
    for other in others:
        its_low, its_high = bounds_m(other)
        if bool(np.all(low <= its_high + _NEAR_M) and np.all(its_low <= high + _NEAR_M)):
            return True
    return False
