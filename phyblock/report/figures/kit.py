"""The kit of blocks: every shape with its dimensions, mass and colors."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.blocks import BLOCK_TYPES, KIT_PALETTE, SHAPES, BlockType, Color
from phyblock.sim.camera import Camera
from phyblock.sim.pictures import (
    DrawnBlock,
    PictureStyle,
    candidate_camera,
    common_distance_m,
    on_the_floor,
    picture,
)
from phyblock.tables.drawing import INK, MUTED, drawn_width_in, headed, new_figure, wrapped
from phyblock.tables.load import Run

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["block_kit"]

_STYLE = PictureStyle(512, "white", 32.0, 24.0)
_CELL_IN = 1.1
_CM = 100.0
_TOP, _FOOT = 0.06, 0.88
"""What of a square picture is shown."""
_AWAY_M = 0.011
_BESIDE_PT = 6.0
"""From the middle of an arrow to the middle of its number."""
_FARTHER = 1.12
"""How much farther the camera is than would just frame the blocks: dimensions stand beside them."""
_GRAMS = 1000


def block_kit(_: Run) -> Figure | None:
    """All shapes at one scale, as they lie in their own frame, with the edges of their boxes."""
    columns = max(2, min(4, int(drawn_width_in() / _CELL_IN)))
    rows = math.ceil(len(BLOCK_TYPES) / columns)
    width = drawn_width_in()
    cell = width / columns
    figure = new_figure(0.5 + rows * ((_FOOT - _TOP) * cell + 0.5))
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    blocks = {name: on_the_floor(name, _colors(name)[0], (0.0, 0.0, 0.0)) for name in BLOCK_TYPES}
    distance_m = _FARTHER * common_distance_m(blocks.values(), _STYLE)
    for ax, (name, block) in zip(axes, blocks.items(), strict=False):
        _show(ax, block, candidate_camera(block, _STYLE, distance_m))
        ax.set_title(name.replace("_", "-"), loc="center", pad=2)
        lines = wrapped(", ".join(_colors(name)), cell - 0.1, 6.5)
        told = "\n".join([f"{_GRAMS * SHAPES[name].mass_kg:.0f} g", *lines])
        ax.set_xlabel(told, fontsize=6.5, color=MUTED, labelpad=2)
    for ax in axes[len(blocks) :]:
        ax.set_axis_off()
    headed(
        figure,
        "The blocks of the kit",
        "Dimensions in centimeters, all at one scale; mass in ABS plastic; colors of the kit",
    )
    return figure


def _colors(name: BlockType) -> list[Color]:
    return [color for kind, color in KIT_PALETTE if kind == name]


def _box(block: DrawnBlock) -> NDArray[np.float64]:
    """The corners of the box round a block, shape (8, 3) [m]."""
    low, high = block.vertices_m.min(axis=0), block.vertices_m.max(axis=0)
    corners = np.array(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij")).reshape(3, -1).T
    return np.asarray(low + corners * (high - low))


def _show(ax: Axes, block: DrawnBlock, camera: Camera) -> None:
    side = _STYLE.size_px
    image = picture([block], camera, _STYLE.background, side)
    ax.imshow(np.asarray(image), interpolation="lanczos")
    ax.set_xticks([])
    ax.set_yticks([])
    for spine in ax.spines.values():
        spine.set_visible(False)
    corners = _box(block)
    low, high = corners[0], corners[-1]
    middle = camera.to_pixels(corners, side).mean(axis=0)
    # The lower edges towards the camera, and the upright one at the left of the picture.
    away = _AWAY_M
    edges = (
        ((high[0] + away, low[1], low[2]), (high[0] + away, high[1], low[2])),
        ((low[0], high[1] + away, low[2]), (high[0], high[1] + away, low[2])),
        ((high[0] + away / 2, low[1] - away, low[2]), (high[0] + away / 2, low[1] - away, high[2])),
    )
    for edge in edges:
        ends = camera.to_pixels(np.array(edge), side)
        _measured(ax, ends, middle, math.dist(*edge) * _CM)
    ax.set(xlim=(0, side), ylim=(_FOOT * side, _TOP * side))


def _measured(
    ax: Axes, ends: NDArray[np.float64], inner: NDArray[np.float64], length_cm: float
) -> None:
    """A line with arrows at both ends and how long it is, on the side away from `inner` [px]."""
    arrow = {"arrowstyle": "<->", "color": INK, "linewidth": 0.7, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", tuple(ends[0]), tuple(ends[1]), arrowprops=arrow | {"mutation_scale": 5})
    middle = ends.mean(axis=0)
    across, down = ends[1] - ends[0]
    normal = np.array([-down, across]) / math.hypot(across, down)
    if normal @ (middle - inner) < 0:
        normal = -normal
    ax.annotate(
        f"{round(length_cm, 1):g}",
        tuple(middle),
        (_BESIDE_PT * normal[0], -_BESIDE_PT * normal[1]),
        textcoords="offset points",
        ha="center",
        va="center",
        fontsize=6.5,
        color=INK,
    )
