"""SH, CO, SI: shape, color and size of a block. NU, OC, LC, TC: how many blocks, layers or shapes.

Scenes are recolored from the full palette, so that neither color nor shape tells the other. For
sizes, blocks are named by colors of their own, because a shape's name would tell its size. What is
counted is what the picture tells.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from phyblock.domain.blocks import BLOCK_TYPES, COLORS, SHAPES
from phyblock.domain.question import Question, QuestionPicture, Subtask
from phyblock.domain.scene import Block, Scene
from phyblock.making.questions import base
from phyblock.making.questions.base import (
    COUNTED,
    NAMED,
    STUDIED,
    Draft,
    Slots,
    StaticMaker,
    UnfairError,
    View,
    draft,
    goal_picture,
    index_of,
    orders_of,
    pick,
    require_seen,
    require_shapes_seen,
    seen_blocks,
    shuffled,
)
from phyblock.making.questions.names import (
    SHAPE_WORDS,
    Feature,
    drawn_name,
    plain_names,
    resolve_one,
    shape_word,
)
from phyblock.sim.contact import GROUND, bounds_m, support_graph

_LYING_M = 0.03
"""A half cylinder that lies on its flat face is lower than this."""
_LEAST_RATIO = 1.3
_EXACT = 0.01
_TRIES = 6


class PropertyMaker(StaticMaker):
    """SH: the shape of a block named by anything but a shape; CO: likewise its color."""

    def __init__(self, subtask: Literal["SH", "CO"]) -> None:
        self.subtask: Subtask = subtask
        self._is_shape = subtask == "SH"
        self._least = STUDIED if self._is_shape else NAMED
        self._allowed: Sequence[str] = list(SHAPE_WORDS) if self._is_shape else COLORS
        other: Feature = "color" if self._is_shape else "type"
        self._features: tuple[Feature, ...] = (other, "side", "layer", "support")

    def seen_from(self, view: View, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """One a block that shows enough of itself and can be named."""
        for one in shuffled(rng, seen_blocks(goal_picture(scene, view), self._least)):
            if self._doubt(one, scene.blocks, view):
                continue
            shown = base.recolored(scene, rng)
            picture = goal_picture(shown, view)
            block = next(b for b in shown.blocks if b.order == one.order)
            name = drawn_name(rng, block, picture, self._features)
            if name is not None:
                right = self._property(block)
                options = [right, *shuffled(rng, [x for x in self._allowed if x != right])[:3]]
                stem, slots = self.subtask.lower(), {"block": name}
                yield draft(shown, rng, stem, options, [picture], slots, kind="", block=block.order)

    def answer(self, question: Question, picture: QuestionPicture, slots: Slots) -> tuple[int, ...]:
        """The shape or color of the block that the text names."""
        block = resolve_one(slots["block"], picture)
        require_seen(picture, [block.order], self._least)
        if doubt := self._doubt(block, picture.blocks, picture.view_deg):
            raise UnfairError(doubt)
        return index_of(question, self._property(block))

    def _property(self, block: Block) -> str:
        return shape_word(block.type) if self._is_shape else block.color

    def _doubt(self, block: Block, blocks: Sequence[Block], view: View) -> str:
        """The reason why a view does not tell a block's shape; empty where it does."""
        if not self._is_shape:
            return ""
        if not base.shows_profile(block, view):
            return "is seen from a side that does not tell its shape"
        is_standing = block.type == "semi_cylinder" and _height_m(block) > _LYING_M
        if is_standing and any(block.order in other.depend for other in blocks):
            return "a half cylinder that stands and carries looks like a cylinder"
        return ""


def _height_m(block: Block) -> float:
    """From a block's lowest to its highest point [m]."""
    low, high = bounds_m(block)[:, 2]
    return float(high - low)


def _length_m(block: Block) -> float:
    """Length of the longest side of the box that a block fits in, however it lies [m]."""
    shape = SHAPES[block.type]
    return max(high - low for low, high in zip(shape.low_m, shape.high_m, strict=True))


def _volume_m3(block: Block) -> float:
    return SHAPES[block.type].volume_m3


_COMPARISONS: Mapping[str, tuple[str, Callable[[Block], float], int]] = {
    "tallest": ("si-height", _height_m, 1),
    "flattest": ("si-height", _height_m, -1),
    "longest": ("si-length", _length_m, 1),
    "largest": ("si-volume", _volume_m3, 1),
    "smallest": ("si-volume", _volume_m3, -1),
}
"""Stems of wordings, measures, and whether most or least of them is asked for."""


class SizeMaker(StaticMaker):
    """SI: the one of four blocks that is the tallest, longest, largest; how many times as tall."""

    subtask: Subtask = "SI"

    def seen_from(self, view: View, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Comparisons of four blocks, and of two, in turns."""
        studied = seen_blocks(goal_picture(scene, view), STUDIED)
        for _ in range(_TRIES):
            for count, compare in ((4, _one_of_four), (2, _times_as_tall)):
                if len(studied) >= count:
                    chosen = shuffled(rng, studied)[:count]
                    try:
                        yield compare(view, scene, chosen, rng)
                    except UnfairError:
                        continue

    def answer(self, question: Question, picture: QuestionPicture, slots: Slots) -> tuple[int, ...]:
        """By the measures of the blocks that the text or the options name."""
        compared = slots.get("comparison")
        named = question.options if compared else (slots["block"], slots["other"])
        blocks = [resolve_one(name, picture) for name in named]
        require_seen(picture, orders_of(blocks), STUDIED)
        if compared:
            return (blocks.index(_extreme(blocks, compared)),)
        return index_of(question, _times(*blocks))


def _one_of_four(
    view: View, scene: Scene, chosen: Sequence[Block], rng: np.random.Generator
) -> Draft:
    comparison = pick(rng, list(_COMPARISONS))
    right = _extreme(chosen, comparison)
    shown = base.with_own_colors(scene, orders_of(chosen), rng)
    colors = {block.order: block.color for block in shown.blocks}
    options = [f"the {colors[b.order]} block" for b in base.right_first(right, chosen)]
    stem, measure, _ = _COMPARISONS[comparison]
    sizes = {str(block.order): round(measure(block), 6) for block in chosen}
    slots, pictures = {"comparison": comparison}, [goal_picture(shown, view)]
    return draft(shown, rng, stem, options, pictures, slots, kind=comparison, measures=sizes)


def _times_as_tall(
    view: View, scene: Scene, pair: Sequence[Block], rng: np.random.Generator
) -> Draft:
    right = _times(*pair)
    words = list(base.WORDS["times_as_tall"])
    start = pick(rng, [i for i in (0, 1) if right in words[i : i + 4]])
    shown = base.with_own_colors(scene, orders_of(pair), rng)
    colors = {block.order: block.color for block in shown.blocks}
    one, other = (f"{colors[block.order]} block" for block in pair)
    options, slots = (
        base.right_first(right, words[start : start + 4]),
        {"block": one, "other": other},
    )
    heights = {str(block.order): round(_height_m(block), 6) for block in pair}
    pictures = [goal_picture(shown, view)]
    return draft(shown, rng, "si-times", options, pictures, slots, kind="times", measures=heights)


def _extreme(blocks: Sequence[Block], comparison: str) -> Block:
    """The one that stands out by a clear margin; UnfairError when none does."""
    if comparison not in _COMPARISONS:
        raise UnfairError(f"{comparison!r} is no comparison")
    _, measure, sign = _COMPARISONS[comparison]
    ranked = sorted(blocks, key=lambda block: -sign * measure(block))
    less, more = sorted(map(measure, ranked[:2]))
    if more < _LEAST_RATIO * less:
        raise UnfairError(f"two of the blocks are about as {comparison}")
    return ranked[0]


def _times(one: Block, other: Block) -> str:
    """The words for how many times as tall one block is as another; UnfairError for others."""
    ratio = _height_m(one) / _height_m(other)
    for word, known in base.WORDS["times_as_tall"].items():
        if abs(ratio - known) < _EXACT:
            return str(word)
    raise UnfairError(f"is {ratio:.2f} times as tall, which no option says")


# NU, OC, LC, TC

_TYPES_OF = {
    f"{word}es" if word == "arch" else f"{word}s": types for word, types in SHAPE_WORDS.items()
}
"""The types that each plural names."""
_MOST = 13
_WEDGED_M = 0.005


class NumberMaker(StaticMaker):
    """NU: how many blocks there are of a color, a shape, or both."""

    subtask: Subtask = "NU"
    views_a_scene = 2

    def seen_from(self, view: View, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Of all that can be counted in a scene whose blocks all show enough."""
        picture = goal_picture(scene, view)
        if not base.are_seen(picture, orders_of(scene.blocks), COUNTED):
            return
        colors = [color for color in COLORS if any(b.color == color for b in scene.blocks)]
        kinds = [(f"{color} blocks", "color") for color in colors]
        try:
            require_shapes_seen(picture)
            kinds += [(word, "shape") for word in _TYPES_OF]
            kinds += [(f"{color} {word}", "both") for color in colors for word in _TYPES_OF]
        except UnfairError:
            pass  # Colors can be counted where shapes cannot.
        for what, kind in shuffled(rng, kinds):
            counted = orders_of(_fitting(what, scene.blocks))
            if options := base.window(rng, range(1, _MOST), len(counted)):
                slots = {"what": what}
                yield draft(scene, rng, "nu", options, [picture], slots, kind=kind, counted=counted)

    def answer(self, question: Question, picture: QuestionPicture, slots: Slots) -> tuple[int, ...]:
        """Count the blocks that fit the words."""
        require_seen(picture, orders_of(picture.blocks), COUNTED)
        if not slots["what"].endswith(" blocks"):
            require_shapes_seen(picture)
        return index_of(question, str(len(_fitting(slots["what"], picture.blocks))))


def _fitting(what: str, blocks: Sequence[Block]) -> list[Block]:
    """The blocks that `red blocks`, `cubes` or `red cubes` speaks of."""
    first, _, rest = what.partition(" ")
    color, noun = (first, rest) if first in COLORS else ("", what)
    if noun not in (*_TYPES_OF, "blocks"):
        raise UnfairError(f"{what!r} cannot be counted")
    types = _TYPES_OF.get(noun, BLOCK_TYPES)
    return [block for block in blocks if color in ("", block.color) and block.type in types]


def layers_of(blocks: Sequence[Block]) -> Mapping[int, int]:
    """The layer of each block, by order: one more than that of the highest block it rests on.

    UnfairError where that is not what the picture tells: a block that is wedged between two
    slopes rests on them, and yet it looks as if it were beside them.
    """
    below = support_graph(blocks)
    top = {block.order: bounds_m(block)[1, 2] for block in blocks} | {GROUND: 0.0}
    bottom = {block.order: bounds_m(block)[0, 2] for block in blocks}
    plain = {
        order: {other for other in others if bottom[order] > top[other] - _WEDGED_M} or {GROUND}
        for order, others in below.items()
    }
    counted = _longest(below)
    if counted != _longest(plain):
        raise UnfairError("some block rests on others and stands lower than they reach")
    return counted


def _longest(below: Mapping[int, Collection[int]]) -> dict[int, int]:
    layer = {GROUND: 0}
    while len(layer) <= len(below):
        ready = [o for o in below if o not in layer and below[o] and set(below[o]) <= layer.keys()]
        if not ready:
            raise UnfairError("some block rests on nothing, or on itself")
        layer.update({order: 1 + max(layer[other] for other in below[order]) for order in ready})
    return {order: number for order, number in layer.items() if order != GROUND}


def sure_blocks(picture: QuestionPicture) -> int:
    """Count the blocks that have to be there, going by what the picture shows.

    Every block shows at least `COUNTED` of itself, but one at the most that shows less. That
    one is sure to be there, whatever it is, where a block that shows `NAMED` of itself rests on it
    alone: without it, that block would float. UnfairError where more are hidden, or nothing tells
    of it.
    """
    seen = base.shares(picture)
    hidden = [order for order, share in seen.items() if share < COUNTED]
    if len(hidden) > 1:
        raise UnfairError("several blocks are hidden")
    below = support_graph(picture.blocks)
    for order in hidden:
        if not any(seen[o] >= NAMED and below[o] == {order} for o in below):
            raise UnfairError(f"nothing that can be seen rests on block {order} alone")
    return len(picture.blocks)


def _all(picture: QuestionPicture) -> Sequence[Block]:
    """The blocks, each of which shows enough to be counted; else UnfairError."""
    require_seen(picture, orders_of(picture.blocks), COUNTED)
    return picture.blocks


def _shaped(picture: QuestionPicture) -> Sequence[Block]:
    """The blocks, each of which shows its shape; else UnfairError."""
    require_shapes_seen(picture)
    return picture.blocks


def _on_ground(blocks: Sequence[Block]) -> list[Block]:
    below = support_graph(blocks)
    return [block for block in blocks if GROUND in below[block.order]]


def _of_colors(picture: QuestionPicture, *colors: str) -> int:
    return sum(block.color in colors for block in _all(picture))


def _types(blocks: Sequence[Block]) -> Counter[str]:
    return Counter(block.type for block in blocks)


def _layer_of_block(picture: QuestionPicture, slots: Slots) -> int:
    block, layers = resolve_one(slots["block"], picture), layers_of(picture.blocks)
    require_seen(picture, [block.order], NAMED)
    under = [o for o in orders_of(picture.blocks) if layers[o] < layers[block.order]]
    require_seen(picture, under, COUNTED)
    return layers[block.order]


def _colors(picture: QuestionPicture) -> list[str]:
    return sorted({block.color for block in picture.blocks})


def _layer_numbers(picture: QuestionPicture) -> list[Slots]:
    return [{"layer": str(n + 1)} for n in range(max(block.layer for block in picture.blocks))]


@dataclass(frozen=True)
class Tally:
    """One way of counting.

    `count` says how many there are, and raises UnfairError where that cannot be told from the
    picture; `values` are those offered; `slots` are those that a text about a picture can have.
    `is_recolored` where the kit's colors would tell too much, or too few blocks have names.
    """

    count: Callable[[QuestionPicture, Slots], int]
    values: Sequence[int]
    slots: Callable[[QuestionPicture], Sequence[Slots]] = lambda _: ({},)
    is_recolored: bool = False


TALLIES: Mapping[str, Tally] = {
    "oc-all": Tally(lambda p, _: len(_all(p)), range(2, 25)),
    "oc-hidden": Tally(lambda p, _: sure_blocks(p), range(2, 25)),
    "oc-ground": Tally(lambda p, _: len(_on_ground(_all(p))), range(1, 13)),
    "oc-raised": Tally(lambda p, _: len(_all(p)) - len(_on_ground(p.blocks)), range(1, 17)),
    "oc-other": Tally(
        lambda p, s: len(p.blocks) - _of_colors(p, s["color"]),
        range(1, 19),
        lambda p: [{"color": color} for color in _colors(p)],
        is_recolored=True,
    ),
    "oc-pair": Tally(
        lambda p, s: _of_colors(p, s["color"], s["other"]),
        range(1, 15),
        lambda p: [{"color": a, "other": b} for a in _colors(p) for b in _colors(p) if a != b],
        is_recolored=True,
    ),
    "lc-all": Tally(lambda p, _: max(layers_of(_all(p)).values()), range(1, 9)),
    "lc-block": Tally(
        _layer_of_block,
        range(1, 9),
        lambda p: [{"block": name} for name in plain_names(p).values()],
        is_recolored=True,
    ),
    "lc-in": Tally(
        lambda p, s: sum(n == int(s["layer"]) for n in layers_of(_all(p)).values()),
        range(1, 12),
        _layer_numbers,
    ),
    "lc-above": Tally(
        lambda p, s: sum(n > int(s["layer"]) for n in layers_of(_all(p)).values()),
        range(1, 12),
        _layer_numbers,
    ),
    "tc-all": Tally(lambda p, _: len(_types(_shaped(p))), range(1, len(BLOCK_TYPES) + 1)),
    "tc-shapes": Tally(
        lambda p, _: len({shape_word(b.type) for b in _shaped(p)}), range(1, len(SHAPE_WORDS) + 1)
    ),
    "tc-once": Tally(lambda p, _: sum(n == 1 for n in _types(_shaped(p)).values()), range(0, 7)),
    "tc-ground": Tally(lambda p, _: len(_types(_on_ground(_shaped(p)))), range(1, 8)),
    "tc-kinds": Tally(
        lambda p, _: len({b.kind for b in _shaped(p)}), range(2, 15), is_recolored=True
    ),
}
"""By stem of the wordings."""


class TallyMaker(StaticMaker):
    """OC, LC or TC: the ways of counting whose stems begin with the subtask."""

    views_a_scene = 2
    drafts_a_view = 6

    def __init__(self, subtask: Subtask) -> None:
        self.subtask = subtask
        self._stems = tuple(stem for stem in TALLIES if stem.startswith(f"{subtask.lower()}-"))

    def seen_from(self, view: View, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """One way of counting after another, as far as the picture allows it."""
        colored = base.recolored(scene, rng)
        for stem in shuffled(rng, self._stems):
            tally = TALLIES[stem]
            shown = colored if tally.is_recolored else scene
            picture = goal_picture(shown, view)
            possible = tally.slots(picture)
            if not possible:
                continue
            slots = pick(rng, possible)
            try:
                right = tally.count(picture, slots)
            except UnfairError:
                continue
            options = base.window(rng, tally.values, right)
            if not options:
                continue
            kind = stem
            facts: dict[str, Any] = {"count": right}
            if stem == "oc-hidden":
                in_sight = orders_of(seen_blocks(picture, COUNTED))
                hidden = sorted(set(orders_of(shown.blocks)) - set(in_sight))
                kind, facts["inferred"] = f"{stem}-{len(hidden)}", hidden
            yield draft(shown, rng, stem, options, [picture], slots, kind=kind, **facts)

    def answer(self, question: Question, picture: QuestionPicture, slots: Slots) -> tuple[int, ...]:
        """Count again."""
        stem = base.stem_of(question.wording)
        if stem not in self._stems:
            raise UnfairError(f"the wording {question.wording!r} counts nothing")
        return index_of(question, str(TALLIES[stem].count(picture, slots)))
