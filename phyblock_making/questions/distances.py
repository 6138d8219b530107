"""Absolute position: heights, distances and places in centimeters, on the blocks' grid."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from phyblock.domain.question import Question, QuestionPicture, Subtask
from phyblock.domain.scene import Block, Scene
from phyblock_making.questions.choices import pick, shuffled
from phyblock_making.questions.coloring import recolored
from phyblock_making.questions.goal_view import (
    COUNTED,
    NAMED,
    View,
    goal_picture,
    require_seen,
    shown_picture,
)
from phyblock_making.questions.lengths import (
    LENGTHS,
    PAIRED,
    along_and_across_m,
    grid_cm,
    require_joined,
)
from phyblock_making.questions.question_draft import Draft, UnfairError
from phyblock_making.questions.referring import Feature, names, resolve_one
from phyblock_making.questions.static_drafts import (
    StaticMaker,
    draft,
    index_of,
    seen_blocks,
)
from phyblock_making.questions.wording import slots_of, stem_of

__all__ = ["DistanceMaker"]

_PLAIN: tuple[Feature, ...] = ("color", "type")
_SCALES: Mapping[str, str] = {
    "cube": "the edges of a cube are 5 cm long",
    "cylinder": "a cylinder is 10 cm long and 5 cm thick",
    "arch": "an arch is 10 cm long, 5 cm wide and 5 cm high",
}
_STEP_CM, _LONGEST_CM = 2.5, 50.0
_APART = (1.2, 2.0)
"""Values that are options together: each at least and at most so many times the one before."""


@functools.cache
def _ladders() -> Mapping[float, Sequence[tuple[float, ...]]]:
    """All sets of four values on the grid that may stand together, by each value in them."""
    grid = [_STEP_CM * n for n in range(1, round(_LONGEST_CM / _STEP_CM) + 1)]
    found: dict[float, list[tuple[float, ...]]] = {value: [] for value in grid}
    for four in itertools.combinations(grid, 4):
        if all(_APART[0] * a <= b <= _APART[1] * a for a, b in itertools.pairwise(four)):
            for value in four:
                found[value].append(four)
    return found


_KINDS: Mapping[str, str] = {
    "top": "height",
    "bottom": "height",
    "rise": "rise",
    "apart": "apart",
    "gap": "gap",
    "span": "span",
    "place": "place",
}
"""Wordings, and the sorts of questions whose shares are even: heights are one of six."""
_TRIES = 3
_PAIRS = 60
_STEPS_CM = (-5.0, 5.0)


class DistanceMaker(StaticMaker):
    """AP: a block of known size, named in the text, stands in the picture as the scale."""

    subtask: Subtask = "AP"
    drafts_a_view = 20

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
        rule = stem_of(question.wording).removeprefix("ap-")
        if rule not in _KINDS or (rule in PAIRED) != (len(named) == 2):
            raise UnfairError(f"the wording {question.wording!r} asks for no length")
        if rule == "place":
            return index_of(question, _place_text(_place_cm(named[0], named[1], picture)))
        if rule == "span":
            require_seen(picture, [block.order for block in picture.blocks], COUNTED)
        right_cm = grid_cm(LENGTHS[rule](named[0], named[-1], picture.blocks))
        try:
            values = sorted(float(option.removesuffix(" cm")) for option in question.options)
        except ValueError as error:
            raise UnfairError("some option is no length in centimeters") from error
        if any(high < _APART[0] * low for low, high in itertools.pairwise(values)):
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
    pairs = list(itertools.permutations(blocks, 2))
    for rule in shuffled(rng, list(_KINDS)):
        for one, other in shuffled(rng, pairs)[:_PAIRS]:
            slots = {"block": named[one.order], "scale": scale}
            if rule in PAIRED:
                slots["other"] = named[other.order]
            try:
                options = _options(rule, one, other, picture, rng)
            except UnfairError:
                continue
            if options:
                evidence = {"right": options[0]}
                stem, kind = f"ap-{rule}", _KINDS[rule]
                yield draft(scene, picture, rng, stem, slots, options, options[0], kind, **evidence)
                break


def _options(
    rule: str, one: Block, other: Block, picture: QuestionPicture, rng: np.random.Generator
) -> list[str]:
    """The right option and three others; none where no four stand together."""
    if rule == "place":
        along, across = _place_cm(one, other, picture)
        longer, wider = along + pick(rng, _STEPS_CM), across + pick(rng, _STEPS_CM)
        if min(longer, wider) < 0:
            return []
        return [_place_text((a, b)) for a in (along, longer) for b in (across, wider)]
    if rule == "span":
        require_seen(picture, [block.order for block in picture.blocks], COUNTED)
    right = grid_cm(LENGTHS[rule](one, other, picture.blocks))
    ladders = _ladders().get(right)
    if not ladders:
        return []
    ladder = pick(rng, ladders)
    return [_shown(value) for value in (right, *(value for value in ladder if value != right))]


def _place_cm(one: Block, other: Block, picture: QuestionPicture) -> tuple[float, float]:
    """Steps along and across the length of `other`; UnfairError as `LENGTHS`."""
    require_joined(one, other, picture.blocks)
    along, across = along_and_across_m(one, other)
    return grid_cm(along), grid_cm(across)


def _place_text(place_cm: tuple[float, float]) -> str:
    along, across = place_cm
    return f"{along:g} cm along and {across:g} cm across"


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
