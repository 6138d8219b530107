"""What a question's picture shows: shares of blocks, where they are, and along which axes."""

from __future__ import annotations

import functools
from collections.abc import Collection, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.question import Question, QuestionPicture
from phyblock.domain.scene import Block, Scene
from phyblock.generate.questions.base import UnfairError
from phyblock.sim.camera import VIEWS, view_axes
from phyblock.sim.pictures import PictureStyle, goal_camera
from phyblock.sim.support import bounds_m
from phyblock.sim.visibility import visible_shares

__all__ = [
    "COUNTED",
    "GOAL_VIEW",
    "NAMED",
    "STUDIED",
    "are_seen",
    "center_m",
    "goal_picture",
    "picture_axes",
    "picture_columns",
    "require_seen",
    "shares",
    "shown_blocks",
]

GOAL_VIEW: tuple[float, float] = VIEWS["oblique"]
"""Azimuth and elevation of the goal picture [degrees]."""
COUNTED = 0.25
"""The least visible share of a block that is to be counted."""
NAMED = 0.4
"""The least visible share of a block that is named in a question or an option."""
STUDIED = 0.55
"""The least visible share of a block whose shape, size or orientation is asked about."""
_SIZE_PX = 256


def goal_picture(scene: Scene) -> QuestionPicture:
    """The whole scene from where goals are seen."""
    return QuestionPicture("scene", scene.blocks, GOAL_VIEW)


def shown_blocks(question: Question) -> tuple[Block, ...]:
    """The blocks of the one picture of a static question; UnfairError for other pictures."""
    labels = [picture.label for picture in question.pictures]
    if labels != ["scene"] or question.pictures[0].view_deg != GOAL_VIEW:
        raise UnfairError(f"has pictures {labels}, not the goal view alone")
    return question.pictures[0].blocks


def shares(blocks: Sequence[Block]) -> Mapping[int, float]:
    """Visible share of each block, by order, in the goal view of these blocks."""
    kept = tuple(
        Block(b.order, b.type, "red", b.position_m, b.euler_deg, (), b.layer) for b in blocks
    )
    return _shares(kept)


@functools.lru_cache(maxsize=512)
def _shares(blocks: tuple[Block, ...]) -> Mapping[int, float]:
    style = PictureStyle(_SIZE_PX, "checkerboard", *GOAL_VIEW)
    return visible_shares(Scene("", (1,), blocks, ()), style)


def are_seen(blocks: Sequence[Block], orders: Collection[int], least: float) -> bool:
    """Whether each of the named blocks shows at least this share of itself."""
    seen = shares(blocks)
    return all(seen[order] >= least for order in orders)


def require_seen(blocks: Sequence[Block], orders: Collection[int], least: float) -> None:
    """Raise UnfairError that names the blocks that show less than `least`."""
    seen = shares(blocks)
    hidden = [order for order in sorted(orders) if seen[order] < least]
    if hidden:
        raise UnfairError(f"blocks {hidden} show less than {least:.0%} of themselves")


@functools.lru_cache(maxsize=4096)
def center_m(block: Block) -> NDArray[np.float64]:
    """Middle of the box round a block, shape (3,) [m], world frame."""
    middle: NDArray[np.float64] = bounds_m(block).mean(axis=0)
    return middle


def picture_axes() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """To the right of the picture and away from the viewer along the floor, unit (3,) vectors."""
    right, _, forward = view_axes(*GOAL_VIEW)
    away = np.array([forward[0], forward[1], 0.0])
    return right, away / np.linalg.norm(away)


def picture_columns(blocks: Sequence[Block]) -> Mapping[int, float]:
    """Where the middle of each block is across the goal view, -1 (left edge) to 1, by order."""
    return _columns(tuple(blocks))


@functools.lru_cache(maxsize=512)
def _columns(blocks: tuple[Block, ...]) -> Mapping[int, float]:
    style = PictureStyle(_SIZE_PX, "checkerboard", *GOAL_VIEW)
    camera = goal_camera(Scene("", (1,), blocks, ()), style)
    places = camera.project(np.array([center_m(block) for block in blocks]))
    return {block.order: float(place[0]) for block, place in zip(blocks, places, strict=True)}
