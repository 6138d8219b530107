"""What makers of questions with several pictures share: recipes, likeness, differences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from phyblock.domain.question import LETTERS, Question, QuestionPicture
from phyblock.domain.scene import Block, Scene
from phyblock.making.questions.choices import pick
from phyblock.making.questions.question_draft import Draft, Option, UnfairError
from phyblock.making.questions.wording import fill, wording_ids
from phyblock.sim.outcomes import DEFAULT_LIMITS
from phyblock.sim.seeing import is_inside, least_difference, seen
from phyblock.sim.support import whole_bounds_m
from phyblock.sim.world import Pose

__all__ = [
    "LEAST_PIXELS",
    "are_alike",
    "are_told_apart",
    "draft",
    "moved_between",
    "of_kind",
    "only_index",
    "option_pictures",
    "picture_of",
    "same_blocks",
    "state",
    "story_of",
    "with_room",
]

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
        if distance_m > DEFAULT_LIMITS.moved_m or angle_deg > DEFAULT_LIMITS.moved_deg:
            moved.append(block.order)
        elif distance_m > DEFAULT_LIMITS.still_m or angle_deg > DEFAULT_LIMITS.still_deg:
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
