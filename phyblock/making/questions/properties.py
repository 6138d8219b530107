"""SH, CO, SI: shape, color and size of a block. NU, OC, LC, TC: numbers of blocks, layers, shapes.

Scenes are recolored, so that neither color nor shape reveals the other. For sizes, blocks are named
by color and side, because a shape's name would reveal its size. Counts go by the picture.
"""

from __future__ import annotations

import functools
import itertools
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from phyblock.domain.blocks import BLOCK_TYPES, COLORS, SHAPES
from phyblock.domain.question import QuestionPicture, Subtask
from phyblock.domain.scene import Block, CycleError, Scene
from phyblock.making.questions import base, sight
from phyblock.making.questions.base import Draft, Slots, StaticMaker, UnfairError, View, pick
from phyblock.making.scenes.sketch import graph_of
from phyblock.sim.contact import GROUND, bounds_m, support_graph

_LYING_M = 0.03
"""Height below which a half cylinder lies on its flat face [m]."""
_PAIRS_TRIED = 8
_FURTHER: Sequence[sight.Feature] = ("side", "layer", "support")
"""Features that names of blocks use besides color or type."""


class ShapeMaker(StaticMaker):
    """SH: the shape of a block named by anything but a shape."""

    subtask: Subtask = "SH"

    def ask(self, scene: Scene, view: View, rng: np.random.Generator) -> Iterator[Draft]:
        """Ask about each block that can be named, in newly drawn colors."""
        for order in base.shuffled(rng, sight.orders_of(scene.blocks)):
            picture = sight.recolored(scene, view, rng)
            block = sight.block_of(picture.blocks, order)
            if name := sight.drawn_name(rng, block, picture, ("color", *_FURTHER)):
                word, slots = sight.shape_word(block.type), {"block": name}
                others = base.shuffled(rng, [one for one in sight.SHAPE_WORDS if one != word])
                options, kind = [word, *others[:3]], f"sh {_said(name)}"
                yield Draft("sh", scene, (picture,), slots, options, kind)

    def right(self, asked: Draft) -> str:
        """Return the shape of the block that the text names."""
        (block,) = sight.named(asked, sight.STUDIED)
        if not sight.shows_profile(block, asked.picture.view_deg):
            raise UnfairError("is seen from a side that does not tell its shape")
        is_standing = block.type == "semi_cylinder" and sight.height_m(block) > _LYING_M
        if is_standing and any(block.order in other.depend for other in asked.picture.blocks):
            raise UnfairError("a half cylinder that stands and carries looks like a cylinder")
        return sight.shape_word(block.type)


def _said(name: str) -> str:
    """Return the feature that a name uses besides color and shape, if any."""
    return next((word for word in ("most", "layer", "resting") if word in name), "")


class ColorMaker(StaticMaker):
    """CO: the colors of two blocks that are named by anything but a color.

    No four colors can be told apart by everybody, but three colors make six ordered pairs.
    """

    subtask: Subtask = "CO"

    def ask(self, scene: Scene, view: View, rng: np.random.Generator) -> Iterator[Draft]:
        """Ask about pairs of blocks that can be named, at most one of them as the outermost."""
        for _ in range(_PAIRS_TRIED):
            picture = sight.recolored(scene, view, rng)
            two = base.shuffled(rng, sight.seen_blocks(picture, sight.NAMED))[:2]
            named = [sight.drawn_name(rng, block, picture, ("type", *_FURTHER)) for block in two]
            said = {_said(name or "") for name in named}
            if len(two) == 2 and None not in named and said != {"most"}:
                slots = {"block": str(named[0]), "other": str(named[1])}
                kind = f"co {_said(' '.join(slots.values()))}"
                yield Draft("co", scene, (picture,), slots, kind=kind)

    def right(self, asked: Draft) -> str:
        """Return the colors of the blocks that the text names."""
        return " and ".join(block.color for block in sight.named(asked))

    def offer(self, asked: Draft, right: str, rng: np.random.Generator) -> Sequence[str]:
        """Return four of the six ordered pairs of colors in the picture, with the right one."""
        colors = sorted({block.color for block in asked.picture.blocks})
        pairs = [" and ".join(two) for two in itertools.permutations(colors, 2)]
        others = base.shuffled(rng, [pair for pair in pairs if pair != right])
        return [right, *others[:3]] if len(pairs) == 6 and right in pairs else ()


_COMPARISONS: Mapping[str, tuple[str, Callable[[Block], float], int]] = {
    "tallest": ("si-height", sight.height_m, 1),
    "shortest": ("si-height", sight.height_m, -1),
    # The longest side of the box that a block fits in, however it lies.
    "longest": ("si-length", lambda block: max(SHAPES[block.type].sides_m), 1),
    "the most space": ("si-volume", lambda block: SHAPES[block.type].volume_m3, 1),
    "the least space": ("si-volume", lambda block: SHAPES[block.type].volume_m3, -1),
}
"""Stem of the wording, measure, and 1 to ask for the most of it or -1 for the least."""
_LEAST_RATIO, _EXACT, _TRIES = 1.3, 0.01, 6
_TIMES: Mapping[str, float] = base.WORDS["times_as_tall"]


class SizeMaker(StaticMaker):
    """SI: the tallest, longest or largest of four blocks; the ratio of the heights of two."""

    subtask: Subtask = "SI"

    def ask(self, scene: Scene, view: View, rng: np.random.Generator) -> Iterator[Draft]:
        """Compare four blocks and two blocks in turn."""
        studied = sight.seen_blocks(sight.goal_picture(scene, view), sight.STUDIED)
        for number in range(2 * _TRIES if len(studied) > 1 else 0):
            is_choice = number % 2 == 0
            chosen = sight.orders_of(base.shuffled(rng, studied)[: 4 if is_choice else 2])
            if is_choice:
                picture = sight.recolored(scene, view, rng)
            else:
                picture = sight.with_own_colors(scene.blocks, chosen, view, rng)
            blocks = [sight.block_of(picture.blocks, order) for order in chosen]
            named = [sight.drawn_name(rng, block, picture, ("color", "side")) for block in blocks]
            if any(name is None or "highest" in name for name in named):
                continue
            if not is_choice:
                slots = {"block": str(named[0]), "other": str(named[1])}
                yield Draft("si-times", scene, (picture,), slots)
            elif len(named) == 4:
                how, options = pick(rng, list(_COMPARISONS)), [f"the {name}" for name in named]
                stem, slots = _COMPARISONS[how][0], {"comparison": how}
                yield Draft(stem, scene, (picture,), slots, options, how)

    def right(self, asked: Draft) -> str:
        """Compare the blocks that the text or the options name."""
        if "comparison" not in asked.slots:
            one, other = sight.named(asked, sight.STUDIED)
            ratio = sight.height_m(one) / sight.height_m(other)
            right = [word for word, known in _TIMES.items() if abs(ratio - known) < _EXACT]
            if not right:
                raise UnfairError(f"is {ratio:.2f} times as tall, which no option says")
            return right[0]
        blocks = sight.resolve_seen(asked.texts, asked.picture, sight.STUDIED)
        _, measure, sign = _COMPARISONS[asked.slots["comparison"]]
        sizes = [measure(block) for block in blocks]
        most, next_one = sorted(sizes, key=lambda size: -sign * size)[:2]
        if max(most, next_one) < _LEAST_RATIO * min(most, next_one):
            raise UnfairError("two of the blocks are about as large")
        return asked.texts[sizes.index(most)]

    def offer(self, asked: Draft, right: str, rng: np.random.Generator) -> Sequence[str]:
        """Return four neighboring ratios of the five."""
        words = list(_TIMES) if asked.wording == "si-times" else []
        start = pick(rng, [i for i in (0, 1) if right in words[i : i + 4]])
        return words[start : start + 4]


# Counts

_TYPES_OF = {
    f"{word}es" if word == "arch" else f"{word}s": types
    for word, types in sight.SHAPE_WORDS.items()
}
"""The types that each plural names."""
_WEDGED_M = 0.005


def layers_of(blocks: Sequence[Block]) -> Mapping[int, int]:
    """Return the layer of each block, by order: one more than the highest layer it rests on.

    Raises UnfairError if the picture suggests another one: a block that is wedged between two
    slopes rests on them, yet it looks as if it were beside them.
    """
    below = support_graph(blocks)
    height = {block.order: bounds_m(block)[:, 2] for block in blocks} | {GROUND: np.zeros(2)}
    plain = {
        order: [o for o in under if height[order][0] > height[o][1] - _WEDGED_M]
        for order, under in below.items()
    }
    try:
        counted, looked = (graph_of(one).layers for one in (below, plain))
    except CycleError:
        raise UnfairError("some block rests on itself") from None
    if not all(below.values()) or counted != looked:
        raise UnfairError("some block rests on nothing, or stands lower than its supports reach")
    return dict(zip(below, counted, strict=True))


def sure_blocks(picture: QuestionPicture) -> int:
    """Count the blocks that must be there, judging by the picture.

    At least the share `COUNTED` of each block is visible, except for at most one. That one must be
    there, whatever it is, if a block of which `NAMED` is visible rests on it alone, and would
    otherwise float. Raises UnfairError if more are hidden, or nothing shows that one is needed.
    """
    seen = sight.sizes(picture).shown
    hidden = [order for order, share in seen.items() if share < sight.COUNTED]
    if len(hidden) > 1:
        raise UnfairError("several blocks are hidden")
    below = support_graph(picture.blocks)
    for order in hidden:
        if not any(seen[o] >= sight.NAMED and below[o] == {order} for o in below):
            raise UnfairError(f"nothing that can be seen rests on block {order} alone")
    return len(picture.blocks)


_all = functools.partial(sight.require_seen, least=sight.COUNTED)
_shaped = sight.require_shapes_seen


def _on_ground(blocks: Sequence[Block]) -> list[Block]:
    below = support_graph(blocks)
    return [block for block in blocks if GROUND in below[block.order]]


def _types(blocks: Sequence[Block]) -> Counter[str]:
    return Counter(block.type for block in blocks)


def _layer_of_block(picture: QuestionPicture, slots: Slots) -> int:
    (block,) = sight.resolve_seen([slots["block"]], picture)
    sight.require_supports_seen(picture, [block])
    return layers_of(picture.blocks)[block.order]


def _layer_numbers(picture: QuestionPicture) -> list[Slots]:
    return [{"layer": str(n + 1)} for n in range(max(block.layer for block in picture.blocks))]


@dataclass(frozen=True)
class Tally:
    """One way of counting.

    `count` returns the number, and raises UnfairError if the picture does not show it; `values` are
    the numbers offered; `slots` returns those that a text about a picture can have. `is_recolored`
    if the kit's colors would reveal too much, or would give too few blocks a name.
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
    "lc-all": Tally(lambda p, _: max(layers_of(_all(p)).values()), range(1, 9)),
    "lc-block": Tally(
        _layer_of_block,
        range(1, 9),
        lambda p: [{"block": name} for name in sight.plain_names(p).values()],
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
        lambda p, _: len({sight.shape_word(b.type) for b in _shaped(p)}),
        range(1, len(sight.SHAPE_WORDS) + 1),
    ),
    "tc-once": Tally(lambda p, _: sum(n == 1 for n in _types(_shaped(p)).values()), range(0, 7)),
    "tc-ground": Tally(lambda p, _: len(_types(_on_ground(_shaped(p)))), range(1, 8)),
    "tc-kinds": Tally(
        lambda p, _: len({b.kind for b in _shaped(p)}), range(2, 15), is_recolored=True
    ),
}
"""Tallies by the stem of their wordings."""


class TallyMaker(StaticMaker):
    """OC, LC or TC: the ways of counting whose stems begin with the subtask."""

    def __init__(self, subtask: Subtask) -> None:
        self.subtask = subtask
        self._tallies = {s: one for s, one in TALLIES.items() if s[:2] == subtask.lower()}

    def ask(self, scene: Scene, view: View, rng: np.random.Generator) -> Iterator[Draft]:
        """Ask for one count after another."""
        colored, plain = sight.recolored(scene, view, rng), sight.goal_picture(scene, view)
        for stem, tally in base.shuffled(rng, [*self._tallies.items()]):
            picture, kind = colored if tally.is_recolored else plain, ""
            if stem == "oc-hidden":
                shares = sight.sizes(picture).shown.values()
                kind = f"{stem}-{sum(share < sight.COUNTED for share in shares)}"
            if texts := tally.slots(picture):
                yield Draft(stem, scene, (picture,), pick(rng, texts), kind=kind)

    def right(self, asked: Draft) -> str:
        """Count again."""
        return str(self._tallies[asked.wording].count(asked.picture, asked.slots))

    def offer(self, asked: Draft, right: str, rng: np.random.Generator) -> Sequence[str]:
        """Return four consecutive numbers."""
        return base.window(rng, self._tallies[asked.wording].values, int(right))


_COUNTS, _TEXTS_TRIED = range(1, 11), 8


class NumberMaker(StaticMaker):
    """NU: the number of blocks of a color, a shape, or both.

    If color counts, options and the right one are drawn first, and blocks colored accordingly.
    """

    subtask: Subtask = "NU"

    def ask(self, scene: Scene, view: View, rng: np.random.Generator) -> Iterator[Draft]:
        """Ask for a color, a shape, or both, in newly drawn colors."""
        for _ in range(_TEXTS_TRIED):
            color, *others = sight.palette(rng)
            kind = pick(rng, ("color", "shape", "both"))
            noun = "blocks" if kind == "color" else pick(rng, list(_TYPES_OF))
            types = _TYPES_OF.get(noun, BLOCK_TYPES)
            mine = sight.orders_of([block for block in scene.blocks if block.type in types])
            fours = [_COUNTS[i : i + 4] for i in range(min(len(mine), len(_COUNTS)) - 3)]
            if kind == "shape":
                picture, what = sight.recolored(scene, view, rng), noun
                options = base.window(rng, _COUNTS, len(mine))
            elif fours:
                four = pick(rng, fours)
                ours = dict.fromkeys(base.shuffled(rng, mine)[: pick(rng, four)], color)
                other = {order: pick(rng, others) for order in mine}
                drawn = {b.order: pick(rng, (color, *others)) for b in scene.blocks} | other | ours
                picture = QuestionPicture("scene", sight.colored(scene.blocks, drawn), view)
                what, options = f"{color} {noun}", list(map(str, four))
            else:
                continue
            if options:
                yield Draft("nu", scene, (picture,), {"what": what}, options, kind)

    def right(self, asked: Draft) -> str:
        """Count the blocks that a text such as `red blocks`, `cubes` or `red cubes` names."""
        what, picture = asked.slots["what"], asked.picture
        first, _, rest = what.partition(" ")
        color, noun = (first, rest) if first in COLORS else ("", what)
        if noun not in (*_TYPES_OF, "blocks"):
            raise UnfairError(f"{what!r} cannot be counted")
        # Colors can be counted where shapes cannot.
        blocks = _all(picture) if noun == "blocks" else _shaped(picture)
        types = _TYPES_OF.get(noun, BLOCK_TYPES)
        return str(sum(color in ("", block.color) and block.type in types for block in blocks))
