"""VP, OR: one structure seen from elsewhere, or its subassemblies in the order of building.

VP: the structures of four options come from two changes, each made or not: mirroring, two blocks
that exchange their colors, a block that is put a little elsewhere. All have the same blocks in the
same colors, none is the odd one out, and any of the four may be the one that is shown: it is drawn.
So options alone tell nothing. Comparing how much of each color shows does not either: a set of
options is used where that is right for one of the four that may be shown, which is what chance
gives. Scenes are recolored, as many are their own mirror image.

OR: every picture shows the whole structure, so that nothing in it is larger or smaller for being
early: the blocks of one stage have one color, all the others another. A block of each stage rests
on one of the stage before, so that there is one order, and the stages of a structure with several
towers are no layers: no sorting by size, height or place in the picture gives the order.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.blocks import COLORS, Color
from phyblock.domain.question import Question, QuestionPicture, Subtask
from phyblock.domain.scene import Block, Scene
from phyblock.domain.symmetry import Symmetry, turned_form
from phyblock.making.questions import base
from phyblock.making.questions.base import (
    Draft,
    UnfairError,
    View,
    are_told_apart,
    draft,
    drawn_view,
    pick,
    shuffled,
)
from phyblock.making.questions.structures import group_of
from phyblock.making.scenes.sketch import transformed
from phyblock.sim.balance import surely_stands
from phyblock.sim.contact import drop_height_m, find_overlaps
from phyblock.sim.question_pictures import least_difference, seen, shown_pixels

# VP

_FRONTS_DEG = (0.0, 90.0, 180.0, 270.0)
"""Straight on: a mirror image of a slanted view can be a true view of the same side."""
_FRONT_ELEVATION_DEG = 22.0
_SIDES: dict[str, float] = base.WORDS["sides_seen"]
_LEAST_TURN_DEG = 60
_FAMILIES_TRIED = 8
_LEAST_SHOWN = 100
"""Pixels of 256 x 256 that both views show of blocks that exchange their colors."""
_SHOWN_IN_FRONT = 0.8
"""The least share of all blocks of which the front view shows something."""
_LEAST_SHARE = 0.1
"""In so much of what shows of the blocks any two options differ: less is easily overlooked."""
_SIDE_PIXELS = 500
"""Whole pictures are compared by side, not structures that are nearly alike."""


@dataclass(frozen=True)
class _Structure:
    """Blocks as they stand; `is_mirrored` where views go round them the other way."""

    blocks: tuple[Block, ...]
    is_mirrored: bool = False

    def mirrored(self) -> _Structure:
        """Its mirror image, which shows the mirrored picture from the mirrored view."""
        return _Structure(transformed(self.blocks, Symmetry(0, True)), not self.is_mirrored)

    def changed(self, change: Mapping[int, Block]) -> _Structure:
        """With other blocks in the place of some, by order; mirrored where there are none."""
        if not change:
            return self.mirrored()
        if self.is_mirrored:
            return self.mirrored().changed(change).mirrored()
        return _Structure(tuple(change.get(block.order, block) for block in self.blocks))

    def seen_from(self, view: View) -> QuestionPicture:
        """The picture from a view; of a mirrored structure from the mirrored view."""
        azimuth = (180.0 - view[0]) % 360 if self.is_mirrored else view[0] % 360
        return QuestionPicture("scene", self.blocks, (azimuth, view[1]))


class ViewpointMaker(base.Maker):
    """Kinds: `vp-match`, a structure from anywhere; `vp-side`, what is seen from a side named."""

    subtask: Subtask = "VP"
    scenes_tried = 300
    drafts_a_scene = 2

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """One draft of each kind at most."""
        scene, view = base.recolored(scene, rng), drawn_view(rng)
        turn = float(rng.integers(_LEAST_TURN_DEG, 361 - _LEAST_TURN_DEG))
        yield from _match(scene, rng, "vp-match", view, (view[0] + turn, drawn_view(rng)[1]), "")
        side = pick(rng, tuple(_SIDES))
        front = (pick(rng, _FRONTS_DEG), _FRONT_ELEVATION_DEG)
        if side == "behind":
            yield from _match(scene, rng, "vp-side", front, _from_side(front, side), side)
        else:
            yield from _side(scene, rng, front, side)

    def rederive(self, question: Question) -> tuple[int, ...]:
        """By the blocks in the pictures, whichever side they are seen from."""
        slots = base.slots_of(question)
        shown, options = base.picture_of(question, "scene"), base.option_pictures(question)
        if base.of_kind(question) == "vp-side":
            if shown.view_deg[0] not in _FRONTS_DEG:
                raise UnfairError("the first picture is not straight from the front")
            azimuth = _from_side(shown.view_deg, slots["side_words"])[0]
            right = [(option.view_deg[0] - azimuth) % 360 == 0 for option in options]
            alike = [base.same_blocks(shown.blocks, option.blocks) for option in options]
            return base.only_index([a and b for a, b in zip(right, alike, strict=True)])
        form = turned_form(shown.blocks)
        return base.only_index([turned_form(option.blocks) == form for option in options])


def _from_side(front: View, side: str) -> View:
    return (front[0] + _SIDES[side], front[1])


def _match(
    scene: Scene, rng: np.random.Generator, stem: str, first: View, second: View, side: str
) -> Iterator[Draft]:
    """Four structures from the second view, one of which the first picture shows."""
    for _ in range(_FAMILIES_TRIED):
        family, changes = _family(scene, rng, (first, second))
        if not family or _hits(family, first, second) != 1.0:
            continue
        shown, options = ([one.seen_from(view) for one in family] for view in (first, second))
        if are_told_apart(shown) and are_told_apart(options) and _differ_at_a_glance(options):
            right = int(rng.integers(len(family)))
            dealt = [options[i] for i in base.right_first(right, range(len(family)))]
            pictures, slots = [shown[right]], {"side_words": side} if side else {}
            value = side or changes
            yield draft(scene, rng, stem, dealt, pictures, slots, value=value, changes=changes)
            return


def _family(
    scene: Scene, rng: np.random.Generator, views: Sequence[View]
) -> tuple[tuple[_Structure, ...], str]:
    """A structure with each of two changes made or not; none where two of them are the same."""
    base = _Structure(scene.blocks)
    names = shuffled(rng, ("mirror", "swap", "swap", "shift"))[:2]
    family, touched = [base], []
    for name in names:
        change = _change(base, name, rng, views)
        if change is None:
            return (), ""
        touched += list(change)
        family += [one.changed(change) for one in family]
    forms = {turned_form(one.blocks) for one in family}
    if len(forms) < len(family) or len(set(touched)) < len(touched):
        return (), ""
    return tuple(family), "+".join(sorted(names))


def _change(
    base: _Structure, name: str, rng: np.random.Generator, views: Sequence[View]
) -> Mapping[int, Block] | None:
    """The blocks that a change puts in the place of others, none for mirroring; or None."""
    if name == "mirror":
        return {}
    if name == "shift":
        blocks = shifted(base.blocks, rng)
        pairs = zip(base.blocks, blocks or (), strict=False)
        return {b.order: b for a, b in pairs if a != b} if blocks else None
    counts = [_pixels(base, view) for view in views]
    shown = [b for b in base.blocks if min(one[b.order] for one in counts) >= _LEAST_SHOWN]
    unlike = [(a, b) for a, b in itertools.combinations(shown, 2) if a.color != b.color]
    if not unlike:
        return None
    a, b = pick(rng, unlike)
    return {a.order: replace(a, color=b.color), b.order: replace(b, color=a.color)}


def _side(scene: Scene, rng: np.random.Generator, front: View, side: str) -> Iterator[Draft]:
    """Left and right of a structure and of its mirror image; either may be the one shown."""
    base = _Structure(scene.blocks)
    opposite = next(name for name in _SIDES if name not in (side, "behind"))
    views = [_from_side(front, name) for name in (side, opposite)]
    options = [one.seen_from(view) for one in (base, base.mirrored()) for view in views]
    shown = base.seen_from(front)
    pixels = _pixels(base, front).values()
    if sum(n > 0 for n in pixels) < _SHOWN_IN_FRONT * len(pixels):
        return
    if are_told_apart([shown, *options], least=_SIDE_PIXELS) and _differ_at_a_glance(options):
        if rng.random() < 0.5:
            # The mirror image is shown: what it looks like from a side is the other side mirrored.
            shown, options = base.mirrored().seen_from(front), options[::-1]
        slots = {"side_words": side}
        yield draft(scene, rng, "vp-side", options, [shown], slots, value=side, changes="mirror")


def _differ_at_a_glance(options: Sequence[QuestionPicture]) -> bool:
    """True if any two of the options differ in at least `_LEAST_SHARE` of what shows of blocks."""
    shots = [seen(option) for option in options]
    area = max(int((shot.block >= 0).sum()) for shot in shots)
    return least_difference(shots) >= _LEAST_SHARE * area


def _hits(family: Sequence[_Structure], first: View, second: View) -> float:
    """Number of structures that the nearest histogram of colors finds again; ties count in part."""
    shown, options = (np.array([_histogram(s, view) for s in family]) for view in (first, second))
    apart = shown[:, None, :] - options[None, :, :]
    found = []
    for far in (np.abs(apart).sum(axis=2), (apart**2).sum(axis=2)):
        nearest = far <= far.min(axis=1, keepdims=True) + 1e-9
        found.append(float((np.diag(nearest) / nearest.sum(axis=1)).sum()))
    return found[0] if found[0] == found[1] else 0.0


def _histogram(structure: _Structure, view: View) -> NDArray[np.float64]:
    """Share of each color in what shows of the blocks, rounded to a thousandth."""
    pixels = _pixels(structure, view)
    counts = np.zeros(len(COLORS))
    for block in structure.blocks:
        counts[COLORS.index(block.color)] += pixels[block.order]
    shares: NDArray[np.float64] = np.round(counts / counts.sum(), 3)
    return shares


def _pixels(structure: _Structure, view: View) -> dict[int, int]:
    """Pixels that show each block, by order: those of its mirror image, whatever the colors."""
    plain = (structure.mirrored() if structure.is_mirrored else structure).seen_from(view)
    plain = replace(plain, blocks=tuple(replace(b, color="red") for b in plain.blocks))
    return shown_pixels(plain, seen(plain))


_BLOCKS_TRIED = 3
_STEPS_M = tuple(
    (x, y) for step in (0.025, 0.05) for x, y in ((step, 0), (-step, 0), (0, step), (0, -step))
)
_FLOATS_M = 0.0005


def shifted(blocks: Sequence[Block], rng: np.random.Generator) -> tuple[Block, ...] | None:
    """All blocks, with one that carries nothing moved along its level by 2.5 or 5 cm.

    None where none of a few that are tried would stay, by statics with a margin: of 207 such moves
    a simulation lets no other stay but two, whose weight is over an edge.
    """
    carrying = {order for block in blocks for order in block.depend}
    free = [block for block in blocks if block.order not in carrying]
    for block in shuffled(rng, free)[:_BLOCKS_TRIED]:
        rest = [other for other in blocks if other.order != block.order]
        for x, y in shuffled(rng, _STEPS_M):
            at_x, at_y, z = block.position_m
            place = (round(at_x + x, 4) + 0.0, round(at_y + y, 4) + 0.0, z)
            moved = replace(block, position_m=place)
            if drop_height_m(moved, rest) > _FLOATS_M or find_overlaps((*rest, moved)):
                continue
            every = tuple(moved if other.order == block.order else other for other in blocks)
            if surely_stands(group_of(every, moved.order)):
                return every
    return None


# OR

_STAGES = 4
_LEAST_BLOCKS = 6
_VIEWS_TRIED = 4
_CUTS_TRIED = 150
_GO_ON = 0.75
_PAIRS: tuple[tuple[Color, Color], ...] = (
    ("yellow", "blue"),
    ("orange", "blue"),
    ("red", "yellow"),
    ("blue", "orange"),
    ("green", "orange"),
    ("yellow", "green"),
)
"""The color of a stage and that of all else."""
Stages = tuple[frozenset[int], ...]


class OrderingMaker(base.Maker):
    """Kinds: `or-build` and `or-apart`."""

    subtask: Subtask = "OR"
    scenes_tried = 240

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """One draft, of either kind, of a structure of which every block can be seen."""
        if len(scene) < _LEAST_BLOCKS:
            return
        for _ in range(_VIEWS_TRIED):
            plain = QuestionPicture("scene", scene.blocks, drawn_view(rng), framed=scene.blocks)
            if base.are_seen(plain, base.orders_of(scene.blocks), base.COUNTED):
                yield from _draft_from(scene, plain, rng)
                return

    def rederive(self, question: Question) -> tuple[int, ...]:
        """By the stages that hold blocks resting on those of others: one order must follow."""
        slots, scene = base.slots_of(question), question.scene
        options = base.option_pictures(question)
        stages = tuple(base.highlighted(one, scene.blocks, slots) for one in options)
        if sorted(itertools.chain(*stages)) != sorted(b.order for b in scene.blocks):
            raise UnfairError("the stages do not hold every block once")
        base.require_seen(options[0], base.orders_of(scene.blocks), base.COUNTED)
        order = _only_order(scene, stages)
        if order is None:
            raise UnfairError("what rests on what leaves more than one order, or none")
        return order if base.of_kind(question) == "or-build" else order[::-1]


def _draft_from(scene: Scene, plain: QuestionPicture, rng: np.random.Generator) -> Iterator[Draft]:
    for _ in range(_CUTS_TRIED):
        stages = _cut(scene, rng)
        if _only_order(scene, stages) is None or _is_sorted_by_eye(plain, stages):
            continue
        kind, pair = pick(rng, ("or-build", "or-apart")), pick(rng, _PAIRS)
        in_order = stages if kind == "or-build" else stages[::-1]
        options = []
        for stage in in_order:
            blocks = (replace(b, color=pair[b.order not in stage]) for b in plain.blocks)
            options.append(replace(plain, blocks=tuple(blocks)))
        if are_told_apart(options):
            slots: dict[str, str] = {"color": pair[0], "other": pair[1]}
            facts: dict[str, Any] = {"stages": [sorted(stage) for stage in stages]}
            yield draft(scene, rng, kind, options, [], slots, value=kind, **facts)
            return


def _cut(scene: Scene, rng: np.random.Generator) -> Stages:
    """A random order of building, tower by tower rather than layer by layer, cut in four."""
    order: list[int] = []
    while len(order) < len(scene):
        ready = scene.graph.ready(sum(1 << vertex for vertex in order))
        on_last = [v for v in ready if order and order[-1] in scene.graph.depends_on[v]]
        go_on = on_last and rng.random() < _GO_ON
        order.append(pick(rng, sorted(on_last if go_on else ready)))
    places = 1 + rng.choice(len(scene) - 1, size=_STAGES - 1, replace=False)
    ends = [0, *sorted(places.tolist()), len(scene)]
    orders = [scene.blocks[vertex].order for vertex in order]
    return tuple(frozenset(orders[a:b]) for a, b in itertools.pairwise(ends))


def _only_order(scene: Scene, stages: Stages) -> tuple[int, ...] | None:
    """Places of the stages in the one order in which they can follow; None unless there is one."""
    stage_of = {order: place for place, stage in enumerate(stages) for order in stage}
    before = {
        (stage_of[below], stage_of[block.order])
        for block in scene.blocks
        for below in block.depend
        if stage_of[below] != stage_of[block.order]
    }
    fitting = [
        order
        for order in itertools.permutations(range(len(stages)))
        if all(order.index(early) < order.index(late) for early, late in before)
    ]
    return fitting[0] if len(fitting) == 1 else None


def _is_sorted_by_eye(plain: QuestionPicture, stages: Stages) -> bool:
    """True if size or height of what is highlighted, either way round, gives the order."""
    shown, looks = seen(plain).block, []
    for stage in stages:
        blocks = [(i, b.position_m[2]) for i, b in enumerate(plain.blocks) if b.order in stage]
        rows = np.nonzero(np.isin(shown, [i for i, _ in blocks]))[0]
        heights = [height for _, height in blocks]
        levels = (float(np.mean(heights)), max(heights), min(heights))
        looks.append((len(stage), len(rows), *levels, rows.mean(), rows.min(), rows.max()))
    columns = map(list, zip(*looks, strict=True))
    return any(column in (sorted(column), sorted(column)[::-1]) for column in columns)
