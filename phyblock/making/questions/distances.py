"""Absolute position: heights, distances and places in centimeters, on the blocks' grid."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np

from phyblock.domain.question import Question, QuestionPicture, Subtask
from phyblock.domain.scene import Block, Scene
from phyblock.making.questions.measures import (
    LENGTHS,
    PAIRED,
    along_and_across_m,
    grid_cm,
    require_joined,
)
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
from phyblock.making.questions.static_drafts import StaticMaker, draft, index_of, seen_blocks
from phyblock.making.questions.wording import slots_of, stem_of

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
def _ladders() -> Sequence[tuple[float, ...]]:
    """All sets of four values on the grid that may stand together, rising."""
    grid = [_STEP_CM * n for n in range(1, round(_LONGEST_CM / _STEP_CM) + 1)]
    return [
        four
        for four in itertools.combinations(grid, 4)
        if all(_APART[0] * a <= b <= _APART[1] * a for a, b in itertools.pairwise(four))
    ]


_KINDS: Mapping[str, str] = {
    "top": "height",
    "bottom": "height",
    "rise": "rise",
    "apart": "apart",
    "gap": "gap",
    "place": "place",
}
"""Wordings, and the sorts of questions whose shares are even: heights are one of five."""
_FEW_A_SCENE = ("gap", "place")
"""Kinds of which hardly any scene has four values that could be offered together."""
_TRIES = 3
_PAIRS = 90
_PLACE_STEP_CM = 5.0

Values = tuple[float, ...]
"""A length, or how far along and across [cm]."""


class DistanceMaker(StaticMaker):
    """AP: a block of known size, named in the text, stands in the picture as the scale."""

    subtask: Subtask = "AP"
    views_a_scene = 2
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
    pairs = shuffled(rng, list(itertools.permutations(blocks, 2)))[:_PAIRS]
    for rule in shuffled(rng, list(_KINDS)):
        found = _by_value(rule, pairs if rule in PAIRED else [(b, b) for b in blocks], picture)
        values = _options(rule, found, rng)
        if not values:
            continue
        one, other = pick(rng, found[values[0]])
        slots = {"block": named[one.order], "scale": scale}
        if rule in PAIRED:
            slots["other"] = named[other.order]
        options = [_place_text(value) if rule == "place" else _shown(*value) for value in values]
        evidence = {"right": options[0]}
        stem, kind = f"ap-{rule}", _KINDS[rule]
        yield draft(scene, picture, rng, stem, slots, options, options[0], kind, **evidence)


def _by_value(
    rule: str, pairs: Sequence[tuple[Block, Block]], picture: QuestionPicture
) -> Mapping[Values, Sequence[tuple[Block, Block]]]:
    """The pairs of which something can be asked, by what the answer is."""
    found: dict[Values, list[tuple[Block, Block]]] = {}
    for one, other in pairs:
        try:
            found.setdefault(_values_cm(rule, one, other, picture), []).append((one, other))
        except UnfairError:
            continue
    return found


def _values_cm(rule: str, one: Block, other: Block, picture: QuestionPicture) -> Values:
    if rule == "place":
        return _place_cm(one, other, picture)
    return (grid_cm(LENGTHS[rule](one, other, picture.blocks)),)


def _options(rule: str, found: Collection[Values], rng: np.random.Generator) -> Sequence[Values]:
    """Four values, the right one first; none where no four stand together.

    All four are true of something in the picture, and which one is asked for is drawn, so that a
    length that is frequent is not right more often than the others beside it. Where no scene has
    four, as of `_FEW_A_SCENE`, one that is true stands beside others, and chance leaves out most
    of these (`answer_odds`).
    """
    fours = _squares(found) if rule == "place" else [*map(_each_alone, _ladders())]
    whole = [four for four in fours if set(four) <= set(found)]
    if whole:
        four = pick(rng, whole)
        return _first(pick(rng, four), four)
    if rule not in _FEW_A_SCENE or not found:
        return ()
    right = pick(rng, sorted(found))
    beside = [four for four in fours if right in four]
    return _first(right, pick(rng, beside)) if beside else ()


def _squares(found: Collection[Values]) -> Sequence[Sequence[Values]]:
    """Places 5 cm from one another along and across, four at a time, one of them among `found`."""
    step = _PLACE_STEP_CM
    corners = {(a - x, b - y) for a, b in found for x in (0, step) for y in (0, step)}
    return [
        [(a + x, b + y) for x in (0, step) for y in (0, step)]
        for a, b in sorted(corners)
        if min(a, b) >= 0
    ]


def _each_alone(lengths: Sequence[float]) -> Sequence[Values]:
    return [(length,) for length in lengths]


def _first(right: Values, values: Sequence[Values]) -> Sequence[Values]:
    return [right, *(value for value in values if value != right)]


def _place_cm(one: Block, other: Block, picture: QuestionPicture) -> tuple[float, float]:
    """Steps along and across the length of `other`; UnfairError as `LENGTHS`."""
    require_joined(one, other, picture.blocks)
    along, across = along_and_across_m(one, other)
    return grid_cm(along), grid_cm(across)


def _place_text(place_cm: Values) -> str:
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
