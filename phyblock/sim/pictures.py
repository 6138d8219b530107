"""The pictures a model sees: goal, numbered candidates, composite; and the keys they cache under.

All functions here are pure in what they return: the same input gives the same bytes in every
process of one machine. Keys name everything that the bytes depend on, and nothing else.
"""

from __future__ import annotations

import functools
import io
import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from phyblock.domain.blocks import SHAPES, BlockType, Color, Euler
from phyblock.domain.candidates import CandidateSet
from phyblock.domain.scene import Scene
from phyblock.errors import DataError, Problem
from phyblock.sim.camera import VIEWS, Camera, Window, frame, view_axes
from phyblock.sim.compose import GRID_COLUMNS, LABEL_STRIP, numbered_grid, side_by_side, to_png
from phyblock.sim.exact import dot
from phyblock.sim.library_pixels import library_pixels
from phyblock.sim.registry import renderer
from phyblock.sim.render import DrawnBlock, picture
from phyblock.sim.renderer import Renderer
from phyblock.stable import hex_digest
from phyblock.types import BACKGROUNDS, Background, CandidateScale, View

__all__ = [
    "LARGEST_PX",
    "RENDER_VERSION",
    "SMALLEST_PX",
    "PictureStyle",
    "camera_for",
    "candidate_camera",
    "candidates_key",
    "candidates_png",
    "common_distance_m",
    "composite_png",
    "drawn",
    "empty_cell",
    "goal_camera",
    "goal_key",
    "goal_png",
    "goal_style",
    "on_the_floor",
    "picture_key",
    "pixel_versions",
    "thumbnail",
]

RENDER_VERSION = 2
"""Raised whenever the same input gives other pixels, so that stored pictures are made again."""

SMALLEST_PX, LARGEST_PX = 128, 2048
"""Sides that pictures may have."""
_GOAL_WINDOW = Window(-0.84, 0.84, -0.84, 0.84)
_GOAL_MIN_DISTANCE_M = 0.48
_CELL_WINDOW = Window(-0.86, 0.86, 2 * LABEL_STRIP - 1.0, 0.86)
_LARGEST_DIAGONAL_M = 0.16
_SIZE_CUE = 0.25
_CUBE_M = 0.05
_LEAST_CUBE = 0.08
"""The least share of a goal picture's side that the edge of its farthest cube takes."""


@dataclass(frozen=True)
class PictureStyle:
    """How pictures look: side length [pixels], background, and where they are seen from.

    Azimuth 0 looks from +x and 90 from +y; elevation 90 looks straight down [degrees]. Candidates
    share one scale in their grid (`common`), or each fills its cell (`fit`). Raises ValueError for
    a size under 128 or over 2048, an elevation outside 1..90, an azimuth that is no number, or an
    unknown background or scale.
    """

    size_px: int = 512
    background: Background = "checkerboard"
    azimuth_deg: float = VIEWS["oblique"][0]
    elevation_deg: float = VIEWS["oblique"][1]
    candidate_scale: CandidateScale = "common"

    def __post_init__(self) -> None:
        if not SMALLEST_PX <= self.size_px <= LARGEST_PX:
            allowed = f"allowed {SMALLEST_PX}..{LARGEST_PX}"
            raise ValueError(f"size_px is {self.size_px}, {allowed}")
        if self.background not in BACKGROUNDS:
            raise ValueError(f"background is {self.background!r}, allowed {', '.join(BACKGROUNDS)}")
        if self.candidate_scale not in (scales := get_args(CandidateScale)):
            raise ValueError(
                f"candidate_scale is {self.candidate_scale!r}, allowed {', '.join(scales)}"
            )
        if not 1 <= self.elevation_deg <= 90:
            raise ValueError(f"elevation_deg is {self.elevation_deg}, allowed 1..90")
        if not math.isfinite(self.azimuth_deg):
            raise ValueError(f"azimuth_deg is {self.azimuth_deg}, allowed any finite number")

    @classmethod
    def from_view(
        cls, view: View, size_px: int = 512, background: Background = "checkerboard"
    ) -> PictureStyle:
        """The style of a named view (front, side, top, oblique); ValueError for another name."""
        if view not in VIEWS:
            raise ValueError(f"view is {view!r}, allowed {', '.join(sorted(VIEWS))}")
        return cls(size_px, background, *VIEWS[view])


def goal_png(scene: Scene, style: PictureStyle) -> bytes:
    """PNG of the finished structure, square, framed so that no block is cut off."""
    blocks = drawn(scene)
    image = picture(blocks, goal_camera(scene, style), style.background, style.size_px)
    return to_png(image)


def candidates_png(candidates: CandidateSet, style: PictureStyle) -> bytes:
    """PNG of the numbered candidates, square, 4 by 4 cells, seen from where the goal is seen."""
    cell_px = math.ceil(style.size_px / GRID_COLUMNS)
    blocks = [on_the_floor(c.type, c.color, c.euler_deg) for c in candidates.candidates]
    distance_m = common_distance_m(blocks, style) if style.candidate_scale == "common" else None
    cells = [thumbnail(block, style, cell_px, distance_m, renderer()) for block in blocks]
    empty = empty_cell(style, cell_px)
    return to_png(numbered_grid(cells, empty, style.background, style.size_px))


def composite_png(goal: bytes, candidates: bytes) -> bytes:
    """PNG with the goal on the left and the candidates on the right of a narrow white gap."""
    with Image.open(io.BytesIO(goal)) as left, Image.open(io.BytesIO(candidates)) as right:
        return to_png(side_by_side(left.convert("RGB"), right.convert("RGB")))


def goal_key(scene: Scene, style: PictureStyle) -> str:
    """SHA-256 [hex] of all that the goal picture depends on; the scene's id is not part of it."""
    content = [(b.type, b.color, b.position_m, b.euler_deg) for b in scene.blocks]
    return picture_key("goal", style, content)


def candidates_key(candidates: CandidateSet, style: PictureStyle) -> str:
    """SHA-256 [hex] of all that the candidate grid depends on."""
    content = [(c.type, c.color, c.euler_deg) for c in candidates.candidates]
    return picture_key("candidates", style, [style.candidate_scale, *content])


def goal_camera(scene: Scene, style: PictureStyle) -> Camera:
    """The camera of the goal picture; raises DataError for a scene without blocks."""
    return camera_for(drawn(scene), style, scene.id)


def goal_style(scene: Scene, style: PictureStyle) -> PictureStyle:
    """The style, of a larger size where blocks of the goal would come out small.

    A length of 50 mm at the farthest block spans 8 % of the asked side or more, in pixels. Raises
    DataError for a scene without blocks.
    """
    camera = goal_camera(scene, style)
    places = np.array([block.position_m for block in scene.blocks])
    farthest_m = float(dot(places - camera.eye_m, camera.axes[2]).max())
    growth = _LEAST_CUBE * camera.width_m(farthest_m) / _CUBE_M
    size_px = min(math.ceil(style.size_px * max(growth, 1.0)), LARGEST_PX)
    return replace(style, size_px=size_px)


def camera_for(
    blocks: Sequence[DrawnBlock],
    style: PictureStyle,
    where: str,
    shown: Sequence[DrawnBlock] = (),
) -> Camera:
    """The camera that frames blocks as a goal; DataError, at `where`, when there are none.

    `shown` are all blocks of the picture, where those are not the ones that it frames.
    """
    if not blocks:
        raise DataError(Problem(where=where, field="blocks", message="there is none to draw"))
    points = np.vstack([block.vertices_m for block in blocks])
    axes = view_axes(style.azimuth_deg, style.elevation_deg)
    drawn_m = np.vstack([block.vertices_m for block in shown]) if shown else None
    return frame(points, axes, _GOAL_WINDOW, _GOAL_MIN_DISTANCE_M, drawn_m)


def candidate_camera(
    block: DrawnBlock, style: PictureStyle, distance_m: float | None = None
) -> Camera:
    """The camera of one cell, `distance_m` from the middle of the block [m].

    Without a distance the block fills the cell above the number's strip, longer ones a little more
    (fourth root of the diagonal), so that a picture still tells which of two is the larger.
    """
    axes = view_axes(style.azimuth_deg, style.elevation_deg)
    if distance_m is not None:
        return frame(block.vertices_m, axes, _CELL_WINDOW, distance_m - _half_depth_m(block, axes))
    shape = SHAPES[block.type]
    diagonal_m = math.dist(shape.low_m, shape.high_m)
    window = _CELL_WINDOW.scaled((diagonal_m / _LARGEST_DIAGONAL_M) ** _SIZE_CUE)
    return frame(block.vertices_m, axes, window)


def common_distance_m(blocks: Iterable[DrawnBlock], style: PictureStyle) -> float:
    """The least distance from the middle of each block [m] from which all fit their cells.

    Blocks at one distance are drawn at one scale.
    """
    axes = view_axes(style.azimuth_deg, style.elevation_deg)
    needed = [0.0]
    for block in blocks:
        closest = frame(block.vertices_m, axes, _CELL_WINDOW)
        nearest_m = float(dot(block.vertices_m - closest.eye_m, axes[2]).min())
        needed.append(nearest_m + _half_depth_m(block, axes))
    return max(needed)


def _half_depth_m(block: DrawnBlock, axes: NDArray[np.float64]) -> float:
    return float(np.ptp(dot(block.vertices_m, axes[2]))) / 2


def on_the_floor(block_type: BlockType, color: Color, euler_deg: Euler) -> DrawnBlock:
    """A single block in its orientation, its lowest point on the floor."""
    lifted = DrawnBlock(block_type, color, (0.0, 0.0, 0.0), euler_deg)
    return DrawnBlock(
        block_type, color, (0.0, 0.0, -float(lifted.vertices_m[:, 2].min())), euler_deg
    )


@functools.lru_cache(maxsize=512)
def thumbnail(
    block: DrawnBlock,
    style: PictureStyle,
    cell_px: int,
    distance_m: float | None,
    drawn_by: Renderer,
) -> Image.Image:
    """One cell of the grid of candidates, before its number; shared: do not draw on it."""
    camera = candidate_camera(block, style, distance_m)
    return picture([block], camera, style.background, cell_px, drawn_by=drawn_by)


def empty_cell(style: PictureStyle, cell_px: int) -> Image.Image:
    """A cell of the grid in which there is no candidate."""
    block = on_the_floor("cube", "red", (0.0, 0.0, 0.0))
    return picture([], candidate_camera(block, style), style.background, cell_px)


def drawn(scene: Scene) -> list[DrawnBlock]:
    """The blocks of a scene as the renderer takes them."""
    return [DrawnBlock(b.type, b.color, b.position_m, b.euler_deg) for b in scene.blocks]


def pixel_versions() -> dict[str, str]:
    """The chosen renderer with its versions, and what the picture library draws."""
    drawn_by = renderer()
    return {"renderer": drawn_by.name, **drawn_by.versions, "pillow": library_pixels()}


def picture_key(kind: str, style: PictureStyle, content: Iterable[object]) -> str:
    """SHA-256 [hex] of what decides a picture: what it shows, its style, and who draws it."""
    parts = {
        "kind": kind,
        "render_version": RENDER_VERSION,
        **pixel_versions(),
        "style": [style.size_px, style.background, style.azimuth_deg, style.elevation_deg],
        "content": list(content),
    }
    return hex_digest(json.dumps(parts, sort_keys=True, allow_nan=False))
