"""The base of all question kinds: drafts and makers, wordings, views, and options compared."""

from __future__ import annotations

import functools
import itertools
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
import yaml
from numpy.typing import NDArray

from phyblock.domain.blocks import COLORS, SHAPES, euler_deg_to_matrix
from phyblock.domain.question import LETTERS, Mark, Question, QuestionPicture, Subtask
from phyblock.domain.scene import Block, Scene
from phyblock.errors import PhyblockError
from phyblock.sim.camera import view_axes
from phyblock.sim.contact import bounds_m
from phyblock.sim.engine import Pose
from phyblock.sim.geometry import drawn_mesh
from phyblock.sim.pictures import (
    PictureStyle,
    drawn_m,
    goal_camera,
    shoot,
    visible_shares,
)
from phyblock.sim.question_pictures import is_inside, least_difference, seen, seen_order

T = TypeVar("T")
Floats = NDArray[np.float64]
Slots = Mapping[str, str]
"""Values of the words in braces of a template."""
View = tuple[float, float]
"""Azimuth and elevation of a camera [degrees]."""
Option = str | QuestionPicture | Mark
"""A text; a picture, labeled later; or a place, which is marked in the first picture."""

_TEXTS: dict[str, Any] = yaml.safe_load(
    Path(__file__).with_name("wordings.yaml").read_text(encoding="utf-8")
)
WORDS: Mapping[str, Any] = _TEXTS.pop("words")
"""Words that options and slots are made of."""
WORDINGS: dict[str, str] = {}
"""All templates by id: subtask, kind where there are several, and number (`rp-corner-2`)."""


def add_wordings(stem: str, texts: Sequence[str]) -> None:
    """Add templates under the ids `stem-1`, `stem-2` and so on."""
    WORDINGS.update({f"{stem}-{number}": text for number, text in enumerate(texts, 1)})


for _stem in _TEXTS:
    add_wordings(_stem, _TEXTS[_stem])


class UnfairError(PhyblockError):
    """A question has no answer, more than one, or names what cannot be told from the picture."""


@dataclass(frozen=True)
class Draft:
    """A fair question whose options have no letters yet.

    `scene` is the scene as shown; `options` has the right one first, or for ordering all four in
    the right order. Selection takes an even share of each `kind`, and of each `value` (a sort of
    answer) where the options are no texts. `evidence` is what JSON can hold; its `slots` fill the
    template `wording` to give `text`. `looks` are measures of options that are no texts, by which
    a reader might guess: drafts are dropped until these tell nothing.
    """

    scene: Scene
    text: str
    options: tuple[Option, ...]
    pictures: tuple[QuestionPicture, ...]
    wording: str
    kind: str
    evidence: Mapping[str, Any]
    value: str = ""
    looks: tuple[tuple[float, ...], ...] = field(default=())


def draft(
    scene: Scene,
    rng: np.random.Generator,
    stem: str,
    options: Sequence[Option],
    pictures: Sequence[QuestionPicture],
    slots: Slots,
    *,
    kind: str | None = None,
    value: str = "",
    **facts: Any,
) -> Draft:
    """Return a draft in a wording drawn from those of a stem, the right option first.

    Without a `kind` the stem is its kind, which the evidence then names. `facts` are evidence.
    """
    wording = pick(rng, [name for name in WORDINGS if stem_of(name) == stem])
    named = {"kind": stem} if kind is None else {}
    return Draft(
        scene,
        fill_template(WORDINGS[wording], slots),
        tuple(options),
        tuple(pictures),
        wording,
        stem if kind is None else kind,
        {**named, "slots": dict(slots), **facts},
        value,
    )


class Maker(ABC):
    """Makes the questions of one subtask and can derive an answer again."""

    subtask: Subtask
    scenes_tried: int = 400
    """The number of scenes, drawn evenly over the levels, that are asked for drafts."""
    drafts_a_scene: int = 1
    """The most drafts that are taken of one scene."""

    @abstractmethod
    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Fair questions about a scene, in an order drawn with `rng`; none when it allows none."""

    @abstractmethod
    def rederive(self, question: Question) -> tuple[int, ...]:
        """The right answer, found anew from scene, pictures and simulator; never from `answer`.

        Raises UnfairError when there is not exactly one, or something named cannot be seen.
        """


class StaticMaker(Maker):
    """Makes questions about one picture; every scene is asked, from views drawn for it."""

    views_a_scene: int = 1
    drafts_a_view: int = 12

    def __init_subclass__(cls) -> None:
        """Derive the most drafts of a scene from those of a view."""
        cls.drafts_a_scene = cls.views_a_scene * cls.drafts_a_view

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Fair questions about a scene, view by view."""
        for _ in range(self.views_a_scene):
            found = self.seen_from(drawn_view(rng), scene, rng)
            yield from itertools.islice(found, self.drafts_a_view)

    @abstractmethod
    def seen_from(self, view: View, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Fair questions about a scene that is seen from a view."""

    def rederive(self, question: Question) -> tuple[int, ...]:
        """The answer from the one picture and the slots of the text alone."""
        labels = [picture.label for picture in question.pictures]
        if labels != ["scene"]:
            raise UnfairError(f"has pictures {labels}, not one of the scene alone")
        low, high = ELEVATIONS_DEG
        if not low <= question.pictures[0].view_deg[1] <= high:
            raise UnfairError(f"is not seen from {low} to {high} degrees above the floor")
        return self.answer(question, question.pictures[0], slots_of(question))

    @abstractmethod
    def answer(self, question: Question, picture: QuestionPicture, slots: Slots) -> tuple[int, ...]:
        """The answer to a question about a picture; UnfairError as `rederive`."""


# Texts, options and draws


def stem_of(wording: str) -> str:
    """The part that all wordings of a kind share: `rp-corner` of `rp-corner-2`."""
    return wording.rsplit("-", 1)[0]


def fill_template(template: str, slots: Slots) -> str:
    """The template with its slots filled, capitalized."""
    text = template.format(**slots)
    return text[:1].upper() + text[1:]


def slots_of(question: Question) -> Slots:
    """The slots of a question's text; UnfairError unless they fill its wording to that text."""
    slots = question.evidence.get("slots", {})
    try:
        is_filled = fill_template(WORDINGS[question.wording], slots) == question.text
    except KeyError:
        is_filled = False
    if not is_filled:
        raise UnfairError("the text is not its wording with the slots of the evidence")
    return {name: str(slot) for name, slot in slots.items()}


def index_of(question: Question, right: str) -> tuple[int, ...]:
    """The place of the right option; UnfairError unless exactly one option says so."""
    return only_index([option == right for option in question.options])


def only_index(right: Sequence[bool]) -> tuple[int]:
    """Index of the one option that is right; UnfairError when there is not exactly one."""
    found = [index for index, is_right in enumerate(right) if is_right]
    if len(found) != 1:
        raise UnfairError(f"{len(found)} of {len(right)} options are right")
    return (found[0],)


def right_first(right: T, options: Sequence[T]) -> list[T]:
    """The options with the right one at the front."""
    return [right, *(option for option in options if option != right)]


def window(rng: np.random.Generator, values: Sequence[int], right: int) -> list[str]:
    """Four neighbors among the allowed values, the right one first; none where none are drawn."""
    if right not in values:
        return []
    start = values.index(right) - int(rng.integers(4))
    if start < 0 or start + 4 > len(values):
        return []
    return [str(value) for value in right_first(right, values[start : start + 4])]


def pick(rng: np.random.Generator, options: Sequence[T]) -> T:
    """One of the options."""
    return options[int(rng.integers(len(options)))]


def shuffled(rng: np.random.Generator, items: Sequence[T]) -> list[T]:
    """The items in an order drawn with `rng`."""
    return [items[int(i)] for i in rng.permutation(len(items))]


# Scenes, colors and views

ELEVATIONS_DEG = (18, 38)
"""The views of static questions look down by this much: tops show, and so do sides."""
COUNTED = 0.25
"""The least visible share of a block that is to be counted."""
NAMED = 0.4
"""The least visible share of a block that is named in a question or an option."""
STUDIED = 0.55
"""The least visible share of a block whose shape, size or orientation is asked about."""
_SHAPED, _SHAPED_AREA = 0.28, 0.004
"""The least visible share of every block, and share of the picture, where shapes are counted."""
_MOST_OF_A_FACE = 0.8
"""The most that one face of a block by itself may be of all that shows of it."""
_LEAST_PROFILE = 0.26
"""The sine of 15 degrees: so far the face that shows a block's profile is turned to the viewer."""
_SIZE_PX = 256
_MIDDLE_GAP, _EDGE_GAP = 0.1, 0.05
"""So much further out, of half the picture's width, are middle and edge of an outermost block."""
_LONGER = 1.3


def orders_of(blocks: Sequence[Block]) -> list[int]:
    """The orders of blocks."""
    return [block.order for block in blocks]


def recolored(scene: Scene, rng: np.random.Generator) -> Scene:
    """The scene with a color drawn for every block, so that color tells no shape."""
    drawn = zip(scene.blocks, rng.integers(len(COLORS), size=len(scene)), strict=True)
    return replace(scene, blocks=tuple(replace(block, color=COLORS[i]) for block, i in drawn))


def with_own_colors(scene: Scene, orders: Sequence[int], rng: np.random.Generator) -> Scene:
    """The scene with a color of its own for each of up to four blocks; others share the rest."""
    colors = shuffled(rng, COLORS)
    own, left = dict(zip(orders, colors, strict=False)), colors[len(orders) :]
    blocks = (
        replace(block, color=own.get(block.order) or left[int(rng.integers(len(left)))])
        for block in scene.blocks
    )
    return replace(scene, blocks=tuple(blocks))


def drawn_view(rng: np.random.Generator) -> View:
    """A view drawn evenly: from all round, looking down by `ELEVATIONS_DEG`, in whole degrees."""
    low, high = ELEVATIONS_DEG
    return (float(rng.integers(360)), float(rng.integers(low, high + 1)))


def goal_picture(scene: Scene, view: View) -> QuestionPicture:
    """The whole scene from a view."""
    return QuestionPicture("scene", scene.blocks, view)


@functools.lru_cache(maxsize=4096)
def center_m(block: Block) -> Floats:
    """Middle of the box round a block, shape (3,) [m], world frame."""
    middle: Floats = bounds_m(block).mean(axis=0)
    return middle


def length_axis(block: Block) -> int:
    """The level axis of the world (0 or 1) that a block's longest side runs along.

    UnfairError where it stands on end, stands askew, or no side is clearly the longest.
    """
    sides = np.diff(bounds_m(block), axis=0)[0]
    first, second = sorted(range(3), key=lambda axis: -sides[axis])[:2]
    if first == 2 or sides[first] < _LONGER * sides[second] or block.euler_deg[2] % 90:
        raise UnfairError("has no length that lies along the ground")
    return first


def picture_axes(view: View) -> tuple[Floats, Floats]:
    """To the right of the picture and away from the viewer along the floor, unit (3,) vectors."""
    right, _, forward = view_axes(*view)
    away = np.array([forward[0], forward[1], 0.0])
    return right, away / np.linalg.norm(away)


# Visibility: by shares of blocks in a picture framed on all that it draws


def shares(picture: QuestionPicture) -> Mapping[int, float]:
    """Visible share of each block, by order."""
    return _shares(*_plain(picture))


def _plain(picture: QuestionPicture) -> tuple[tuple[Block, ...], View]:
    """Blocks, as far as they decide what is hidden, and view."""
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
    """Share of the picture, and left and right end across it (-1 to 1), of blocks by order."""
    style = PictureStyle(_SIZE_PX, "checkerboard", *view)
    camera = goal_camera(Scene("", (1,), blocks, ()), style)
    pixels = shoot(blocks, camera, _SIZE_PX).block
    counts = np.bincount(pixels[pixels >= 0], minlength=len(blocks)) / _SIZE_PX**2
    across = [camera.project(drawn_m(one))[:, 0] for one in blocks]
    ends = [(float(one.min()), float(one.max())) for one in across]
    orders = orders_of(blocks)
    return dict(zip(orders, counts.tolist(), strict=True)), dict(zip(orders, ends, strict=True))


def seen_blocks(picture: QuestionPicture, least: float) -> list[Block]:
    """The blocks that show at least this share of themselves in a picture."""
    seen = shares(picture)
    return [block for block in picture.blocks if seen[block.order] >= least]


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


def require_shapes_seen(picture: QuestionPicture) -> None:
    """Raise UnfairError unless every block shows enough of itself to tell its shape."""
    require_seen(picture, orders_of(picture.blocks), _SHAPED)
    if not all(shows_profile(block, picture.view_deg) for block in picture.blocks):
        raise UnfairError("some block is seen from a side that does not tell its shape")
    areas = _extents(*_plain(picture))[0]
    small = [order for order, area in sorted(areas.items()) if area < _SHAPED_AREA]
    if small:
        raise UnfairError(f"blocks {small} cover less than {_SHAPED_AREA:.1%} of the picture")


def outermost(orders: Sequence[int], picture: QuestionPicture, to_left: bool) -> int | None:
    """The one of the named blocks that is farthest to a side of a picture; None when that is close.

    Both its middle and its outer edge have to be clearly farther out than those of the others.
    """
    spans, sign = _extents(*_plain(picture))[1], -1.0 if to_left else 1.0
    reach = {o: (sign * sum(spans[o]) / 2, max(sign * end for end in spans[o])) for o in orders}
    first, *others = sorted(orders, key=lambda order: -reach[order][0])
    middle, edge = reach[first]
    is_clear = all(
        middle - reach[o][0] >= _MIDDLE_GAP and edge - reach[o][1] >= _EDGE_GAP for o in others
    )
    return first if is_clear else None


def shows_profile(block: Block, view: View) -> bool:
    """True if a view shows the face that tells an arch, a prism or a half cylinder from a box."""
    shape = SHAPES[block.type]
    if shape.is_box:
        return True
    along = euler_deg_to_matrix(block.euler_deg)[:, "xyz".index(shape.axis)]
    return bool(abs(along @ view_axes(*view)[2]) >= _LEAST_PROFILE)


def shows_solid(block: Block, view: View) -> bool:
    """True if a view shows its profile, and no one face is nearly all that shows of the block."""
    along = view_axes(*view)[2]
    corners = drawn_m(block)[drawn_mesh(block.type).triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    shown = np.maximum(-normals @ along, 0.0)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    _, faces = np.unique(np.round(normals / lengths, 2), axis=0, return_inverse=True)
    largest = np.bincount(faces.ravel(), shown).max() / shown.sum()
    return shows_profile(block, view) and bool(largest <= _MOST_OF_A_FACE)


# Options that are pictures

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
_ALIKE_M, _ALIKE_DEG = 0.002, 2.0


def are_told_apart(pictures: Sequence[QuestionPicture], least: int = LEAST_PIXELS) -> bool:
    """True if nothing is cut off, and any two of the pictures differ in enough pixels."""
    if not all(map(is_inside, pictures)):
        return False
    return least_difference([seen(picture) for picture in pictures]) >= least


def same_blocks(one: Sequence[Block], other: Sequence[Block]) -> bool:
    """True if two sets of blocks look the same, whatever their numbers: up to 2 mm, 2 degrees."""

    def alike(a: Block, b: Block) -> bool:
        if a.kind != b.kind:
            return False
        start, end = Pose.goal(a), Pose.goal(b)
        is_turned = a.look != b.look and end.angle_deg(start) > _ALIKE_DEG
        return end.distance_m(start) <= _ALIKE_M and not is_turned

    left = list(other)
    for block in one:
        match = next((b for b in left if alike(block, b)), None)
        if match is None:
            return False
        left.remove(match)
    return not left


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


class Four(NamedTuple):
    """Rows of a right option and three wrong ones, if any, and the right one's rank by measure."""

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
    measure. The ranks wanted are those of any one among any four. Empty where none come near.
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
