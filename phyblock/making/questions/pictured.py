"""Questions with several pictures: recipes that can be told apart, and options that look alike."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.question import LETTERS, Question, QuestionPicture
from phyblock.domain.scene import Block
from phyblock.making.questions.draft import UnfairError
from phyblock.sim.engine import Pose
from phyblock.sim.question_pictures import is_inside, least_difference, seen, seen_order

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
