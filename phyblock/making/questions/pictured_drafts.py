"""What makers of questions with several pictures share: recipes, likeness, differences."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.question import LETTERS, Question, QuestionPicture
from phyblock.domain.scene import Block, Scene
from phyblock.making.questions.question_draft import Draft, Option, UnfairError
from phyblock.making.questions.selection import pick
from phyblock.making.questions.wording import fill, wording_ids
from phyblock.sim.contact import whole_bounds_m
from phyblock.sim.engine import Pose
from phyblock.sim.outcomes import MOVED_DEG, MOVED_M, STILL_DEG, STILL_M
from phyblock.sim.pictures import Shot
from phyblock.sim.question_pictures import (
    changed_pixels,
    differing_pixels,
    is_inside,
    least_difference,
    seen,
)

LEAST_PIXELS = 220
"""In so many pixels of 256 by 256 any two pictures that are compared differ, at the least."""
_ALIKE_M = 0.002
_ALIKE_DEG = 2.0
_LEVEL_M, _DOWN_M = 0.004, 0.008
_ROOM_M = 0.06


def state(
    scene: Scene, blocks: Sequence[Block], view_deg: tuple[float, float], label: str = "scene"
) -> QuestionPicture:
    """Blocks of a scene, whose whole frames the picture, so that all its states share a camera."""
    return QuestionPicture(label, tuple(blocks), view_deg, framed=scene.blocks)


def with_room(blocks: Sequence[Block], above_m: float = 0.0) -> tuple[Block, ...]:
    """What to frame a picture on for floor all round the blocks, and some air above them [m]."""
    low, high = whole_bounds_m(blocks)
    first = max(block.order for block in blocks) + 1
    height_m = round(float(high[2]) + above_m, 4) if above_m else 0.0125
    corners = [
        Block(first + i, "cuboid1", "red", (x, y, height_m), (0.0, 0.0, 0.0), (), 1)
        for i, (x, y) in enumerate(
            (round(float(x), 4), round(float(y), 4))
            for x in (low[0] - _ROOM_M, high[0] + _ROOM_M)
            for y in (low[1] - _ROOM_M, high[1] + _ROOM_M)
        )
    ]
    return (*blocks, *corners)


def are_told_apart(pictures: Sequence[QuestionPicture], least: int = LEAST_PIXELS) -> bool:
    """Whether nothing is cut off, and any two of the pictures differ in enough pixels."""
    if not all(is_inside(picture) for picture in pictures):
        return False
    return least_difference([seen(picture) for picture in pictures]) >= least


def are_alike(one: Block, other: Block) -> bool:
    """Whether two blocks look the same at the same place: within 2 mm and 2 degrees."""
    if one.kind != other.kind:
        return False
    start, end = Pose.goal(one), Pose.goal(other)
    if end.distance_m(start) > _ALIKE_M:
        return False
    return one.look == other.look or end.angle_deg(start) <= _ALIKE_DEG


def same_blocks(one: Sequence[Block], other: Sequence[Block]) -> bool:
    """Whether two sets of blocks look the same, whatever their numbers."""
    left = list(other)
    for block in one:
        match = next((b for b in left if are_alike(block, b)), None)
        if match is None:
            return False
        left.remove(match)
    return not left


def moved_between(
    scene: Scene, picture: QuestionPicture
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Orders of the scene's blocks that a picture lacks, and of those that it shows elsewhere.

    UnfairError when it shows others, or a block neither at its place nor clearly elsewhere.
    """
    goal = {block.order: block for block in scene.blocks}
    moved = []
    for block in picture.blocks:
        before = goal.get(block.order)
        if before is None or before.kind != block.kind:
            raise UnfairError(f"picture {picture.label} shows a block that the scene has not")
        start, end = Pose.goal(before), Pose.goal(block)
        distance_m, angle_deg = end.distance_m(start), end.angle_deg(start)
        if distance_m > MOVED_M or angle_deg > MOVED_DEG:
            moved.append(block.order)
        elif distance_m > STILL_M or angle_deg > STILL_DEG:
            raise UnfairError(f"picture {picture.label} shows block {block.order} hardly moved")
    gone = set(goal) - {block.order for block in picture.blocks}
    return tuple(sorted(gone)), tuple(sorted(moved))


def story_of(
    blocks: Sequence[Block], picture: QuestionPicture
) -> tuple[tuple[int, ...], tuple[int, ...], frozenset[int]]:
    """Who is gone, who moved, and who came down: words that two pictures can be compared by.

    UnfairError as `moved_between`, and where it is hard to tell whether a block came down.
    """
    gone, moved = moved_between(Scene("", (1,), tuple(blocks), ()), picture)
    before = {block.order: block.position_m[2] for block in blocks}
    after = {block.order: block.position_m[2] for block in picture.blocks}
    down_m = {order: before[order] - after[order] for order in moved}
    if any(_LEVEL_M < abs(height) < _DOWN_M for height in down_m.values()):
        raise UnfairError(f"picture {picture.label} shows a block hardly lower than before")
    return gone, moved, frozenset(order for order, height in down_m.items() if height >= _DOWN_M)


def draft(
    scene: Scene,
    rng: np.random.Generator,
    stem: str,
    options: Sequence[Option],
    pictures: Sequence[QuestionPicture],
    value: str,
    slots: dict[str, str] | None = None,
    facts: Mapping[str, object] | None = None,
) -> Draft:
    """A draft in a wording drawn from those of a stem; the stem is its kind."""
    wording = pick(rng, wording_ids(stem))
    held = slots or {}
    return Draft(
        scene=scene,
        text=fill(wording, **held),
        options=tuple(options),
        pictures=tuple(pictures),
        wording=wording,
        value=value,
        kind=stem,
        evidence={"kind": stem, "slots": held, **(facts or {})},
    )


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


def only_index(right: Sequence[bool]) -> tuple[int]:
    """Index of the one option that is right; UnfairError when there is not exactly one."""
    found = [index for index, is_right in enumerate(right) if is_right]
    if len(found) != 1:
        raise UnfairError(f"{len(found)} of {len(right)} options are right")
    return (found[0],)


_WRONG = 3
_MOST_POOL = 11
_MOST_OFF = 1.0
"""How many ranks the right option may be off, on average over the measures."""
_EQUAL = 0.02
AREA = 0
"""Place of the measure how much is colored."""
_HELD_OFF = 0.5


def alike_wrong(
    first: QuestionPicture,
    right: QuestionPicture,
    pool: Sequence[QuestionPicture],
    rng: np.random.Generator,
    held: Mapping[int, int] = MappingProxyType({}),
) -> list[QuestionPicture]:
    """Three of the pool, told apart from one another and the rest, or none.

    `held` gives ranks that hold exactly, by measure: `AREA`.
    """
    whole = [one for one in (right, *pool) if is_inside(one)][: 1 + _MOST_POOL]
    if not whole or whole[0] is not right:
        return []
    start, shots = seen(first), [seen(one) for one in whole]
    together = [start, *shots]
    apart = np.zeros((len(together), len(together)), dtype=np.bool_)
    for (i, one), (j, other) in itertools.combinations(enumerate(together), 2):
        # A picture like the first one is none that could be chosen.
        is_worth_it = i == 0 or (apart[0, i] and apart[0, j])
        apart[i, j] = apart[j, i] = is_worth_it and differing_pixels(one, other) >= LEAST_PIXELS
        if (i, j) == (0, 1) and not apart[i, j]:
            return []
    measures = np.array([looks(start, shot) for shot in shots])
    chosen = ranked_as_drawn(measures, apart[1:, 1:], rng, held)
    return [whole[i] for i in chosen]


def ranked_as_drawn(
    measures: NDArray[np.float64],
    apart: NDArray[np.bool_],
    rng: np.random.Generator,
    held: Mapping[int, int] = MappingProxyType({}),
) -> tuple[int, ...]:
    """Three rows after the first, all apart, among which the first has about the ranks drawn.

    `measures` has shape (n, k), `apart` (n, n). `held` gives ranks that hold exactly for some of
    the k measures. Empty where no three come near enough.
    """
    wanted = np.array(rng.integers(_WRONG + 1, size=measures.shape[1]), dtype=np.int64)
    fixed = sorted(held)
    for one in fixed:
        wanted[one] = held[one]
    best: tuple[float, tuple[int, ...]] = (_MOST_OFF, ())
    for chosen in itertools.combinations(range(1, len(measures)), _WRONG):
        if all(apart[a, b] for a, b in itertools.combinations((0, *chosen), 2)):
            off = np.abs(_rank(measures, chosen) - wanted)
            if (off[fixed] <= _HELD_OFF).all():
                best = min(best, (float(off.mean()), chosen))
    return best[1]


def _rank(measures: NDArray[np.float64], chosen: Sequence[int]) -> NDArray[np.float64]:
    """How many of those chosen are below the first in each measure; equal ones count half."""
    step = measures[list(chosen)] - measures[0]
    is_equal = np.abs(step) <= _EQUAL
    below: NDArray[np.float64] = (step < -_EQUAL).sum(axis=0) + is_equal.sum(axis=0) / 2
    return below


def looks(first: Shot, shot: Shot) -> tuple[float, ...]:
    """Eight measures of a picture, most of them shares of its side or of what is colored.

    What is colored: how much, its middle across and down, its width and its top. What changed
    against the first picture: how much, and its middle across and down.
    """
    rows, columns = np.nonzero(shot.block >= 0)
    side, area = len(shot.block), max(int((first.block >= 0).sum()), 1)
    changed_rows, changed_columns = np.nonzero(changed_pixels(first, shot))
    if not len(changed_rows):
        changed_rows, changed_columns = rows, columns
    return (
        5 * len(rows) / area,
        10 * float(columns.mean()) / side,
        10 * float(rows.mean()) / side,
        5 * float(np.ptp(columns)) / side,
        5 * float(rows.min()) / side,
        2 * len(changed_rows) / area,
        2 * float(changed_columns.mean()) / side,
        2 * float(changed_rows.mean()) / side,
    )


"""How many ranks the right option may be off, on average over the measures."""
_UNLIKE_STEPS = 5.0


class Four(NamedTuple):
    """Rows of a right option and three wrong ones, and the right one's ranks by the measures.

    `chosen` is empty where there are no four.
    """

    chosen: tuple[int, ...] = ()
    ranks: tuple[float, ...] = ()

    def halves(self, *measures: int) -> str:
        """Whether the right one is of the lesser or the greater half by each of some measures."""
        return "-".join("less" if self.ranks[i] < _WRONG / 2 else "more" for i in measures)


def four_alike(
    measures: NDArray[np.float64],
    apart: NDArray[np.bool_],
    rng: np.random.Generator,
    *,
    rights: int = 1,
    unlike: NDArray[np.float64] | None = None,
) -> Four:
    """A right row and three wrong ones, all apart, among which it has about the ranks drawn.

    `measures` has shape (n, k), its first `rights` rows are of options that are right. `apart` and
    `unlike` have shape (n, n); where `unlike` is given, the sum over the other three is one more
    measure. No four where none come near.
    """
    if not 0 < rights <= len(measures) - _WRONG:
        return Four()
    wanted = _drawn_ranks(measures, rng, unlike)
    threes = np.array(list(itertools.combinations(range(rights, len(measures)), _WRONG)))
    for i, j in itertools.combinations(range(_WRONG), 2):
        threes = threes[apart[threes[:, i], threes[:, j]]]
    best, nearest = Four(), _MOST_OFF
    for right in range(rights):
        fitting = threes[apart[right][threes].all(axis=1)]
        if not len(fitting):
            continue
        ranks = _ranks(measures, right, fitting, unlike)
        off = np.abs(ranks - wanted).mean(axis=1)
        place = int(off.argmin())
        if off[place] < nearest:
            nearest = float(off[place])
            best = Four((right, *fitting[place].tolist()), tuple(ranks[place].tolist()))
    return best


def _drawn_ranks(
    measures: NDArray[np.float64], rng: np.random.Generator, unlike: NDArray[np.float64] | None
) -> NDArray[np.float64]:
    """The ranks of any one among any four: each rank as likely, by all measures together."""
    one, *others = rng.choice(len(measures), size=_WRONG + 1, replace=False).tolist()
    drawn: NDArray[np.float64] = _ranks(measures, one, np.array([others]), unlike)[0]
    return drawn


def _ranks(
    measures: NDArray[np.float64],
    right: int,
    threes: NDArray[np.int64],
    unlike: NDArray[np.float64] | None,
) -> NDArray[np.float64]:
    """How many of each three are below the right one, by measure; equal ones count half."""
    steps = measures[threes] - measures[right]
    if unlike is not None:
        four = np.column_stack([np.full(len(threes), right), threes])
        sums = unlike[four[:, :, None], four[:, None, :]].sum(axis=2)
        scale = max(float(unlike.max()), 1.0) / _UNLIKE_STEPS
        odd = (sums[:, 1:] - sums[:, :1]) / scale
        steps = np.concatenate([steps, odd[:, :, None]], axis=2)
    below: NDArray[np.float64] = (steps < -_EQUAL).sum(axis=1) + (np.abs(steps) <= _EQUAL).sum(
        axis=1
    ) / 2
    return below
