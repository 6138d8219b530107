"""Pictures of questions: view, colors, what shows of each block, and options that are pictures."""

from __future__ import annotations

import functools
import itertools
from abc import abstractmethod
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.blocks import COLORS, SHAPES, BlockType, euler_deg_to_matrix
from phyblock.domain.question import LETTERS, Question, QuestionPicture
from phyblock.domain.scene import Block, Scene
from phyblock.making.questions.draft import Draft, Maker, UnfairError, slots_of
from phyblock.sim.camera import view_axes
from phyblock.sim.contact import bounds_m
from phyblock.sim.engine import Pose
from phyblock.sim.pictures import (
    DrawnBlock,
    PictureStyle,
    drawn,
    goal_camera,
    shoot,
    visible_shares,
)
from phyblock.sim.question_pictures import is_inside, least_difference, seen, seen_order

View = tuple[float, float]
"""Azimuth and elevation of a camera [degrees]."""
ELEVATIONS_DEG = (18, 38)
"""The views of static questions look down by this much: tops show, and so do sides."""
COUNTED = 0.25
"""The least visible share of a block that is to be counted."""
NAMED = 0.4
"""The least visible share of a block that is named in a question or an option."""
STUDIED = 0.55
"""The least visible share of a block whose shape, size or orientation is asked about."""
SHAPED = 0.28
"""The least visible share of every block where shapes are counted,"""
SHAPED_AREA = 0.004
"""and the least share of the picture that it covers."""
_PROFILE_AXES: Mapping[BlockType, int] = {
    block_type: "xyz".index(shape.axis) for block_type, shape in SHAPES.items() if not shape.is_box
}
"""Body axes along which these types look like what they are, and from elsewhere like boxes."""
_MOST_OF_A_FACE = 0.8
"""The most that one face of a block by itself may be of all that shows of it."""
_LEAST_PROFILE = 0.26
"""The sine of 15 degrees: so far the face across that axis is turned to the viewer."""
_SIZE_PX = 256
_MIDDLE_GAP = 0.1
"""So much further out, of half the picture's width, is the middle of a block called leftmost,"""
_EDGE_GAP = 0.05
"""and so much its outer edge."""


class StaticMaker(Maker):
    """Drafts cost little, so every scene is asked, each time from views drawn for it."""

    views_a_scene: int = 1
    drafts_a_view: int = 12

    def __init_subclass__(cls) -> None:
        """Derive the most drafts of a scene from those of a view."""
        cls.drafts_a_scene = cls.views_a_scene * cls.drafts_a_view

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Fair questions about a scene, view by view."""
        for _ in range(self.views_a_scene):
            yield from islice(self.seen_from(drawn_view(rng), scene, rng), self.drafts_a_view)

    @abstractmethod
    def seen_from(self, view: View, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Fair questions about a scene that is seen from a view."""

    def rederive(self, question: Question) -> tuple[int, ...]:
        """The answer from the one picture and the slots of the text alone."""
        return self.answer(question, shown_picture(question), slots_of(question))

    @abstractmethod
    def answer(
        self, question: Question, picture: QuestionPicture, slots: Mapping[str, str]
    ) -> tuple[int, ...]:
        """The answer to a question about a picture; UnfairError as `rederive`."""


def recolored(scene: Scene, rng: np.random.Generator) -> Scene:
    """The scene with a color drawn for every block, so that color tells no shape."""
    drawn_colors = [COLORS[int(i)] for i in rng.integers(len(COLORS), size=len(scene))]
    return replace(
        scene,
        blocks=tuple(replace(b, color=c) for b, c in zip(scene.blocks, drawn_colors, strict=True)),
    )


def with_own_colors(scene: Scene, orders: Sequence[int], rng: np.random.Generator) -> Scene:
    """The scene with a color for each of up to four blocks that no other block has.

    The other blocks share the colors that are left. Raises ValueError for more than four blocks
    when there are others.
    """
    colors = [COLORS[int(i)] for i in rng.permutation(len(COLORS))]
    own = dict(zip(orders, colors, strict=False))
    left = colors[len(orders) :]
    if len(orders) > len(colors) or (not left and len(orders) < len(scene)):
        raise ValueError(f"there are {len(colors)} colors for {len(orders)} blocks and the rest")
    blocks = []
    for block in scene.blocks:
        color = own.get(block.order) or left[int(rng.integers(len(left)))]
        blocks.append(replace(block, color=color))
    return replace(scene, blocks=tuple(blocks))


def seen_blocks(picture: QuestionPicture, least: float) -> list[Block]:
    """The blocks that show at least this share of themselves in a picture."""
    seen = shares(picture)
    return [block for block in picture.blocks if seen[block.order] >= least]


def orders_of(blocks: Sequence[Block]) -> list[int]:
    """The orders of blocks."""
    return [block.order for block in blocks]


def drawn_view(rng: np.random.Generator) -> View:
    """A view drawn evenly: from all round, looking down by `ELEVATIONS_DEG`, in whole degrees."""
    low, high = ELEVATIONS_DEG
    return (float(rng.integers(360)), float(rng.integers(low, high + 1)))


def goal_picture(scene: Scene, view: View) -> QuestionPicture:
    """The whole scene from a view."""
    return QuestionPicture("scene", scene.blocks, view)


def shown_picture(question: Question) -> QuestionPicture:
    """The one picture of a static question; UnfairError for others, or one from too high or low."""
    labels = [picture.label for picture in question.pictures]
    if labels != ["scene"]:
        raise UnfairError(f"has pictures {labels}, not one of the scene alone")
    low, high = ELEVATIONS_DEG
    if not low <= question.pictures[0].view_deg[1] <= high:
        raise UnfairError(f"is not seen from {low} to {high} degrees above the floor")
    return question.pictures[0]


def shares(picture: QuestionPicture) -> Mapping[int, float]:
    """Visible share of each block, by order, of a picture framed on the blocks that it draws."""
    return _shares(tuple(map(_plain, picture.blocks)), picture.view_deg)


@functools.lru_cache(maxsize=512)
def _shares(blocks: tuple[Block, ...], view: View) -> Mapping[int, float]:
    return visible_shares(Scene("", (1,), blocks, ()), _style(view))


def are_seen(picture: QuestionPicture, orders: Collection[int], least: float) -> bool:
    """True if each of the named blocks shows at least this share of itself."""
    seen = shares(picture)
    return all(seen[order] >= least for order in orders)


def require_seen(picture: QuestionPicture, orders: Collection[int], least: float) -> None:
    """Raise UnfairError that names the blocks that show less than `least`."""
    seen = shares(picture)
    hidden = [order for order in sorted(orders) if seen[order] < least]
    if hidden:
        raise UnfairError(f"blocks {hidden} show less than {least:.0%} of themselves")


@functools.lru_cache(maxsize=4096)
def center_m(block: Block) -> NDArray[np.float64]:
    """Middle of the box round a block, shape (3,) [m], world frame."""
    middle: NDArray[np.float64] = bounds_m(block).mean(axis=0)
    return middle


def picture_axes(view: View) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """To the right of the picture and away from the viewer along the floor, unit (3,) vectors."""
    right, _, forward = view_axes(*view)
    away = np.array([forward[0], forward[1], 0.0])
    return right, away / np.linalg.norm(away)


def outermost(orders: Sequence[int], picture: QuestionPicture, to_left: bool) -> int | None:
    """The one of the named blocks that is farthest to a side of a picture; None when that is close.

    Both its middle and its outer edge have to be clearly farther out than those of the others.
    """
    spans = _spans(tuple(map(_plain, picture.blocks)), picture.view_deg)
    sign = -1.0 if to_left else 1.0
    reach = {
        order: (sign * sum(spans[order]) / 2, max(sign * end for end in spans[order]))
        for order in orders
    }
    ranked = sorted(orders, key=lambda order: -reach[order][0])
    first = reach[ranked[0]]
    for other in ranked[1:]:
        if first[0] - reach[other][0] < _MIDDLE_GAP or first[1] - reach[other][1] < _EDGE_GAP:
            return None
    return ranked[0]


@functools.lru_cache(maxsize=512)
def _spans(blocks: tuple[Block, ...], view: View) -> Mapping[int, tuple[float, float]]:
    """Left and right end of each block across the picture, -1 to 1, by order."""
    scene = Scene("", (1,), blocks, ())
    camera = goal_camera(scene, _style(view))
    spans = {}
    for block, one in zip(blocks, drawn(scene.blocks), strict=True):
        across = camera.project(one.vertices_m)[:, 0]
        spans[block.order] = (float(across.min()), float(across.max()))
    return spans


@functools.lru_cache(maxsize=512)
def _areas(blocks: tuple[Block, ...], view: View) -> Mapping[int, float]:
    """Share of the picture that each block covers, by order."""
    scene = Scene("", (1,), blocks, ())
    camera = goal_camera(scene, _style(view))
    seen = shoot(drawn(scene.blocks), camera, _SIZE_PX).block
    counts = np.bincount(seen[seen >= 0], minlength=len(blocks))
    return {
        block.order: float(count) / _SIZE_PX**2 for block, count in zip(blocks, counts, strict=True)
    }


def shows_profile(block: Block, view: View) -> bool:
    """True if a view shows the face that tells an arch, a prism or a half cylinder from a box."""
    axis = _PROFILE_AXES.get(block.type)
    if axis is None:
        return True
    along = euler_deg_to_matrix(block.euler_deg)[:, axis]
    return bool(abs(along @ view_axes(*view)[2]) >= _LEAST_PROFILE)


def shows_solid(block: Block, view: View) -> bool:
    """True if a view shows its profile, and no one face is nearly all that shows of the block."""
    along = view_axes(*view)[2]
    corners = DrawnBlock(block.type, block.color, block.position_m, block.euler_deg).triangles_m
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    shown = np.maximum(-normals @ along, 0.0)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    _, faces = np.unique(np.round(normals / lengths, 2), axis=0, return_inverse=True)
    largest = np.bincount(faces.ravel(), shown).max() / shown.sum()
    return shows_profile(block, view) and bool(largest <= _MOST_OF_A_FACE)


def require_shapes_seen(picture: QuestionPicture) -> None:
    """Raise UnfairError unless every block shows enough of itself to tell its shape."""
    require_seen(picture, [block.order for block in picture.blocks], SHAPED)
    if not all(shows_profile(block, picture.view_deg) for block in picture.blocks):
        raise UnfairError("some block is seen from a side that does not tell its shape")
    areas = _areas(tuple(map(_plain, picture.blocks)), picture.view_deg)
    small = [order for order, area in sorted(areas.items()) if area < SHAPED_AREA]
    if small:
        raise UnfairError(f"blocks {small} cover less than {SHAPED_AREA:.1%} of the picture")


def _style(view: View) -> PictureStyle:
    return PictureStyle(_SIZE_PX, "checkerboard", *view)


def _plain(block: Block) -> Block:
    """The block as far as it decides what is hidden."""
    return replace(block, color="red", depend=())


_LONGER = 1.3


def length_axis(block: Block) -> int:
    """The level axis of the world (0 or 1) that a block's longest side runs along.

    UnfairError where it stands on end, stands askew, or no side is clearly the longest.
    """
    sides = np.diff(bounds_m(block), axis=0)[0]
    first, second = sorted(range(3), key=lambda axis: -sides[axis])[:2]
    if first == 2 or sides[first] < _LONGER * sides[second] or block.euler_deg[2] % 90:
        raise UnfairError("has no length that lies along the ground")
    return first


Floats = NDArray[np.float64]
LEAST_PIXELS = 220
"""In so many pixels of 256 by 256 any two pictures that are compared differ, at the least."""
TAKEN = "X"
"""The letter of the block that is taken away or pushed."""
WRONG = 3
"""The number of wrong options."""
MOST_OFF = 1.0
"""The most ranks that the right option may be off, on average over the measures."""
_EQUAL = 0.02
_UNLIKE_STEPS = 5.0
_ALIKE_M = 0.002
_ALIKE_DEG = 2.0


def are_told_apart(pictures: Sequence[QuestionPicture], least: int = LEAST_PIXELS) -> bool:
    """True if nothing is cut off, and any two of the pictures differ in enough pixels."""
    if not all(is_inside(picture) for picture in pictures):
        return False
    return least_difference([seen(picture) for picture in pictures]) >= least


def same_blocks(one: Sequence[Block], other: Sequence[Block]) -> bool:
    """True if two sets of blocks look the same, whatever their numbers: up to 2 mm, 2 degrees."""
    left = list(other)
    for block in one:
        match = next((b for b in left if _are_alike(block, b)), None)
        if match is None:
            return False
        left.remove(match)
    return not left


def _are_alike(one: Block, other: Block) -> bool:
    if one.kind != other.kind:
        return False
    start, end = Pose.goal(one), Pose.goal(other)
    if end.distance_m(start) > _ALIKE_M:
        return False
    return one.look == other.look or end.angle_deg(start) <= _ALIKE_DEG


def of_kind(question: Question) -> str:
    """The kind that a maker gave a question; UnfairError when it has none."""
    kind = question.evidence.get("kind")
    if not isinstance(kind, str):
        raise UnfairError("its evidence names no kind")
    return kind


def picture_of(question: Question, label: str) -> QuestionPicture:
    """The picture with a label; UnfairError unless there is exactly one."""
    found = [picture for picture in question.pictures if picture.label == label]
    if len(found) != 1:
        raise UnfairError(f"has {len(found)} pictures labeled {label}")
    return found[0]


def option_pictures(question: Question) -> tuple[QuestionPicture, ...]:
    """The pictures of the four options, in order."""
    return tuple(picture_of(question, letter) for letter in LETTERS)


def marked_order(picture: QuestionPicture, letter: str) -> int:
    """Order of the block that shows at a mark; UnfairError when there is none."""
    for mark in picture.marks:
        if mark.letter == letter:
            order = seen_order(picture, seen(replace(picture, marks=())), mark.position_m)
            if order is not None:
                return order
    raise UnfairError(f"no block is marked {letter}")


class Four(NamedTuple):
    """Rows of a right option and three wrong ones, and the right one's ranks by the measures.

    `chosen` is empty where there are no four.
    """

    chosen: tuple[int, ...] = ()
    ranks: tuple[float, ...] = ()

    def halves(self, *measures: int) -> str:
        """`less` or `more` by each of some measures: the half that the right one is of."""
        return "-".join("less" if self.ranks[i] < WRONG / 2 else "more" for i in measures)


def four_alike(
    measures: Floats,
    apart: NDArray[np.bool_],
    rng: np.random.Generator,
    *,
    rights: int = 1,
    unlike: Floats | None = None,
) -> Four:
    """A right row and three wrong ones, all apart, among which it has about the ranks drawn.

    `measures` has shape (n, k), its first `rights` rows are of options that are right. `apart` and
    `unlike` have shape (n, n); where `unlike` is given, the sum over the other three is one more
    measure. No four where none come near. The ranks are those of any one among any four: each rank
    as likely, by all measures together.
    """
    if not 0 < rights <= len(measures) - WRONG:
        return Four()
    one, *others = rng.choice(len(measures), size=WRONG + 1, replace=False).tolist()
    wanted = ranks_among(measures, one, np.array([others]), unlike)[0]
    threes = np.array(list(itertools.combinations(range(rights, len(measures)), WRONG)))
    for i, j in itertools.combinations(range(WRONG), 2):
        threes = threes[apart[threes[:, i], threes[:, j]]]
    best, nearest = Four(), MOST_OFF
    for right in range(rights):
        fitting = threes[apart[right][threes].all(axis=1)]
        if not len(fitting):
            continue
        ranks = ranks_among(measures, right, fitting, unlike)
        off = np.abs(ranks - wanted).mean(axis=1)
        place = int(off.argmin())
        if off[place] < nearest:
            nearest = float(off[place])
            best = Four((right, *fitting[place].tolist()), tuple(ranks[place].tolist()))
    return best


def ranks_among(
    measures: Floats, right: int, threes: NDArray[np.int64], unlike: Floats | None = None
) -> Floats:
    """Numbers of each three that are below the right one, by measure; equal ones count half."""
    steps = measures[threes] - measures[right]
    if unlike is not None:
        four = np.column_stack([np.full(len(threes), right), threes])
        sums = unlike[four[:, :, None], four[:, None, :]].sum(axis=2)
        scale = max(float(unlike.max()), 1.0) / _UNLIKE_STEPS
        odd = (sums[:, 1:] - sums[:, :1]) / scale
        steps = np.concatenate([steps, odd[:, :, None]], axis=2)
    equal = (np.abs(steps) <= _EQUAL).sum(axis=1)
    below: Floats = (steps < -_EQUAL).sum(axis=1) + equal / 2
    return below
