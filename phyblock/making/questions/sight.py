"""The evidence of a picture on its blocks: how much of each shows, from which side, and where."""

from __future__ import annotations

import functools
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from phyblock.domain.blocks import COLORS, SHAPES, euler_deg_to_matrix
from phyblock.domain.question import LETTERS, Question, QuestionPicture
from phyblock.domain.scene import Block, Scene
from phyblock.making.questions.base import Floats, Slots, UnfairError, View, shuffled
from phyblock.sim.camera import view_axes
from phyblock.sim.contact import bounds_m
from phyblock.sim.engine import Pose
from phyblock.sim.pictures import PictureStyle, drawn_m, goal_camera, shoot, visible_shares
from phyblock.sim.question_pictures import is_inside, least_difference, seen, seen_order

COUNTED = 0.25
"""The least visible share of a block that is to be counted."""
NAMED = 0.4
"""The least visible share of a block that is named in a question or an option."""
STUDIED = 0.55
"""The least visible share of a block whose shape, size or orientation is asked about."""
LEAST_PIXELS = 220
"""In so many pixels of 256 by 256 any two pictures that are compared differ, at the least."""
_SHAPED, _SHAPED_AREA = 0.28, 0.004
"""The least visible share of every block, and share of the picture, where shapes are counted."""
_LEAST_PROFILE = 0.26
"""The sine of 15 degrees: so far the face that shows a block's profile is turned to the viewer."""
_SIZE_PX = 256
_MIDDLE_GAP, _EDGE_GAP = 0.1, 0.05
"""So much further out, of half the picture's width, are middle and edge of an outermost block."""
_SAME_M, _SAME_DEG = 0.002, 2.0


def orders_of(blocks: Sequence[Block]) -> list[int]:
    """Return the orders of blocks."""
    return [block.order for block in blocks]


def recolored(scene: Scene, rng: np.random.Generator) -> Scene:
    """Return the scene with a color drawn for every block, so that color tells no shape."""
    drawn = zip(scene.blocks, rng.integers(len(COLORS), size=len(scene)), strict=True)
    return replace(scene, blocks=tuple(replace(block, color=COLORS[i]) for block, i in drawn))


def with_own_colors(scene: Scene, orders: Sequence[int], rng: np.random.Generator) -> Scene:
    """Return the scene with a color of its own for each of up to four blocks."""
    colors = shuffled(rng, COLORS)
    own, left = dict(zip(orders, colors, strict=False)), colors[len(orders) :]
    blocks = (
        replace(block, color=own.get(block.order) or left[int(rng.integers(len(left)))])
        for block in scene.blocks
    )
    return replace(scene, blocks=tuple(blocks))


def goal_picture(scene: Scene, view: View) -> QuestionPicture:
    """Return the picture of the whole scene from a view."""
    return QuestionPicture("scene", scene.blocks, view)


@functools.lru_cache(maxsize=4096)
def center_m(block: Block) -> Floats:
    """Return the middle of the box round a block, shape (3,) [m], world frame."""
    middle: Floats = bounds_m(block).mean(axis=0)
    return middle


def height_m(block: Block) -> float:
    """Return the way from a block's lowest to its highest point [m]."""
    low, high = bounds_m(block)[:, 2]
    return float(high - low)


# Shares of blocks in a picture framed on all that it draws


def shares(picture: QuestionPicture) -> Mapping[int, float]:
    """Return the visible share of each block, by order."""
    return _shares(*_plain(picture))


def _plain(picture: QuestionPicture) -> tuple[tuple[Block, ...], View]:
    """Return blocks, as far as they decide what is hidden, and view."""
    blocks = tuple(replace(block, color="red", depend=()) for block in picture.blocks)
    return blocks, picture.view_deg


@functools.lru_cache(maxsize=512)
def _shares(blocks: tuple[Block, ...], view: View) -> Mapping[int, float]:
    style = PictureStyle(_SIZE_PX, "checkerboard", *view)
    return visible_shares(Scene("", (1,), blocks, ()), style)


@functools.lru_cache(maxsize=512)
def _extents(
    blocks: tuple[Block, ...], view: View
) -> tuple[Mapping[int, float], Mapping[int, tuple[float, float]]]:
    """Return the share of the picture, and both ends across it (-1 to 1), of blocks by order."""
    style = PictureStyle(_SIZE_PX, "checkerboard", *view)
    camera = goal_camera(Scene("", (1,), blocks, ()), style)
    pixels = shoot(blocks, camera, _SIZE_PX).block
    counts = np.bincount(pixels[pixels >= 0], minlength=len(blocks)) / _SIZE_PX**2
    across = [camera.project(drawn_m(one))[:, 0] for one in blocks]
    ends = [(float(one.min()), float(one.max())) for one in across]
    orders = orders_of(blocks)
    return dict(zip(orders, counts.tolist(), strict=True)), dict(zip(orders, ends, strict=True))


def seen_blocks(picture: QuestionPicture, least: float) -> list[Block]:
    """Return the blocks that show at least this share of themselves in a picture."""
    seen_share = shares(picture)
    return [block for block in picture.blocks if seen_share[block.order] >= least]


def are_seen(picture: QuestionPicture, orders: Collection[int], least: float) -> bool:
    """True if each of the named blocks shows at least this share of itself."""
    seen_share = shares(picture)
    return all(seen_share[order] >= least for order in orders)


def require_seen(
    picture: QuestionPicture, least: float, blocks: Sequence[Block] | None = None
) -> None:
    """Raise UnfairError that names those of the blocks, or of all, that show less than `least`."""
    seen_share = shares(picture)
    orders = orders_of(picture.blocks if blocks is None else blocks)
    hidden = [order for order in sorted(orders) if seen_share[order] < least]
    if hidden:
        raise UnfairError(f"blocks {hidden} show less than {least:.0%} of themselves")


def require_shapes_seen(picture: QuestionPicture) -> None:
    """Raise UnfairError unless every block shows enough of itself to tell its shape."""
    require_seen(picture, _SHAPED)
    if not all(shows_profile(block, picture.view_deg) for block in picture.blocks):
        raise UnfairError("some block is seen from a side that does not tell its shape")
    areas = _extents(*_plain(picture))[0]
    small = [order for order, area in sorted(areas.items()) if area < _SHAPED_AREA]
    if small:
        raise UnfairError(f"blocks {small} cover less than {_SHAPED_AREA:.1%} of the picture")


def outermost(blocks: Sequence[Block], picture: QuestionPicture, to_left: bool) -> Block | None:
    """Return the block that is farthest to a side of a picture, or None when that is close.

    Both its middle and its outer edge have to be clearly farther out than those of the others.
    """
    spans, sign = _extents(*_plain(picture))[1], -1.0 if to_left else 1.0
    ends = {b.order: [sign * end for end in spans[b.order]] for b in blocks}
    first, *others = sorted(blocks, key=lambda block: -sum(ends[block.order]))
    middle, edge = sum(ends[first.order]) / 2, max(ends[first.order])
    is_clear = all(
        middle - sum(ends[b.order]) / 2 >= _MIDDLE_GAP and edge - max(ends[b.order]) >= _EDGE_GAP
        for b in others
    )
    return first if is_clear else None


def shows_profile(block: Block, view: View) -> bool:
    """True if a view shows the face that tells an arch, a prism or a half cylinder from a box."""
    shape = SHAPES[block.type]
    if shape.is_box:
        return True
    along = euler_deg_to_matrix(block.euler_deg)[:, "xyz".index(shape.axis)]
    return bool(abs(along @ view_axes(*view)[2]) >= _LEAST_PROFILE)


# The pictures of a question


def are_told_apart(pictures: Sequence[QuestionPicture], least: int = LEAST_PIXELS) -> bool:
    """True if nothing is cut off, and any two of the pictures differ in enough pixels."""
    return all(map(is_inside, pictures)) and least_difference([*map(seen, pictures)]) >= least


def same_blocks(one: Sequence[Block], other: Sequence[Block]) -> bool:
    """True if two sets of blocks look the same, whatever their numbers: up to 2 mm, 2 degrees."""

    def alike(a: Block, b: Block) -> bool:
        start, end = Pose.goal(a), Pose.goal(b)
        is_turned = a.look != b.look and end.angle_deg(start) > _SAME_DEG
        return a.kind == b.kind and end.distance_m(start) <= _SAME_M and not is_turned

    left = list(other)
    for block in one:
        match = next((b for b in left if alike(block, b)), None)
        if match is None:
            return False
        left.remove(match)
    return not left


def picture_of(question: Question, label: str) -> QuestionPicture:
    """Return the picture with a label; UnfairError unless there is exactly one."""
    found = [picture for picture in question.pictures if picture.label == label]
    if len(found) != 1:
        raise UnfairError(f"has {len(found)} pictures labeled {label}")
    return found[0]


def option_pictures(question: Question) -> list[QuestionPicture]:
    """Return the pictures of the four options, in order."""
    return [picture_of(question, letter) for letter in LETTERS]


def marked_order(picture: QuestionPicture, letter: str) -> int:
    """Return the order of the block that shows at a mark; UnfairError when there is none."""
    shot = seen(replace(picture, marks=()))
    for mark in picture.marks:
        order = seen_order(picture, shot, mark.position_m)
        if mark.letter == letter and order is not None:
            return order
    raise UnfairError(f"no block is marked {letter}")


def highlighted(
    picture: QuestionPicture, blocks: Sequence[Block], slots: Slots, taken: int | None = None
) -> frozenset[int]:
    """Return orders of the blocks of the slots' `color`; all others are of their `other` color.

    The block that is `taken` is of a color of its own. UnfairError when a picture shows another
    structure or other colors.
    """
    color_of = {block.order: block.color for block in picture.blocks}
    if taken is not None and color_of.pop(taken, "") != slots["taken"]:
        raise UnfairError(f"picture {picture.label} does not show what is taken away")
    if not {slots["color"], slots["other"]}.issuperset(color_of.values()):
        raise UnfairError(f"picture {picture.label} shows other colors than the text names")
    mine, given = ({b.order: replace(b, color="red") for b in s} for s in (picture.blocks, blocks))
    if mine != given:
        raise UnfairError(f"picture {picture.label} does not show the whole structure")
    return frozenset(order for order, color in color_of.items() if color == slots["color"])
