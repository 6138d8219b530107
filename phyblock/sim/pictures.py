"""The pictures a model sees: goal, numbered candidates, composite; and the keys they cache under.

Plans with poses get scales: a sheet of candidates, and the goal on a floor with lines every
centimeter, numbers every five next to the camera, named axes, and a pole that marks the height.

Pictures are drawn at twice the size and scaled down, so the rasterizer needs no anti-aliasing.
Outlines are drawn where the face number of pixels changes. The same input gives the same bytes in
every process of one machine; keys cover everything that the bytes depend on, and nothing else.
"""

from __future__ import annotations

import functools
import io
import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass, replace
from typing import NamedTuple, TypeVar

import numpy as np
import PIL
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from phyblock.domain.blocks import SHAPES, BlockType, Color, Euler, euler_deg_to_matrix
from phyblock.domain.scene import Block, CandidateSet, Scene
from phyblock.errors import DataError, Problem
from phyblock.sim import raster
from phyblock.sim.backgrounds import DARK_INK, GROUNDS, INK_RGB, LIGHT_INK, floor, shadow
from phyblock.sim.engine import Pose
from phyblock.sim.geometry import dot, drawn_mesh, rounded, turned
from phyblock.sim.raster import Camera, Light, Prop, Raster, Rgb, Window
from phyblock.text import hex_digest
from phyblock.types import BACKGROUNDS, Background, View

RENDER_VERSION = 2
"""Increased whenever the same input gives other pixels, so that stored pictures are redrawn."""
SUPERSAMPLE = 2
COLOR_RGB: dict[Color, Rgb] = {
    "red": (244, 54, 54),
    "yellow": (250, 218, 50),
    "blue": (56, 88, 246),
    "green": (72, 190, 42),
    "orange": (250, 124, 46),
}
"""Color of a fully lit face, 0..255."""
_AMBIENT = 0.55
_DIFFUSE = 0.55
_LIGHT_AZIMUTH_DEG = -18.0
_LIGHT_ELEVATION_DEG = 46.0

Pixel = TypeVar("Pixel", np.uint8, np.float32)


def drawn_m(block: Block) -> NDArray[np.float64]:
    """World corners of the drawn mesh of a block, shape (n, 3) [m]."""
    return _turned_m(block.type, block.euler_deg) + block.position_m


@functools.lru_cache(maxsize=1024)
def _turned_m(block_type: BlockType, euler_deg: Euler) -> NDArray[np.float64]:
    """World corners of a block's drawn mesh at the origin, shape (n, 3) [m]; do not change it."""
    matrix = rounded(euler_deg_to_matrix(euler_deg))
    return turned(drawn_mesh(block_type).vertices_m, matrix)


def looks(blocks: Iterable[Block]) -> list[tuple[object, ...]]:
    """Everything about blocks that pictures of them depend on."""
    return [(b.type, b.color, b.position_m, b.euler_deg) for b in blocks]


def on_the_floor(block_type: BlockType, color: Color, euler_deg: Euler) -> Block:
    """A single block in its orientation, its lowest point on the floor."""
    low_m = float(_turned_m(block_type, euler_deg)[:, 2].min())
    return Block(1, block_type, color, (0.0, 0.0, -low_m), euler_deg, (), 1)


def picture(
    blocks: Sequence[Block],
    camera: Camera,
    background: Background,
    size_px: int,
    ground: NDArray[np.float32] | None = None,
) -> Image.Image:
    """Blocks on their floor, or on a `ground` from `empty_ground`, anti-aliased, RGB."""
    image = empty_ground(background, camera, size_px) if ground is None else ground.copy()
    if blocks:
        drawing = _raster(blocks, camera, size_px * SUPERSAMPLE)
        image *= shadow(background, drawing.shaded)
        np.copyto(image, drawing.rgb, where=drawing.prop[..., None] >= 0)
        image = draw_outlines(image, drawing, background)
    pixels = np.rint(image, out=image).astype(np.uint8)
    return Image.fromarray(pixels).resize((size_px, size_px), Image.Resampling.BOX)


def empty_ground(background: Background, camera: Camera, size_px: int) -> NDArray[np.float32]:
    """The floor of a picture of `size_px` squared, before it is scaled down."""
    return floor(background, camera, size_px * SUPERSAMPLE)


@dataclass(frozen=True, eq=False)
class Shot:
    """Blocks, outlined: `rgb` (size, size, 3), and the `block` of each pixel, from 0, or -1."""

    rgb: NDArray[np.uint8]
    block: NDArray[np.int64]


def shoot(blocks: Sequence[Block], camera: Camera, size_px: int) -> Shot:
    """Draw blocks without a floor, at exactly `size_px` and without anti-aliasing."""
    drawing = _raster(blocks, camera, size_px)
    return Shot(draw_outlines(drawing.rgb, drawing, None), drawing.prop)


def segments(blocks: Sequence[Block], camera: Camera, size_px: int) -> NDArray[np.int64]:
    """The 0-based number of the block in each pixel, shape (size, size), -1 for none."""
    light = Light(np.array([0.0, 0.0, 1.0]), 1.0, 0.0)
    return raster.draw(props_of(blocks), camera, light, size_px).prop


def _raster(blocks: Sequence[Block], camera: Camera, size_px: int) -> Raster:
    light = Light(light_direction(camera), _AMBIENT, _DIFFUSE)
    return raster.draw(props_of(blocks), camera, light, size_px)


def props_of(blocks: Sequence[Block]) -> list[Prop]:
    """Blocks as props of the rasterizer."""
    return [Prop(drawn_mesh(b.type), COLOR_RGB[b.color], Pose.goal(b)) for b in blocks]


def light_direction(camera: Camera) -> NDArray[np.float64]:
    """Unit vector to the light, which moves with the camera: above, slightly to its left."""
    right = camera.axes[0]
    azimuth = math.atan2(-right[0], right[1]) + math.radians(_LIGHT_AZIMUTH_DEG)
    elevation = math.radians(_LIGHT_ELEVATION_DEG)
    flat = math.cos(elevation)
    towards = [flat * math.cos(azimuth), flat * math.sin(azimuth), math.sin(elevation)]
    return rounded(np.array(towards))


def draw_outlines(
    image: NDArray[Pixel], drawing: Raster, background: Background | None
) -> NDArray[Pixel]:
    """A picture (size, size, 3) of a drawing with lines where faces, and blocks, end."""
    lined: NDArray[Pixel] = image.copy()
    lined[_ends(drawing.face, drawing.prop) & (drawing.prop >= 0)] = INK_RGB
    if background is not None:
        rim = _ends(drawing.prop >= 0)
        lined[rim | _ends(rim) & (drawing.prop < 0)] = GROUNDS[background].rim
    return lined


def _ends(*numbers: NDArray[np.int64] | NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The pixels beside which some number (size, size) changes, horizontally or vertically."""
    across = np.logical_or.reduce([number[:, 1:] != number[:, :-1] for number in numbers])
    down = np.logical_or.reduce([number[1:] != number[:-1] for number in numbers])
    ends = np.zeros(numbers[0].shape, dtype=np.bool_)
    ends[:, 1:] |= across
    ends[:, :-1] |= across
    ends[1:] |= down
    ends[:-1] |= down
    return ends


SMALLEST_PX, LARGEST_PX = 128, 2048  # Allowed sides of pictures.
GRID_COLUMNS = 4
LABEL_STRIP = 0.23  # Share of a cell's height, at its bottom, that is kept free for the number.
_LABEL_SIZE = 0.17
_LABEL_MARGIN = 0.05
_RIM = 0.012
_GAP = 0.016
_GOAL_WINDOW = Window(-0.84, 0.84, -0.84, 0.84)
_GOAL_MIN_DISTANCE_M = 0.48
_CELL_WINDOW = Window(-0.86, 0.86, 2 * LABEL_STRIP - 1.0, 0.86)
_LARGEST_DIAGONAL_M = 0.16
_SIZE_CUE = 0.25
_CUBE_M = 0.05
_LEAST_CUBE = 0.08
"""The least edge of a cube at the farthest block, as a share of the goal picture's side."""


@dataclass(frozen=True)
class PictureStyle:
    """Side length [pixels], background, and direction of the camera.

    Azimuth 0 looks from +x, 90 from +y; elevation 90 straight down [degrees]. Raises ValueError.
    """

    size_px: int = 512
    background: Background = "checkerboard"
    azimuth_deg: float = raster.VIEWS["oblique"][0]
    elevation_deg: float = raster.VIEWS["oblique"][1]

    def __post_init__(self) -> None:
        ranges = {"size_px": (SMALLEST_PX, LARGEST_PX), "elevation_deg": (1, 90)}
        for name, (least, most) in {**ranges, "azimuth_deg": (-math.inf, math.inf)}.items():
            number = getattr(self, name)
            if not (least <= number <= most and math.isfinite(number)):
                raise ValueError(f"{name} is {number!r}, allowed {least}..{most}")
        if self.background not in BACKGROUNDS:
            raise ValueError(f"background is {self.background!r}, allowed {', '.join(BACKGROUNDS)}")

    @classmethod
    def from_view(
        cls, view: View, size_px: int = 512, background: Background = "checkerboard"
    ) -> PictureStyle:
        """The style of a named view (front, side, top, oblique); ValueError for another name."""
        if view not in raster.VIEWS:
            raise ValueError(f"view is {view!r}, allowed {', '.join(sorted(raster.VIEWS))}")
        return cls(size_px, background, *raster.VIEWS[view])

    @property
    def axes(self) -> NDArray[np.float64]:
        """Right, up and forward of the view, rows of a (3, 3) array."""
        return raster.view_axes(self.azimuth_deg, self.elevation_deg)


def goal_png(scene: Scene, style: PictureStyle) -> bytes:
    """PNG of the finished structure, square, framed so that no block is cut off."""
    camera = goal_camera(scene, style)
    return to_png(picture(scene.blocks, camera, style.background, style.size_px))


def candidates_png(candidates: CandidateSet, style: PictureStyle) -> bytes:
    """PNG of the numbered candidates, square, 4 by 4 cells, in the goal's view."""
    return to_png(candidates_grid(candidates, style)[0])


def composite_png(goal: bytes, candidates: bytes) -> bytes:
    """PNG with the goal on the left and the candidates on the right of a narrow white gap."""
    with Image.open(io.BytesIO(goal)) as left, Image.open(io.BytesIO(candidates)) as right:
        joined = Image.new("RGB", joined_size_px(left.height), "white")
        joined.paste(left.convert("RGB"), (0, 0))
        joined.paste(right.convert("RGB"), (joined.width - right.width, 0))
        return to_png(joined)


def joined_size_px(side_px: int) -> tuple[int, int]:
    """Width and height of two squares side by side, as in the composite."""
    return 2 * side_px + max(2, round(side_px * _GAP)), side_px


def to_png(image: Image.Image) -> bytes:
    """The image as PNG; the same pixels always give the same bytes (no time or metadata)."""
    buffer = io.BytesIO()
    image.save(buffer, format="PNG", optimize=False, compress_level=6)
    return buffer.getvalue()


def goal_key(scene: Scene, style: PictureStyle) -> str:
    """SHA-256 [hex] of everything that the goal picture depends on, without the scene's id."""
    return picture_key("goal", style, looks(scene.blocks))


def candidates_key(candidates: CandidateSet, style: PictureStyle) -> str:
    """SHA-256 [hex] of everything that the candidate grid depends on."""
    content = [(c.type, c.color, c.euler_deg) for c in candidates.candidates]
    return picture_key("candidates", style, ["common", *content])


def picture_key(kind: str, style: PictureStyle, content: Iterable[object]) -> str:
    """SHA-256 [hex] of a picture's content, its style, and the versions of the drawing code."""
    parts = {
        "kind": kind,
        "render_version": RENDER_VERSION,
        **pixel_versions(),
        "style": [style.size_px, style.background, style.azimuth_deg, style.elevation_deg],
        "content": list(content),
    }
    return hex_digest(json.dumps(parts, sort_keys=True, allow_nan=False))


def pixel_versions() -> dict[str, str]:
    """Versions of the rasterizer, and of Pillow for text, lines, scaling and PNG."""
    return {"raster": raster.RASTER_VERSION, "pillow": PIL.__version__}


def goal_camera(scene: Scene, style: PictureStyle) -> Camera:
    """The camera of the goal picture. Raises DataError for a scene without blocks."""
    return camera_for(scene.blocks, style, scene.id)


def goal_style(scene: Scene, style: PictureStyle) -> PictureStyle:
    """The style, with a larger size if the farthest block of a goal would be small."""
    camera = goal_camera(scene, style)
    places = np.array([block.position_m for block in scene.blocks])
    farthest_m = float(dot(places - camera.eye_m, camera.axes[2]).max())
    growth = _LEAST_CUBE * camera.width_m(farthest_m) / _CUBE_M
    return replace(style, size_px=min(math.ceil(style.size_px * max(growth, 1.0)), LARGEST_PX))


def camera_for(
    blocks: Sequence[Block], style: PictureStyle, where: str, shown: Sequence[Block] = ()
) -> Camera:
    """The camera that frames blocks among all `shown` ones. Raises DataError without blocks."""
    if not blocks:
        raise DataError(Problem(where=where, field="blocks", message="there is none to draw"))
    points, more = (np.vstack([drawn_m(b) for b in some]) for some in (blocks, shown or blocks))
    drawn = more if shown else None
    return raster.frame(points, style.axes, _GOAL_WINDOW, _GOAL_MIN_DISTANCE_M, drawn)


class Lookout:
    """The camera of a scene's goal, prepared to draw other blocks quickly."""

    def __init__(self, scene: Scene, style: PictureStyle) -> None:
        self._goal, self._style, camera = scene.blocks, style, goal_camera(scene, style)
        self._eye_m = camera.eye_m
        self._ground = empty_ground(style.background, camera, style.size_px)

    def image(self, blocks: Sequence[Block]) -> Image.Image:
        """The blocks on the ground, an RGB image of the style's size."""
        style = self._style
        camera = camera_for(self._goal, style, "current", blocks)
        # Blocks that fell towards the camera may require it to move back.
        ground = self._ground if np.array_equal(camera.eye_m, self._eye_m) else None
        return picture(blocks, camera, style.background, style.size_px, ground)


def candidates_grid(
    candidates: CandidateSet, style: PictureStyle
) -> tuple[Image.Image, list[Block], float | None]:
    """Candidates in a numbered 4 by 4 grid, the drawn blocks, and their common distance [m]."""
    size_px, cell_px = style.size_px, math.ceil(style.size_px / GRID_COLUMNS)
    blocks = [on_the_floor(c.type, c.color, c.euler_deg) for c in candidates.candidates]
    distance_m = common_distance_m(blocks, style)
    cube = on_the_floor("cube", "red", (0.0, 0.0, 0.0))
    empty = picture([], candidate_camera(cube, style), style.background, cell_px)
    grid = Image.new("RGB", (size_px, size_px))
    edges = [round(i * size_px / GRID_COLUMNS) for i in range(GRID_COLUMNS + 1)]
    ground = GROUNDS[style.background]
    for place in range(GRID_COLUMNS**2):
        row, column = divmod(place, GRID_COLUMNS)
        box = (edges[column], edges[row], edges[column + 1], edges[row + 1])
        cell = empty
        if place < len(blocks):
            cell = thumbnail(blocks[place], style, cell_px, distance_m).copy()
            # At the bottom of the cell; on textured floors, with a rim around it.
            font = ImageFont.load_default(size=_LABEL_SIZE * cell_px)
            corner = (cell_px * (1 - _LABEL_MARGIN), cell_px * (1 - _LABEL_MARGIN))
            rim = DARK_INK if ground.ink == LIGHT_INK else LIGHT_INK
            width = round(cell_px * _RIM) if ground.texture else 0
            pen, text = ImageDraw.Draw(cell), str(place + 1)
            pen.text(corner, text, ground.ink, font, "rs", stroke_width=width, stroke_fill=rim)
        grid.paste(cell.resize((box[2] - box[0], box[3] - box[1])), box[:2])
    lines, ink = ImageDraw.Draw(grid), ground.line
    for edge in edges[1:-1]:
        lines.line([(edge, 0), (edge, size_px)], fill=ink)
        lines.line([(0, edge), (size_px, edge)], fill=ink)
    return grid, blocks, distance_m


@functools.lru_cache(maxsize=512)
def thumbnail(
    block: Block, style: PictureStyle, cell_px: int, distance_m: float | None
) -> Image.Image:
    """One cell of the candidate grid, without its number; shared: do not draw on it."""
    return picture([block], candidate_camera(block, style, distance_m), style.background, cell_px)


def candidate_camera(block: Block, style: PictureStyle, distance_m: float | None = None) -> Camera:
    """The camera of one cell, at a distance from the block's center [m], or filled by it."""
    if distance_m is None:
        return close_camera(block, style, _CELL_WINDOW)
    nearest_m = distance_m - _half_depth_m(block, style)
    return raster.frame(drawn_m(block), style.axes, _CELL_WINDOW, nearest_m)


def close_camera(block: Block, style: PictureStyle, window: Window) -> Camera:
    """The camera of a single block, which fills about the same share for every type."""
    shape = SHAPES[block.type]
    share = (math.dist(shape.low_m, shape.high_m) / _LARGEST_DIAGONAL_M) ** _SIZE_CUE
    x, y = (window.left + window.right) / 2, (window.bottom + window.top) / 2
    half_x, half_y = (window.right - window.left) / 2, (window.top - window.bottom) / 2
    half_x, half_y = half_x * share, half_y * share
    seen = Window(x - half_x, x + half_x, y - half_y, y + half_y)
    return raster.frame(drawn_m(block), style.axes, seen)


def common_distance_m(blocks: Iterable[Block], style: PictureStyle) -> float:
    """The least distance from the center of each block [m] at which all fit their cells."""
    axes, needed = style.axes, [0.0]
    for block in blocks:
        closest = raster.frame(drawn_m(block), axes, _CELL_WINDOW)
        nearest_m = float(dot(drawn_m(block) - closest.eye_m, axes[2]).min())
        needed.append(nearest_m + _half_depth_m(block, style))
    return max(needed)


def _half_depth_m(block: Block, style: PictureStyle) -> float:
    return float(np.ptp(dot(drawn_m(block), style.axes[2]))) / 2


LEAST_SHARE = 12 / 256**2
"""The least visible area of a block as a share of a goal picture: 48 pixels of 512 by 512."""
LEAST_SHOWN = 0.03
"""The least visible share of a block's own outline in the goal picture of a scene."""
_SEEN_PX = 256


def visible_shares(scene: Scene, style: PictureStyle) -> dict[int, float]:
    """For each block's order, the visible share of the pixels that it covers by itself, 0..1."""
    camera = goal_camera(scene, style)
    together = segments(scene.blocks, camera, style.size_px)
    shares = {}
    for vertex, block in enumerate(scene.blocks):
        alone = segments([block], camera, style.size_px) == 0
        shares[block.order] = float((together[alone] == vertex).sum() / max(alone.sum(), 1))
    return shares


def hidden_blocks(scene: Scene) -> tuple[int, ...]:
    """Orders of the blocks with less than `LEAST_SHARE` visible in the default goal picture."""
    seen = segments(scene.blocks, goal_camera(scene, PictureStyle()), _SEEN_PX)
    counts = np.bincount(seen[seen >= 0], minlength=len(scene))
    least = LEAST_SHARE * _SEEN_PX**2
    return tuple(b.order for b, n in zip(scene.blocks, counts, strict=True) if n < least)


RULED_VERSION, KIT_VERSION = 1, 1
"""Increased whenever the scales, or the sheet, change, so that stored pictures are redrawn."""

_CM = 100.0
_MARGIN_CM = 3.0
_MAJOR_CM = 5
_RULED_WINDOW = Window(-0.93, 0.93, -0.93, 0.93)
_LEAST_DISTANCE_M = 0.45
_LABEL_CM, _NAME_CM = 2.0, 5.0
_MINOR, _MAJOR = 95, 190
_BRIGHT: tuple[Rgb, ...] = ((255, 92, 92), (96, 220, 110), (110, 170, 255))
_DARK: tuple[Rgb, ...] = ((190, 20, 20), (10, 120, 30), (20, 60, 190))
"""Colors of x, y and z on dark floors and on light ones."""
_LIGHT_SUM = 380
_TOP_DEG = 80.0
_GROWTH = 1.5
_TEXT, _MARGIN, _DOT = 0.105, 0.04, 0.035

Point = tuple[float, float, float]


def ruled_png(scene: Scene, style: PictureStyle) -> bytes:
    """PNG of the goal on a ruled floor, in the view of the style; the scene must have a block."""
    return to_png(RuledFloor(scene, style).image(scene.blocks))


def ruled_key(scene: Scene, style: PictureStyle) -> str:
    """SHA-256 [hex] of everything that the picture depends on."""
    return picture_key("ruled goal", style, [RULED_VERSION, *looks(scene.blocks)])


class RuledFloor:
    """The ruled floor of a scene, which must have a block; draws blocks from the goal's camera."""

    def __init__(self, scene: Scene, style: PictureStyle) -> None:
        field = _field(scene.blocks, style)
        self._camera, self._style = _ruled_camera(scene.blocks, field, style), style
        ground = empty_ground(style.background, self._camera, style.size_px)
        size_px, ink = len(ground), GROUNDS[style.background].ink
        rules = _Pen(self._camera, Image.new("L", (size_px, size_px)))
        (x0, x1), (y0, y1) = field.x, field.y
        for is_major in (False, True):
            shade, width = (_MAJOR, 2) if is_major else (_MINOR, 1)
            lines = [((x, y0, 0), (x, y1, 0), x) for x in range(x0, x1 + 1)]
            lines += [((x0, y, 0), (x1, y, 0), y) for y in range(y0, y1 + 1)]
            for start, end, at in lines:
                if (at % _MAJOR_CM == 0) == is_major:
                    rules.line(start, end, shade, width)
        share = np.asarray(rules.image, dtype=np.float32)[..., None] / np.float32(255)
        ruled = ground * (1 - share) + np.array(ink, dtype=np.float32) * share
        written = _Pen(self._camera, Image.fromarray(np.rint(ruled).astype(np.uint8)))
        _write(written, field, ink, has_pole=style.elevation_deg < _TOP_DEG)
        self._ground: NDArray[np.float32] = np.array(written.image, dtype=np.float32)

    def image(self, blocks: Sequence[Block]) -> Image.Image:
        """The blocks on the floor, an RGB image of the style's size."""
        style = self._style
        return picture(blocks, self._camera, style.background, style.size_px, self._ground)


class _Field(NamedTuple):
    """The ruled rectangle [cm], and along x and y its sides next to the camera and far from it."""

    x: tuple[int, int]
    y: tuple[int, int]
    z: int
    near: tuple[int, int]
    far: tuple[int, int]

    def beyond(self, axis: int, by: float) -> float:
        """A place beyond the near side of an axis."""
        return self.near[axis] + math.copysign(by, self.near[axis] - self.far[axis])


def _field(blocks: Sequence[Block], style: PictureStyle) -> _Field:
    points = np.vstack([drawn_m(block) for block in blocks]) * _CM
    low, high = rounded(points.min(axis=0)), rounded(points.max(axis=0))
    first = [math.floor((side - _MARGIN_CM) / _MAJOR_CM) * _MAJOR_CM for side in low]
    last = [math.ceil((side + _MARGIN_CM) / _MAJOR_CM) * _MAJOR_CM for side in high]
    azimuth = math.radians(style.azimuth_deg)
    # The camera is on the side of +x at azimuth 0; beside an axis, either end is suitable.
    x, y = ((first[axis], last[axis]) for axis in (0, 1))
    near_x, near_y = math.cos(azimuth) > -1e-6, math.sin(azimuth) > -1e-6
    top = math.ceil((high[2] + 1) / _MAJOR_CM) * _MAJOR_CM
    return _Field(x, y, top, (x[near_x], y[near_y]), (x[not near_x], y[not near_y]))


def _ruled_camera(blocks: Sequence[Block], field: _Field, style: PictureStyle) -> Camera:
    wide_x, wide_y = field.beyond(0, _NAME_CM + 1), field.beyond(1, _NAME_CM + 1)
    marks = [(x, y, 0.0) for x in (*field.x, wide_x) for y in (*field.y, wide_y)]
    if style.elevation_deg < _TOP_DEG:
        marks.append((*field.far, field.z + 2.0))
    corners = np.array(marks, dtype=np.float64) / _CM
    points = np.vstack([*(drawn_m(block) for block in blocks), corners])
    return raster.frame(points, style.axes, _RULED_WINDOW, _LEAST_DISTANCE_M)


class _Pen:
    """Draws in a square picture at places given in centimeters."""

    def __init__(self, camera: Camera, image: Image.Image) -> None:
        self.image = image
        self._camera, self._size_px = camera, image.width
        self._draw = ImageDraw.Draw(image)

    def along(self, place: Point, by: float) -> Point:
        """The place at a distance to the right of another in the picture, at the same height."""
        right_x, right_y, _ = self._camera.axes[0].tolist()
        return (place[0] + right_x * by, place[1] + right_y * by, place[2])

    def pixel(self, place: Point) -> tuple[float, float]:
        """The pixel of a place."""
        column, row = self._camera.to_pixels(np.array([place]) / _CM, self._size_px)[0]
        return round(float(column), 3), round(float(row), 3)

    def line(self, start: Point, end: Point, ink: int | Rgb, width: int) -> None:
        """A straight line."""
        self._draw.line([self.pixel(start), self.pixel(end)], fill=ink, width=width)

    def text(self, place: Point, text: str, ink: Rgb, size_cm: float) -> None:
        """Draw a text of about this height, but readable, with its center at a place."""
        per_cm = math.dist(self.pixel(place), self.pixel(self.along(place, 1)))
        size = min(max(size_cm * per_cm, 0.024 * self._size_px), 0.05 * self._size_px)
        font = ImageFont.load_default(size=round(size, 2))
        rim = (0, 0, 0) if sum(ink) > _LIGHT_SUM else (255, 255, 255)
        self._draw.text(self.pixel(place), text, ink, font, "mm", stroke_width=2, stroke_fill=rim)


def _write(pen: _Pen, field: _Field, ink: Rgb, *, has_pole: bool) -> None:
    """Draw axes through the origin, names and numbers, and the pole."""
    x_ink, y_ink, z_ink = _DARK if sum(ink) < _LIGHT_SUM else _BRIGHT
    (x0, x1), (y0, y1) = field.x, field.y
    if y0 <= 0 <= y1:
        pen.line((x0, 0, 0), (x1, 0, 0), x_ink, 2 * SUPERSAMPLE)
    if x0 <= 0 <= x1:
        pen.line((0, y0, 0), (0, y1, 0), y_ink, 2 * SUPERSAMPLE)
    beside_y, beside_x = field.beyond(1, _LABEL_CM), field.beyond(0, _LABEL_CM)
    for x in range(x0, x1 + 1, _MAJOR_CM):
        pen.text((x, beside_y, 0), str(x), x_ink if x else ink, 1.9)
    for y in range(y0, y1 + 1, _MAJOR_CM):
        pen.text((beside_x, y, 0), str(y), y_ink if y else ink, 1.9)
    pen.text(((x0 + x1) / 2, field.beyond(1, _NAME_CM), 0), "x", x_ink, 2.8)
    pen.text((field.beyond(0, _NAME_CM), (y0 + y1) / 2, 0), "y", y_ink, 2.8)
    if has_pole:
        x, y = field.far
        pen.line((x, y, 0), (x, y, field.z), z_ink, SUPERSAMPLE)
        for z in range(1, field.z + 1):
            long = 0.9 if z % _MAJOR_CM == 0 else 0.4
            pen.line(pen.along((x, y, z), -long), pen.along((x, y, z), long), z_ink, SUPERSAMPLE)
            if z % _MAJOR_CM == 0:
                pen.text(pen.along((x, y, z), 2.4), str(z), z_ink, 1.9)
        pen.text((x, y, field.z + 1.6), "z", z_ink, 2.2)


def written_style(style: PictureStyle) -> PictureStyle:
    """The style of pictures with text: half as large again, so that it is readable."""
    return replace(style, size_px=min(math.ceil(style.size_px * _GROWTH), LARGEST_PX))


def kit_png(candidates: CandidateSet, style: PictureStyle) -> bytes:
    """PNG of `kit_sheet`."""
    return to_png(kit_sheet(candidates, style))


def kit_sheet(candidates: CandidateSet, style: PictureStyle) -> Image.Image:
    """Every candidate with its number, its dimensions, and a dot at the center of its box."""
    sheet, blocks, distance_m = candidates_grid(candidates, style)
    draw, side = ImageDraw.Draw(sheet), style.size_px / GRID_COLUMNS
    font = ImageFont.load_default(size=_TEXT * side)
    for place, block in enumerate(blocks):
        row, column = divmod(place, GRID_COLUMNS)
        points = drawn_m(block) * _CM
        low, high = points.min(axis=0), points.max(axis=0)
        sides = zip("xyz", (high - low).tolist(), strict=True)
        sizes = (f"{name} {round(side_cm, 1):g}" for name, side_cm in sides)
        left, foot = column * side + _MARGIN * side, row * side + side * (1 - _MARGIN)
        draw.text((left, foot), ", ".join(sizes), GROUNDS[style.background].ink, font, anchor="ls")
        camera, middle = candidate_camera(block, style, distance_m), ((low + high) / 2 / _CM)[None]
        x, y = camera.to_pixels(middle, round(side))[0].tolist()
        x, y = column * side + x, row * side + y
        for radius, fill in ((_DOT * side, "white"), (_DOT * side * 0.6, "black")):
            draw.ellipse((x - radius, y - radius, x + radius, y + radius), fill=fill)
    return sheet


def kit_key(candidates: CandidateSet, style: PictureStyle) -> str:
    """SHA-256 [hex] of everything that the sheet depends on."""
    content = [astuple(candidate) for candidate in candidates.candidates]
    return picture_key("kit", style, [KIT_VERSION, "common", *content])


_STEP_MS, _END_MS = 650, 2200


def assembly_gif(scene: Scene, style: PictureStyle) -> bytes:
    """Return the assembly in the stored order as an animated GIF, which repeats.

    Every frame has the camera of the goal. Raises DataError if that order is not valid.
    """
    camera = goal_camera(scene, style)
    if not scene.graph.is_valid(range(len(scene))):
        message = "places a block before one that it depends on"
        raise DataError(Problem(scene.id, message, "order of blocks"))
    counts, shown = range(1, len(scene) + 1), (camera, style.background, style.size_px)
    images = [picture(scene.blocks[:n], *shown) for n in counts]
    # The palette is made of the first frame, the middle one and the last.
    colorful = Image.fromarray(np.concatenate([images[0], images[len(images) // 2], images[-1]]))
    palette = colorful.quantize(256, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    images = [one.quantize(palette=palette, dither=Image.Dither.NONE) for one in images]
    buffer, times_ms = io.BytesIO(), [_STEP_MS] * (len(images) - 1) + [_END_MS]
    more = {"save_all": True, "append_images": images[1:], "loop": 0, "disposal": 1}
    images[0].save(buffer, "GIF", duration=times_ms, optimize=False, **more)
    return buffer.getvalue()
