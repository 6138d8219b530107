"""The block library: one row per shape, colors, material, symmetries, and the Euler conversion.

Eight types in five colors (paper, appendix A.1), base unit 5 cm. A block is a prism: a flat profile
extruded along an axis of its body frame. Meshes and convex pieces (`phyblock.sim.geometry`), mass,
symmetries, poses of designs and names in questions follow from the row of its shape in `SHAPES`.
Boxes and the cylinder are centered in their frames, the semi-cylinder and the triangle have their
origin at the center of the flat (hypotenuse) face, the arch at the center of its bounding box.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import permutations, product
from typing import Literal, cast, get_args

import numpy as np
from numpy.typing import NDArray

from phyblock.text import plain_sum

BlockType = Literal[
    "arch", "cube", "cuboid1", "cuboid2", "cuboid3", "cylinder", "semi_cylinder", "triangle"
]
Color = Literal["red", "yellow", "blue", "green", "orange"]
Euler = tuple[float, float, float]
Outline = NDArray[np.float64]  # Corners of a polygon, shape (n, 2) [m], counter-clockwise.

BLOCK_TYPES: list[BlockType] = [*get_args(BlockType)]
"""Those of the paper, then those that plugins add."""
COLORS: tuple[Color, ...] = get_args(Color)

DENSITY_KG_M3 = 1040.0  # ABS plastic, paper appendix A.1.
FRICTION = 0.35  # Coulomb coefficient of a pair of blocks, paper appendix A.1.
_LONG = 1.5  # A block is long if its longest side is more than this many times the second longest.
_MOST_SEEN_TURNS = 8  # In a prism with more sides, a turn by one side can hardly be seen.


@dataclass(frozen=True, eq=False)
class Profile:
    """The cross-section of a prism: its outline, area [m2] and centroid [m].

    `parts` are convex outlines that together fill it; `caps` triangulates it, as indices.
    """

    outline: Outline
    area_m2: float
    centroid_m: tuple[float, float]
    parts: tuple[Outline, ...]
    caps: tuple[tuple[int, int, int], ...]


def polygon(
    outline: Outline, area_m2: float | None = None, centroid_m: tuple[float, float] | None = None
) -> Profile:
    """A convex profile; area and centroid follow from the outline unless they are given."""
    if area_m2 is None or centroid_m is None:
        after = np.roll(outline, -1, axis=0)
        twice = outline[:, 0] * after[:, 1] - after[:, 0] * outline[:, 1]
        area_m2 = plain_sum(twice.tolist()) / 2
        u, v = (plain_sum(each.tolist()) for each in ((outline + after) * twice[:, None]).T)
        centroid_m = (u / (6 * area_m2), v / (6 * area_m2))
    fan = tuple((0, i, i + 1) for i in range(1, len(outline) - 1))
    return Profile(outline, area_m2, centroid_m, (outline,), fan)


def _rectangle(u_m: float, v_m: float) -> Profile:
    u, v = u_m / 2, v_m / 2
    return polygon(np.array([[u, v], [-u, v], [-u, -v], [u, -v]]), u_m * v_m, (0.0, 0.0))


def _disc(radius_m: float, facets: int) -> Profile:
    angles = np.radians(np.arange(facets) * (360 / facets))
    corners = radius_m * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    area_m2 = 0.5 * facets * radius_m**2 * math.sin(2 * math.pi / facets)
    return polygon(corners, area_m2, (0.0, 0.0))


def _half_disc(radius_m: float, segments: int) -> Profile:
    """Half a disc above the first axis, its arc from angle 0 to 180 degrees."""
    angles, step = np.linspace(0.0, math.pi, segments + 1), math.pi / segments
    corners = np.stack([radius_m * np.cos(angles), radius_m * np.sin(angles)], axis=1)
    area_m2 = 0.5 * segments * radius_m**2 * math.sin(step)
    moment = plain_sum(
        (math.sin(i * step) + math.sin((i + 1) * step)) * radius_m / 3 for i in range(segments)
    ) * (0.5 * radius_m**2 * math.sin(step))
    return polygon(corners, area_m2, (0.0, moment / area_m2))


def _right_triangle(leg_m: float) -> Profile:
    """A right triangle on its hypotenuse."""
    half_m = leg_m / math.sqrt(2)
    corners = np.array([[half_m, 0.0], [0.0, half_m], [-half_m, 0.0]])
    return polygon(corners, 0.5 * leg_m**2, (0.0, half_m / 3))


def _gate(width_m: float, height_m: float, radius_m: float, segments: int) -> Profile:
    """A rectangle with half a disc cut out of its base.

    Its parts are two legs, each with an end segment of the arc, and a slice for each other one.
    """
    half_u, half_v = width_m / 2, height_m / 2
    hole = _half_disc(radius_m, segments)
    area_m2 = width_m * height_m - hole.area_m2
    center_v = -hole.area_m2 * (hole.centroid_m[1] - half_v) / area_m2
    arc = hole.outline - [0.0, half_v]
    right_foot, right_top = [half_u, -half_v], [half_u, half_v]
    left_foot, left_top = [-half_u, -half_v], [-half_u, half_v]
    outline = np.array([*arc[::-1], right_foot, right_top, left_top, left_foot])
    right_leg = np.array([arc[0], right_foot, right_top, [arc[1, 0], half_v], arc[1]])
    left_leg = np.array([arc[-1], arc[-2], [arc[-2, 0], half_v], left_top, left_foot])
    slices = [
        np.array([arc[i], [arc[i, 0], half_v], [arc[i + 1, 0], half_v], arc[i + 1]])
        for i in range(1, segments - 1)
    ]
    middle, last = segments // 2, segments
    foot_right, top_right, top_left, foot_left = range(last + 1, last + 5)
    caps = [(foot_left, 0, top_left), (last, foot_right, top_right), (middle, top_right, top_left)]
    caps += [(top_left, i, i + 1) for i in range(middle)]
    caps += [(top_right, i, i + 1) for i in range(middle, last)]
    return Profile(outline, area_m2, (0.0, center_v), (right_leg, *slices, left_leg), tuple(caps))


@dataclass(frozen=True)
class Shape:
    """A type of block.

    `profile` is extruded by half of `length_m` to both sides along the body axis `axis`: for x it
    lies in the y-z plane, for z in the x-y plane. `fold` is the order of the rotational symmetry
    about the body z axis, and `flips` is true where half turns about axes in the x-y plane map the
    block to itself; every block is its own mirror image in x = 0. `kit_colors` are its colors in
    the official kit, the first the one that designs use. `poses` are those that designs use, by
    name, the first by default. `word` is the paper's (appendix A.4). `mistaken_for` are types that
    a half-hidden one may be taken for. `drawn` is a finer profile for pictures of round blocks.
    """

    profile: Profile
    axis: Literal["x", "z"]
    length_m: float
    fold: int
    flips: bool
    kit_colors: tuple[Color, ...]
    poses: Mapping[str, Euler]
    word: str
    mistaken_for: tuple[BlockType, ...] = ()
    drawn: Profile | None = None
    low_m: tuple[float, float, float] = field(init=False)
    high_m: tuple[float, float, float] = field(init=False)

    def __post_init__(self) -> None:
        if not self.kit_colors:
            raise ValueError("a shape needs a color of the kit, which designs use")
        low, high = self.profile.outline.min(axis=0), self.profile.outline.max(axis=0)
        # The ends of a disc mirror one another up to rounding.
        low = np.where(np.isclose(-low, high, rtol=1e-12), -high, low)
        half_m = self.length_m / 2
        object.__setattr__(self, "low_m", self._in_body(low.tolist(), -half_m))
        object.__setattr__(self, "high_m", self._in_body(high.tolist(), half_m))

    def _in_body(self, across: Sequence[float], along: float) -> tuple[float, float, float]:
        u, v = across
        return (along, u, v) if self.axis == "x" else (u, v, along)

    @functools.cached_property
    def volume_m3(self) -> float:
        """Volume of the solid [m3]."""
        return self.profile.area_m2 * self.length_m

    @functools.cached_property
    def center_of_mass_m(self) -> tuple[float, float, float]:
        """Centroid of the solid [m]."""
        return self._in_body(self.profile.centroid_m, 0.0)

    @property
    def mass_kg(self) -> float:
        """Mass in ABS plastic [kg]."""
        return self.volume_m3 * DENSITY_KG_M3

    @property
    def sides_m(self) -> tuple[float, float, float]:
        """Size of the bounding box along the body axes [m]."""
        x, y, z = (high - low for low, high in zip(self.low_m, self.high_m, strict=True))
        return (x, y, z)

    @property
    def is_box(self) -> bool:
        """True if the solid fills its bounding box."""
        return math.isclose(self.volume_m3, math.prod(self.sides_m))

    @property
    def is_round(self) -> bool:
        """True if turns about the body z axis can hardly be seen."""
        return self.fold > _MOST_SEEN_TURNS

    @property
    def is_long(self) -> bool:
        """True if one side is by far the longest, and turns about it can be seen."""
        _, second, longest = sorted(self.sides_m)
        return longest > _LONG * second and not self.is_round


def _turns(*names: str, roll: float = 0.0, pitch: float = 0.0) -> dict[str, Euler]:
    """One pose and its quarter turns about the vertical, one for each name."""
    return {name: (roll, pitch, 90.0 * turn) for turn, name in enumerate(names)}


_EDGE = _turns("edge-x", "edge-y", roll=90.0)
_SLAB = {**_turns("flat-x", "flat-y"), **_EDGE, **_turns("upright-x", "upright-y", pitch=90.0)}

SHAPES: dict[BlockType, Shape] = {
    "arch": Shape(
        profile=_gate(0.1, 0.05, 0.0375, 10),
        drawn=_gate(0.1, 0.05, 0.0375, 36),
        axis="x",
        length_m=0.05,
        fold=2,
        flips=False,
        kit_colors=("red",),
        word="arch",
        poses={
            **_turns("gate", "gate-turned"),
            **_turns("cradle", "cradle-turned", pitch=180.0),
            **_turns("open+y", "open-x", "open-y", "open+x", roll=90.0),
        },
    ),
    "cube": Shape(
        profile=_rectangle(0.05, 0.05),
        axis="z",
        length_m=0.05,
        fold=4,
        flips=True,
        kit_colors=("red", "blue", "green", "orange", "yellow"),
        word="cube",
        mistaken_for=("cuboid1",),
        poses=_turns("flat"),
    ),
    "cuboid1": Shape(
        profile=_rectangle(0.05, 0.05),
        axis="z",
        length_m=0.025,
        fold=4,
        flips=True,
        kit_colors=("blue",),
        word="rectangular prism",
        mistaken_for=("cube",),
        poses={**_turns("flat"), **_EDGE},
    ),
    "cuboid2": Shape(
        profile=_rectangle(0.1, 0.05),
        axis="z",
        length_m=0.025,
        fold=2,
        flips=True,
        kit_colors=("green",),
        word="rectangular prism",
        poses=_SLAB,
    ),
    "cuboid3": Shape(
        profile=_rectangle(0.15, 0.05),
        axis="z",
        length_m=0.025,
        fold=2,
        flips=True,
        kit_colors=("yellow",),
        word="rectangular prism",
        poses=_SLAB,
    ),
    "cylinder": Shape(
        profile=_disc(0.025, 18),
        drawn=_disc(0.025, 72),
        axis="z",
        length_m=0.1,
        fold=18,
        flips=True,
        kit_colors=("orange",),
        word="cylinder",
        mistaken_for=("semi_cylinder",),
        poses={**_turns("upright"), "lying-x": (90.0, 0.0, 90.0), "lying-y": (90.0, 0.0, 0.0)},
    ),
    "semi_cylinder": Shape(
        profile=_half_disc(0.025, 10),
        drawn=_half_disc(0.025, 36),
        axis="x",
        length_m=0.05,
        fold=2,
        flips=False,
        kit_colors=("yellow",),
        word="half cylinder",
        mistaken_for=("cylinder",),
        poses={
            **_turns("dome", "dome-turned"),
            **_turns("bowl", "bowl-turned", roll=180.0),
            **_turns("round+x", "round+y", "round-x", "round-y", pitch=90.0),
        },
    ),
    "triangle": Shape(
        profile=_right_triangle(0.05),
        axis="x",
        length_m=0.05,
        fold=2,
        flips=False,
        kit_colors=("orange",),
        word="triangular prism",
        poses={
            **_turns("roof", "roof-turned"),
            **_turns("ramp+y", "ramp-x", "ramp-y", "ramp+x", roll=135.0),
            **_turns("wedge+x", "wedge+y", "wedge-x", "wedge-y", roll=-135.0, pitch=90.0),
        },
    ),
}
"""The shapes by type. A `ramp+y` slopes down towards +y, a `round+x` has its round side towards +x,
an arch that is `open+y` stands on one end with its hole towards +y. `x` and `y` name the direction
of the long side, and for `upright` slabs that of the thin side."""


def add_shape(name: str, shape: Shape) -> None:
    """Add a type of block. Raises ValueError if the name is taken."""
    if name in SHAPES:
        raise ValueError(f"there is a shape of this name: {name}")
    SHAPES[cast(BlockType, name)] = shape
    BLOCK_TYPES.append(cast(BlockType, name))


KIT_PALETTE: tuple[tuple[BlockType, Color], ...] = tuple(
    sorted((name, color) for name, shape in SHAPES.items() for color in shape.kit_colors)
)
"""The pairs of type and color of the official kit."""


def euler_deg_to_quat_xyzw(euler_deg: Euler) -> NDArray[np.float64]:
    """Quaternion (x, y, z, w), shape (4,), of extrinsic x-y-z Euler angles in degrees.

    R = Rz @ Ry @ Rx, scipy's `'xyz'`: the order under which the official scenes fit together.
    """
    roll, pitch, yaw = (math.radians(angle) / 2 for angle in euler_deg)
    sr, cr = math.sin(roll), math.cos(roll)
    sp, cp = math.sin(pitch), math.cos(pitch)
    sy, cy = math.sin(yaw), math.cos(yaw)
    return np.array(
        [
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        ]
    )


def quat_xyzw_to_matrix(quat_xyzw: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation matrix, shape (3, 3), body to world, of a unit quaternion (x, y, z, w)."""
    x, y, z, w = quat_xyzw
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def euler_deg_to_matrix(euler_deg: Euler) -> NDArray[np.float64]:
    """Rotation matrix, shape (3, 3), body to world, of extrinsic x-y-z Euler angles in degrees."""
    return quat_xyzw_to_matrix(euler_deg_to_quat_xyzw(euler_deg))


@functools.cache
def symmetries(block_type: BlockType) -> NDArray[np.float64]:
    """Rotations that map the block onto itself, body frame, shape (k, 3, 3)."""
    shape = SHAPES[block_type]
    if shape.is_box and len(set(shape.sides_m)) == 1:
        # A cube has more symmetries than `fold` says.
        rotations = []
        for axes, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
            matrix = np.zeros((3, 3))
            matrix[range(3), axes] = signs
            if np.linalg.det(matrix) > 0:
                rotations.append(matrix)
        return np.stack(rotations)
    turns = [euler_deg_to_matrix((0.0, 0.0, 360.0 * i / shape.fold)) for i in range(shape.fold)]
    if shape.flips:
        # Every block is its own mirror image in x = 0: without the half turn about z, the one about
        # y is a symmetry.
        half_turn = [1.0, -1.0, -1.0] if shape.fold % 2 == 0 else [-1.0, 1.0, -1.0]
        turns += [turn @ np.diag(half_turn) for turn in turns]
    return np.stack(turns)


@functools.cache
def orientation_class(block_type: BlockType, euler_deg: Euler) -> tuple[float, ...]:
    """Canonical name of an orientation: equal for two orientations in which the block looks equal.

    The least nine matrix entries (rounded to 1e-4) of all rotations that look like the given one.
    """
    equivalent = np.round(euler_deg_to_matrix(euler_deg) @ symmetries(block_type), 4) + 0.0
    return min(tuple(float(entry) for entry in matrix.ravel()) for matrix in equivalent)


def turn_deg(block_type: BlockType, one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """The least angle [degrees] between two rotations (3, 3) of a block, up to its symmetry."""
    cosines = (np.einsum("kij,ij->k", one @ symmetries(block_type), other) - 1) / 2
    return math.degrees(math.acos(min(1.0, max(-1.0, float(cosines.max())))))
