"""RP, AP, RD, RR: relative places, distances, supports and rotations of blocks.

Scenes are recolored so that most blocks have a name. RR: a loose block beside the structure lies as
a block of the structure would after a turn: about the vertical, or about some axis.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from phyblock.domain.blocks import SHAPES, BlockType, Euler, euler_deg_to_matrix, orientation_class
from phyblock.domain.question import QuestionPicture, Subtask
from phyblock.domain.scene import Block, Scene, angles_deg
from phyblock.making.questions import base, sight
from phyblock.making.questions.base import Draft, Floats, StaticMaker, T, UnfairError, View, pick
from phyblock.sim.balance import surely_stands
from phyblock.sim.contact import bounds_m, boxes_near, support_graph, whole_bounds_m
from phyblock.sim.raster import view_axes

_RECOLORED = 6
"""Number of times that the blocks of a view get other colors, and so other names."""


def _named(
    scene: Scene, view: View, rng: np.random.Generator, least: int
) -> Iterator[tuple[QuestionPicture, Mapping[int, str]]]:
    """Yield the picture of a scene in other colors, and the names of `least` or more blocks."""
    for _ in range(_RECOLORED):
        picture = sight.recolored(scene, view, rng)
        names = sight.plain_names(picture)
        if len(names) >= least:
            yield picture, names


def _pairs(items: Sequence[T], rng: np.random.Generator) -> list[tuple[T, T]]:
    """Return up to three random pairs of different items."""
    return base.shuffled(rng, list(itertools.permutations(items, 2)))[:3]


def _top_m(block: Block) -> float:
    """Return the height of a block's highest point above the ground [m]."""
    return float(bounds_m(block)[1, 2])


# RP

_PLACES: Mapping[str, Sequence[str]] = {
    "rp-corner": base.WORDS["sides_of_floor"],
    "rp-upright": base.WORDS["places_upright"],
}
_CLEAR_M, _ABOVE_M, _LEVEL_M, _GAP_M = 0.03, 0.015, 0.005, 0.024
_SIDES = ("farthest to the left", "farthest to the right")
_UPRIGHT = ("rp-highest", "rp-lowest")
_NEARER = 0.75
"""Maximum distance of the nearest block, as a share of that of the next one."""
_RANKED: Mapping[str, Callable[[Block, Floats], float]] = {
    "rp-highest": lambda block, _: -_top_m(block),
    "rp-lowest": lambda block, _: _top_m(block),
    "rp-front": lambda block, away: float(sight.center_m(block) @ away),
    "rp-back": lambda block, away: -float(sight.center_m(block) @ away),
}
"""Measures of which the least is right, from a block and the direction away from the viewer."""


class PositionMaker(StaticMaker):
    """RP: a block's place as seen from another one in the picture; the outermost, the nearest."""

    subtask: Subtask = "RP"

    def ask(self, scene: Scene, view: View, rng: np.random.Generator) -> Iterator[Draft]:
        """Ask about pairs of blocks, and for one of four."""
        for picture, named in _named(scene, view, rng, 2):
            for one, other in _pairs(list(named), rng):
                slots = {"block": named[one], "other": named[other]}
                for stem, places in _PLACES.items():
                    yield Draft(stem, scene, (picture,), slots, places)
            for _ in range(5 if len(named) > 4 else 0):
                anchor, *four = base.shuffled(rng, list(named))[:5]
                options = [f"the {named[order]}" for order in four]
                kind = pick(rng, (*_SIDES, *_RANKED, "rp-nearest"))
                slots = {"extreme": kind} if kind in _SIDES else {}
                if kind == "rp-nearest":
                    slots = {"other": named[anchor]}
                stem = "rp-extreme" if kind in _SIDES else kind
                yield Draft(stem, scene, (picture,), slots, options, kind)

    def right(self, asked: Draft) -> str:
        """Compare the places of the blocks that the text or the options name."""
        blocks, picture = sight.named(asked), asked.picture
        if asked.wording in _PLACES:
            one, other = blocks[0], blocks[-1]
            step = sight.center_m(one) - sight.center_m(other)
            across, away = (float(step @ axis) for axis in _floor_axes(picture.view_deg))
            places = _PLACES[asked.wording]
            if asked.wording == "rp-corner":
                if min(abs(across), abs(away)) < _CLEAR_M:
                    raise UnfairError("is neither clearly to a side nor clearly in front or behind")
                return places[2 * (away > 0) + (across > 0)]
            low, high = bounds_m(one)[:, 2] - bounds_m(other)[::-1, 2]
            if max(abs(across), abs(away)) < _ABOVE_M and (low > -_LEVEL_M or high < _LEVEL_M):
                return places[int(low <= -_LEVEL_M)]
            bottoms = abs(bounds_m(one)[0, 2] - bounds_m(other)[0, 2])
            if abs(across) > _CLEAR_M and bottoms < _LEVEL_M:
                return places[2 + (across > 0)]
            raise UnfairError("is neither over, under nor beside it")
        four = sight.resolve_seen(asked.texts, picture)
        if asked.wording == "rp-extreme":
            extreme = asked.slots["extreme"]
            found = sight.outermost(four, picture, to_left=_SIDES.index(extreme) == 0)
            if found is None:
                raise UnfairError(f"two blocks are about the {extreme}")
            return asked.texts[four.index(found)]
        if asked.wording == "rp-nearest":
            middle = sight.center_m(blocks[0])
            reach = [float(np.linalg.norm(sight.center_m(b) - middle)) for b in four]
            is_clear = min(reach) <= _NEARER * sorted(reach)[1]
        else:
            direction = _floor_axes(picture.view_deg)[1]
            reach = [_RANKED[asked.wording](block, direction) for block in four]
            is_clear = sorted(reach)[1] - min(reach) >= _GAP_M
        if asked.wording in _UPRIGHT:
            sight.require_supports_seen(picture, four)
        if not is_clear:
            raise UnfairError(f"two blocks are about as {asked.wording.removeprefix('rp-')}")
        return asked.texts[reach.index(min(reach))]


def _floor_axes(view: View) -> tuple[Floats, Floats]:
    """Return unit vectors (3,) to the right, and away from the viewer along the floor."""
    right, _, forward = view_axes(*view)
    away = np.array([forward[0], forward[1], 0.0])
    return right, away / np.linalg.norm(away)


# AP

_SIDE_M, _EXACT_CM = 0.001, 0.1
_SCALES: Sequence[BlockType] = ("cube", "cylinder", "arch")
"""Types whose size the prompt gives; one of them must be visible."""
_STEP_CM = 2.5


def _apart(one: Block, other: Block, blocks: Sequence[Block]) -> float:
    x, y, _ = np.abs(sight.center_m(one) - sight.center_m(other)).tolist()
    if min(x, y) > _SIDE_M:
        raise UnfairError("the blocks stand askew, so that their distance cannot be counted")
    if not any({one, other} <= set(lot) for lot in sight.lots_of(blocks)):
        raise UnfairError("the blocks are parts of structures that stand apart")
    return float(max(x, y))


LENGTHS: Mapping[str, Callable[[Block, Block, Sequence[Block]], float]] = {
    "ap-top": lambda one, *_: _top_m(one),
    "ap-bottom": lambda one, *_: float(bounds_m(one)[0, 2]),
    "ap-apart": _apart,
    "ap-rise": lambda one, other, _: abs(_top_m(one) - _top_m(other)),
}
"""Lengths [m] by kind, from a block, another, and all blocks; UnfairError for unclear ones."""
_HEIGHTS = ("ap-top", "ap-bottom")
"""Lengths of one block; together they count as one of three kinds."""
_LADDERS: Sequence[Sequence[str]] = base.WORDS["distances"]
"""Sets of options: few, so that within each every length is right equally often."""


class DistanceMaker(StaticMaker):
    """AP: heights and distances in centimeters, on the grid; a block of known size is the scale."""

    subtask: Subtask = "AP"

    def ask(self, scene: Scene, view: View, rng: np.random.Generator) -> Iterator[Draft]:
        """Ask for heights of blocks and distances of pairs."""
        for picture, named in _named(scene, view, rng, 2):
            for stem in LENGTHS:
                for one, other in _pairs(list(named.values()), rng):
                    slots = {"block": one}
                    if stem in _HEIGHTS:
                        yield Draft(stem, scene, (picture,), slots, kind="height")
                        break
                    yield Draft(stem, scene, (picture,), {**slots, "other": other})

    def right(self, asked: Draft) -> str:
        """Measure between the blocks that the text names."""
        picture = asked.picture
        blocks = sight.named(asked)
        sight.require_supports_seen(picture, blocks)
        if not any(one.type in _SCALES for one in sight.seen_blocks(picture, sight.NAMED)):
            raise UnfairError("no block that gives the scale can be seen")
        length_cm = 100 * LENGTHS[asked.wording](blocks[0], blocks[-1], picture.blocks)
        on_grid_cm = _STEP_CM * round(length_cm / _STEP_CM)
        if abs(length_cm - on_grid_cm) > _EXACT_CM:
            raise UnfairError(f"{length_cm:.1f} cm is no multiple of 2.5 cm")
        return f"{on_grid_cm:g} cm"

    def offer(self, _: Draft, right: str, rng: np.random.Generator) -> Sequence[str]:
        """Return one of the sets of four lengths that hold the right one."""
        fitting = [four for four in _LADDERS if right in four]
        return pick(rng, fitting) if fitting else ()


# RD

_RELATIONS: Mapping[str, Callable[[int, int, sight.Below], bool]] = {
    "rd-on": lambda block, anchor, below: anchor in below[block],
    "rd-under": lambda block, anchor, below: block in below[anchor],
    "rd-needed": lambda block, anchor, below: block in sight.all_below(anchor, below),
    "rd-carried": lambda block, anchor, below: anchor in sight.all_below(block, below),
}


class DependencyMaker(StaticMaker):
    """RD: exactly one of four blocks has the relation; contacts are found in the geometry."""

    subtask: Subtask = "RD"

    def ask(self, scene: Scene, view: View, rng: np.random.Generator) -> Iterator[Draft]:
        """Ask about a random block, with four others to choose from."""
        below = support_graph(scene.blocks)
        for picture, named in _named(scene, view, rng, 5):
            for stem, is_related in base.shuffled(rng, [*_RELATIONS.items()]):
                anchor = pick(rng, list(named))
                rest = base.shuffled(rng, [order for order in named if order != anchor])
                right = [order for order in rest if is_related(order, anchor, below)]
                wrong = [order for order in rest if order not in right]
                four = [f"the {named[order]}" for order in (*right[:1], *wrong[:3])]
                if right and len(four) == 4:
                    yield Draft(stem, scene, (picture,), {"block": named[anchor]}, four)

    def right(self, asked: Draft) -> str:
        """Find the contacts of the blocks that the text and the options name."""
        anchor, *four = sight.resolve_seen((asked.slots["block"], *asked.texts), asked.picture)
        if anchor in four:
            raise UnfairError("asks about a block itself")
        below, is_related = support_graph(asked.picture.blocks), _RELATIONS[asked.wording]
        (index,) = base.only_index([is_related(b.order, anchor.order, below) for b in four])
        return asked.texts[index]


# RR

_STEP_DEG, _LONGER = 15, 1.3
_OFFERED: Mapping[str, Sequence[str]] = base.WORDS["turns"]
"""Turns by wording. Those about axes turn a block that lies along the ground, either way."""
AXIS_TURNS = _OFFERED["rr-axis"]
_SAME_ANGLE, _FREE_M, _ASIDE_M = 1e-4, 0.02, 0.01
_COMPARED, _BESIDE = 6, 3


@functools.lru_cache(maxsize=4096)
def _is_alike(block_type: BlockType, one_deg: Euler, other_deg: Euler) -> bool:
    """True if two orientations of a type look the same."""
    one, other = (orientation_class(block_type, deg) for deg in (one_deg, other_deg))
    return bool(np.abs(np.array(one) - np.array(other)).max() < _SAME_ANGLE)


@functools.lru_cache(maxsize=4096)
def images(stem: str, block: Block) -> Sequence[tuple[str, Euler]]:
    """Return phrases for the turns of a wording, each with the orientation that it gives the block.
    Raises UnfairError if the wording needs a long axis that the block does not have.
    """
    if stem == "rr-axis":
        # The horizontal axis of the world along its longest side.
        sides = np.diff(bounds_m(block), axis=0)[0]
        first, second = sorted(range(3), key=lambda axis: -sides[axis])[:2]
        if first == 2 or sides[first] < _LONGER * sides[second] or block.euler_deg[2] % 90:
            raise UnfairError("has no length that lies along the ground")
        rotation = euler_deg_to_matrix(block.euler_deg)
        found = [(AXIS_TURNS[0], block.euler_deg)]
        for name, axis in zip(AXIS_TURNS[1:], (2, first, 1 - first), strict=True):
            for angle_deg in (90.0, -90.0):
                x_deg, y_deg, z_deg = (angle_deg * (axis == one) for one in range(3))
                quarter = euler_deg_to_matrix((x_deg, y_deg, z_deg))
                found.append((name, angles_deg(quarter @ rotation)))
        return found
    roll, pitch, yaw = block.euler_deg
    found = []
    for turn in range(0, 360, _STEP_DEG):
        side = "" if turn in (0, 180) else " counterclockwise" if turn < 180 else " clockwise"
        said = f"{min(turn, 360 - turn)} degrees{side if stem == 'rr-turn' else ''}"
        found.append((said, (roll, pitch, round((yaw + turn) % 360, 6))))
    return found


def phrases(stem: str, block: Block, other: Block) -> Collection[str]:
    """Return the phrases that are true of a block's rotation compared with another's; none if types
    differ or do not fit the wording. Raises UnfairError as `images`.
    """
    if block.type != other.type or (stem == "rr-axis" and not SHAPES[block.type].is_long):
        return ()
    fits = functools.partial(_is_alike, block.type, block.euler_deg)
    if stem != "rr-axis":
        # Angles are asked for blocks that only half a turn maps to themselves, turns for blocks
        # that no turn does.
        own = [fits(deg) for _, deg in images(stem, block)]
        half = len(own) // 2
        if own[half] is not (stem == "rr-angle") or sum(own) != 1 + own[half]:
            return ()
    return dict.fromkeys(said for said, deg in images(stem, other) if fits(deg))


class RotationMaker(StaticMaker):
    """RR: the rotation of a loose block compared with one of its type in the structure."""

    subtask: Subtask = "RR"

    def ask(self, scene: Scene, view: View, rng: np.random.Generator) -> Iterator[Draft]:
        """Ask about blocks, with a loose one beside the structure that fits a random phrase."""
        studied = sight.seen_blocks(sight.goal_picture(scene, view), sight.STUDIED)
        for other, stem in itertools.product(base.shuffled(rng, studied)[:_COMPARED], _OFFERED):
            try:
                angles = dict.fromkeys(deg for _, deg in images(stem, other))
                turned = [replace(other, euler_deg=deg) for deg in angles]
                said = {one: set(phrases(stem, one, other)) & set(_OFFERED[stem]) for one in turned}
            except UnfairError:
                continue
            phrase = pick(rng, _OFFERED[stem])
            fitting = [one for one, words in said.items() if words == {phrase}]
            # If some phrase cannot be true, others would be right too often.
            if set().union(*said.values()) != set(_OFFERED[stem]) or not fitting:
                continue
            for _ in range(_BESIDE):
                loose = put_beside(pick(rng, fitting), scene.blocks, rng)
                if not surely_stands((loose,)):
                    continue
                # Each of the two gets its own color.
                orders, every = [loose.order, other.order], (*scene.blocks, loose)
                picture = sight.with_own_colors(every, orders, view, rng)
                two = [sight.block_of(picture.blocks, order) for order in orders]
                mine, its = (f"{one.color} {sight.shape_word(one.type)}" for one in two)
                kind = "axis" if stem == "rr-axis" else "vertical"
                slots = {"block": mine, "other": its}
                yield Draft(stem, scene, (picture,), slots, _OFFERED[stem], kind)

    def right(self, asked: Draft) -> str:
        """Compare the orientations in the picture, up to the symmetry of the type."""
        pair = sight.named(asked, sight.STUDIED)
        true = {phrase for phrase in phrases(asked.wording, *pair) if phrase in asked.texts}
        if len(true) != 1:
            raise UnfairError("are not of one type, or not turned as the wording asks")
        return true.pop()


def put_beside(block: Block, blocks: Sequence[Block], rng: np.random.Generator) -> Block:
    """Put the block, with an unused order, on the ground in a random direction from the others, as
    near to them as leaves 2 cm free. Its orientation stays.
    """
    middle = whole_bounds_m(blocks).mean(axis=0)
    angle = float(rng.uniform(0, 2 * math.pi))
    direction = np.array([math.cos(angle), math.sin(angle)])
    loose = replace(block, order=max(b.order for b in blocks) + 1, depend=(), layer=1)
    box = bounds_m(loose)
    for steps in itertools.count():
        place_m = middle[:2] + _ASIDE_M * steps * direction
        step = np.array([*(place_m - box.mean(axis=0)[:2]), -box[0, 2]])
        x, y, z = (round(float(part), 4) + 0.0 for part in np.array(loose.position_m) + step)
        placed = replace(loose, position_m=(x, y, z))
        if not any(boxes_near(bounds_m(placed), bounds_m(other), _FREE_M) for other in blocks):
            return placed
    raise AssertionError
