"""VP, OR: one structure seen from elsewhere, or its subassemblies in the order of building.

VP: the four options show one structure from one view in four colorings; the first picture shows one
of these, each equally likely, from another view. Colors are only exchanged between blocks at the
same height. So all outlines are equal, each color appears at the same heights, options alone reveal
nothing, and a reader who compares the visible shares of colors finds one answer in four.

OR: every picture shows the whole structure, so that sizes do not depend on the stage: the
blocks of one stage have one color, all others another. A block of each stage rests on one of the
stage before, so that there is only one order. Stages follow towers rather than layers: sorting by
size, height or place in the picture does not give the order.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from phyblock.domain.blocks import COLORS, Color
from phyblock.domain.question import LETTERS, QuestionPicture, Subtask
from phyblock.domain.scene import Block, Scene, turned_form
from phyblock.making.questions import base, sight
from phyblock.making.questions.base import Draft, Maker, UnfairError, View, pick
from phyblock.sim.question_pictures import is_inside, seen, shown_pixels

# VP

_FRONTS_DEG = (0.0, 90.0, 180.0, 270.0)
"""Straight views only: a mirror image of a slanted one can be a true view of the same side."""
_FRONT_ELEVATION_DEG = 22.0
_SIDES: dict[str, float] = base.WORDS["sides_seen"]
_LEAST_TURN_DEG, _FAMILIES_TRIED = 60, 40
_LEAST_SHARE = 0.12
"""Minimum share of the visible blocks in which two options differ: less is easily overlooked."""
_LEVEL_M = 0.01


class ViewpointMaker(Maker):
    """Kinds: `vp-match`, a structure from any side; `vp-side`, from the side that is named."""

    subtask: Subtask = "VP"
    spare = 2.0
    drafts_a_scene = 2

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Propose one question of each kind."""
        view = base.drawn_view(rng)
        turn = float(rng.integers(_LEAST_TURN_DEG, 361 - _LEAST_TURN_DEG))
        elsewhere = ((view[0] + turn) % 360, base.drawn_view(rng)[1])
        yield from _colorings(scene, rng, "vp-match", view, elsewhere, "")
        side, front = pick(rng, tuple(_SIDES)), (pick(rng, _FRONTS_DEG), _FRONT_ELEVATION_DEG)
        yield from _colorings(scene, rng, "vp-side", front, _from_side(front, side), side)

    def answer(self, asked: Draft) -> tuple[int, ...]:
        """Compare the blocks in the pictures, from any side."""
        shown, options = asked.picture, asked.drawn
        if asked.wording == "vp-side":
            if shown.view_deg[0] not in _FRONTS_DEG:
                raise UnfairError("the first picture is not straight from the front")
            azimuth = _from_side(shown.view_deg, asked.slots["side_words"])[0]
            mine, *looks = ({(b.look, b.position_m) for b in p.blocks} for p in (shown, *options))
            sides = [option.view_deg[0] % 360 for option in options]
            pairs = zip(sides, looks, strict=True)
            return base.only_index([side == azimuth and look == mine for side, look in pairs])
        form = turned_form(shown.blocks)
        return base.only_index([turned_form(option.blocks) == form for option in options])


def _from_side(front: View, side: str) -> View:
    return ((front[0] + _SIDES[side]) % 360, front[1])


def _colorings(
    scene: Scene, rng: np.random.Generator, stem: str, first: View, second: View, side: str
) -> Iterator[Draft]:
    """Propose four colorings from the second view, one of which the first picture shows."""
    red = tuple(replace(block, color="red") for block in scene.blocks)
    plain = [QuestionPicture("scene", red, view) for view in (first, second)]
    # The visible pixels of each block in both views, shape (2, blocks), and of all blocks.
    pixels = np.array([[*shown_pixels(one, seen(one)).values()] for one in plain])
    every = pixels.sum(axis=1, keepdims=True)
    for _ in range(_FAMILIES_TRIED):
        scene = replace(scene, blocks=sight.recolored(scene, first, rng).blocks)
        four = [scene.blocks, *(_exchanged(scene.blocks, rng) for _ in LETTERS[1:])]
        worn = np.array([[[b.color == one for one in COLORS] for b in blocks] for blocks in four])
        differ = [(one != other).any(axis=1) for one, other in itertools.combinations(worn, 2)]
        if (pixels @ np.array(differ).T / every).min() < _LEAST_SHARE:
            continue
        # Comparing the visible shares of colors, rounded to a thousandth, finds one of the four;
        # ties count in part.
        shares = np.round(np.tensordot(pixels, worn, axes=(1, 1)) / every[:, None], 3)
        far = np.abs(shares[0][:, None, :] - shares[1][None, :, :]).sum(axis=2)
        nearest = far <= far.min(axis=1, keepdims=True) + 1e-9
        if round(float((np.diag(nearest) / nearest.sum(axis=1)).sum()), 6) != 1:
            continue
        shown, options = ([QuestionPicture("scene", b, v) for b in four] for v in (first, second))
        is_new = len({turned_form(blocks) for blocks in four}) == len(four)
        if is_new and all(map(is_inside, (shown[0], options[0]))):
            right = int(rng.integers(len(four)))
            dealt = [options[right], *options[:right], *options[right + 1 :]]
            slots = {"side_words": side} if side else {}
            yield Draft(stem, scene, (shown[right],), slots, dealt)
            return


def _exchanged(blocks: Sequence[Block], rng: np.random.Generator) -> tuple[Block, ...]:
    """Return the blocks with colors shuffled among those at each height."""
    colors: dict[int, Color] = {}
    for level in {round(block.position_m[2] / _LEVEL_M) for block in blocks}:
        same = [block for block in blocks if round(block.position_m[2] / _LEVEL_M) == level]
        drawn = base.shuffled(rng, [block.color for block in same])
        colors |= dict(zip(sight.orders_of(same), drawn, strict=True))
    return sight.colored(blocks, colors)


# OR

_LEAST_BLOCKS, _VIEWS_TRIED, _CUTS_TRIED = 6, 4, 400
_GO_ON = 0.75
_MOST_SORTED, _MOST_RISING = 4, 2
"""Maximum surplus of rising or falling pairs, of six, in a measure and in mean height."""
_PAIRS = tuple(itertools.permutations(sight.PLAIN_COLORS, 2))
"""The color of a stage and that of all other blocks."""
Stages = Sequence[frozenset[int]]


class OrderingMaker(Maker):
    """Kinds: `or-build` and `or-apart`."""

    subtask: Subtask = "OR"
    drafts_a_scene = 2

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Propose questions, of either kind, from views of a structure that show every block."""
        tries = _VIEWS_TRIED if len(scene) >= _LEAST_BLOCKS else 0
        for view in [base.drawn_view(rng) for _ in range(tries)]:
            plain = QuestionPicture("scene", scene.blocks, view, framed=scene.blocks)
            if not sight.are_seen(plain, sight.COUNTED):
                continue
            for _ in range(_CUTS_TRIED):
                stages = _cut(scene, rng)
                if _only_order(scene, stages) is None or _is_sorted_by_eye(plain, stages):
                    continue
                kind, pair = pick(rng, ("or-build", "or-apart")), pick(rng, _PAIRS)
                slots = dict(zip(("color", "other"), pair, strict=True))
                lots = [sight.highlighted(scene.blocks, stage, slots) for stage in stages]
                options = [replace(plain, blocks=blocks) for blocks in lots]
                if sight.are_told_apart(options):
                    ordered = options if kind == "or-build" else options[::-1]
                    facts = {"stages": [sorted(stage) for stage in stages]}
                    yield Draft(kind, scene, (), slots, ordered, facts=facts)
                    break

    def answer(self, asked: Draft) -> tuple[int, ...]:
        """Find the only order that the dependencies allow."""
        scene, options = asked.scene, asked.drawn
        stages = [sight.lot_of(one, scene.blocks, asked.slots) for one in options]
        if sorted(itertools.chain(*stages)) != sorted(b.order for b in scene.blocks):
            raise UnfairError("the stages do not hold every block once")
        sight.require_seen(options[0], sight.COUNTED)
        order = _only_order(scene, stages)
        if order is None:
            raise UnfairError("the dependencies allow more than one order, or none")
        return order if asked.wording == "or-build" else order[::-1]


def _cut(scene: Scene, rng: np.random.Generator) -> Stages:
    """Return a random building order, by towers rather than layers, cut into four stages."""
    order: list[int] = []
    while len(order) < len(scene):
        ready = scene.graph.ready(sum(1 << vertex for vertex in order))
        on_last = [v for v in ready if order and order[-1] in scene.graph.depends_on[v]]
        go_on = on_last and rng.random() < _GO_ON
        order.append(pick(rng, sorted(on_last if go_on else ready)))
    places = 1 + rng.choice(len(scene) - 1, size=len(LETTERS) - 1, replace=False)
    ends = [0, *sorted(places.tolist()), len(scene)]
    orders = [scene.blocks[vertex].order for vertex in order]
    return [frozenset(orders[a:b]) for a, b in itertools.pairwise(ends)]


def _only_order(scene: Scene, stages: Stages) -> tuple[int, ...] | None:
    """Return the places of the stages in their only possible order, or None."""
    stage_of = {order: place for place, stage in enumerate(stages) for order in stage}
    before: list[set[int]] = [set() for _ in stages]
    for block in scene.blocks:
        before[stage_of[block.order]] |= {stage_of[below] for below in block.depend}
    fitting = [
        order
        for order in itertools.permutations(range(len(stages)))
        if all(before[stage] <= set(order[: i + 1]) for i, stage in enumerate(order))
    ]
    return fitting[0] if len(fitting) == 1 else None


def _is_sorted_by_eye(plain: QuestionPicture, stages: Stages) -> bool:
    """True if size, height or place of highlighted blocks reveals much of the order, either way."""
    shown, looks = seen(plain).block, []
    for stage in stages:
        blocks = [(i, b.position_m[2]) for i, b in enumerate(plain.blocks) if b.order in stage]
        rows, columns = np.nonzero(np.isin(shown, [i for i, _ in blocks]))
        heights = [height for _, height in blocks]
        levels = (float(np.mean(heights)), max(heights), min(heights))
        looks.append((*levels, rows.mean(), rows.min(), rows.max(), columns.mean(), len(rows)))
    steps = (np.sign(np.subtract(b, a)) for a, b in itertools.combinations(looks, 2))
    sorted_by = np.abs(np.sum(list(steps), axis=0))
    return bool(sorted_by.max() > _MOST_SORTED or sorted_by[0] > _MOST_RISING)
