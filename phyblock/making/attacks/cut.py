"""Pictures that the camera's near or far plane cuts open: the law is that nothing reaches there."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from phyblock.domain.question import LETTERS, Question, QuestionPicture
from phyblock.sim.pictures import PictureStyle
from phyblock.sim.question_pictures import drawn_blocks, question_camera
from phyblock.sim.render import shoot
from phyblock.sim.seeing import SEEN_PX, differing_pixels

__all__ = ["Cut", "cuts_of"]

_ROOM_M = 0.02
_NEAREST_M = 0.005
_STYLE = PictureStyle(SEEN_PX)


class Cut(NamedTuple):
    """A picture with corners of blocks before the near or beyond the far plane, by its label.

    `pixels` of `SEEN_PX` squared are other ones with the planes wide open, none where what is cut
    does not show; `is_wrong` where the picture is an option that is not the answer.
    """

    label: str
    pixels: int
    at_near: bool
    at_far: bool
    is_wrong: bool


def cuts_of(question: Question) -> tuple[Cut, ...]:
    """The pictures of a question that are cut."""
    wrong = set(LETTERS) - set(question.answer_letters)
    cuts = (_cut(picture, picture.label in wrong) for picture in question.pictures)
    return tuple(cut for cut in cuts if cut is not None)


def _cut(picture: QuestionPicture, is_wrong: bool) -> Cut | None:
    """Only what has corners beyond the planes is drawn, once as it is and once whole."""
    camera, blocks = question_camera(picture, _STYLE), drawn_blocks(picture)
    corners = np.vstack([block.vertices_m for block in blocks])
    depths = (corners - camera.eye_m) @ camera.axes[2]
    nearest, farthest = float(depths.min()), float(depths.max())
    at_near, at_far = nearest < camera.near_m, farthest > camera.far_m
    if not (at_near or at_far):
        return None
    opened = replace(
        camera,
        near_m=min(camera.near_m, max(nearest - _ROOM_M, _NEAREST_M)),
        far_m=max(camera.far_m, farthest + _ROOM_M),
    )
    drawn = (shoot(blocks, one, SEEN_PX) for one in (camera, opened))
    pixels = differing_pixels(*drawn)
    return Cut(picture.label, pixels, at_near, at_far, is_wrong)
