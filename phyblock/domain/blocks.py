"""The block library: types, colors, sizes, symmetries, mass, and the one Euler conversion.

Eight types in five colors (paper, appendix A.1), base unit 5 cm. Body frames are fixed here and
used by the geometry in `phyblock.sim`: boxes and the cylinder are centered, the semi-cylinder and
the triangle have their origin at the center of the flat (hypotenuse) face, the arch at the center
of its bounding box.
"""

from __future__ import annotations

import functools
import itertools
import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from phyblock.stable import plain_sum

__all__ = [
    "BLOCK_TYPES",
    "COLORS",
    "DENSITY_KG_M3",
    "FRICTION",
    "KIT_PALETTE",
    "SHAPES",
    "BlockType",
    "Color",
    "Euler",
    "Shape",
    "euler_deg_to_matrix",
    "euler_deg_to_quat_xyzw",
    "orientation_class",
    "quat_xyzw_to_matrix",
    "symmetries",
    "turn_deg",
]

BlockType = Literal[
    "arch", "cube", "cuboid1", "cuboid2", "cuboid3", "cylinder", "semi_cylinder", "triangle"
]
Color = Literal["red", "yellow", "blue", "green", "orange"]
Euler = tuple[float, float, float]

BLOCK_TYPES: tuple[BlockType, ...] = get_args(BlockType)
COLORS: tuple[Color, ...] = get_args(Color)

DENSITY_KG_M3 = 1040.0
"""ABS plastic, paper appendix A.1."""
FRICTION = 0.35
"""Coulomb coefficient of a pair of blocks, paper appendix A.1."""


@dataclass(frozen=True)
class Shape:
    """A type of block: its colors in the official kit, and its solid in the body frame.

    `low_m` and `high_m` are the corners of the bounding box [m]; `volume_m3` the solid's volume;
    `center_of_mass_m` its centroid [m]; `fold` the order of the rotational symmetry about the
    body z axis, and `flips` whether half turns about axes in the x-y plane map it to itself. What
    else rules ask of a shape follows from these.
    """

    low_m: tuple[float, float, float]
    high_m: tuple[float, float, float]
    volume_m3: float
    center_of_mass_m: tuple[float, float, float]
    fold: int
    flips: bool
    kit_colors: tuple[Color, ...]
    """The first is the one that designs use; ValueError where there is none."""

    def __post_init__(self) -> None:
        if not self.kit_colors:
            raise ValueError("a shape needs a color of the kit, which designs use")

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
        """Whether the solid fills its bounding box."""
        return math.isclose(self.volume_m3, math.prod(self.sides_m))

    @property
    def is_cube(self) -> bool:
        """Whether it is a box with equal sides, which has more symmetries than `fold` says."""
        return self.is_box and len(set(self.sides_m)) == 1

    @property
    def is_round(self) -> bool:
        """Whether turns about the body z axis can hardly be seen."""
        return self.fold > _MOST_SEEN_TURNS

    @property
    def is_long(self) -> bool:
        """Whether one side is by far the longest, and turns about it can be seen."""
        _, second, longest = sorted(self.sides_m)
        return longest > _LONG * second and not self.is_round


_LONG = 1.5
"""The longest side of a long block is more than so many times the second."""
_MOST_SEEN_TURNS = 8
"""Of a prism with more sides, a turn by one side can hardly be seen."""
_FACETS = 18
_CYLINDER_RADIUS_M = 0.025
_CYLINDER_AREA_M2 = 0.5 * _FACETS * _CYLINDER_RADIUS_M**2 * math.sin(2 * math.pi / _FACETS)


def _half_disc(radius_m: float, segments: int) -> tuple[float, float]:
    """Area [m2] and centroid height above the diameter [m] of a half disc of `segments` chords."""
    step = math.pi / segments
    area = 0.5 * segments * radius_m**2 * math.sin(step)
    moment = plain_sum(
        (math.sin(i * step) + math.sin((i + 1) * step)) * radius_m / 3 for i in range(segments)
    ) * (0.5 * radius_m**2 * math.sin(step))
    return area, moment / area


def _box(x_m: float, y_m: float, z_m: float, *kit_colors: Color) -> Shape:
    half = (x_m / 2, y_m / 2, z_m / 2)
    low = (-half[0], -half[1], -half[2])
    fold = 4 if x_m == y_m else 2
    return Shape(low, half, x_m * y_m * z_m, (0.0, 0.0, 0.0), fold, True, kit_colors)


def _arch(*kit_colors: Color) -> Shape:
    hole_m2, hole_z_m = _half_disc(0.0375, 10)
    solid_m2 = 0.1 * 0.05
    area_m2 = solid_m2 - hole_m2
    center = (0.0, 0.0, -hole_m2 * (hole_z_m - 0.025) / area_m2)
    half = (0.025, 0.05, 0.025)
    return Shape((-0.025, -0.05, -0.025), half, area_m2 * 0.05, center, 2, False, kit_colors)


def _semi_cylinder(*kit_colors: Color) -> Shape:
    area_m2, center_z_m = _half_disc(0.025, 10)
    center = (0.0, 0.0, center_z_m)
    high = (0.025, 0.025, 0.025)
    return Shape((-0.025, -0.025, 0.0), high, area_m2 * 0.05, center, 2, False, kit_colors)


def _triangle(*kit_colors: Color) -> Shape:
    leg_m = 0.05
    half_m = leg_m / math.sqrt(2)
    volume_m3 = 0.5 * leg_m**2 * 0.05
    center = (0.0, 0.0, half_m / 3)
    low, high = (-0.025, -half_m, 0.0), (0.025, half_m, half_m)
    return Shape(low, high, volume_m3, center, 2, False, kit_colors)


def _cylinder(*kit_colors: Color) -> Shape:
    y_m = _CYLINDER_RADIUS_M * math.sin(math.radians(80))
    low, high = (-_CYLINDER_RADIUS_M, -y_m, -0.05), (_CYLINDER_RADIUS_M, y_m, 0.05)
    center = (0.0, 0.0, 0.0)
    return Shape(low, high, _CYLINDER_AREA_M2 * 0.1, center, _FACETS, True, kit_colors)


SHAPES: dict[BlockType, Shape] = {
    "arch": _arch("red"),
    "cube": _box(0.05, 0.05, 0.05, "red", "blue", "green", "orange", "yellow"),
    "cuboid1": _box(0.05, 0.05, 0.025, "blue"),
    "cuboid2": _box(0.1, 0.05, 0.025, "green"),
    "cuboid3": _box(0.15, 0.05, 0.025, "yellow"),
    "cylinder": _cylinder("orange"),
    "semi_cylinder": _semi_cylinder("yellow"),
    "triangle": _triangle("orange"),
}

KIT_PALETTE: tuple[tuple[BlockType, Color], ...] = tuple(
    sorted(
        (block_type, color) for block_type, shape in SHAPES.items() for color in shape.kit_colors
    )
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
    if shape.is_cube:
        return _cube_rotations()
    turns = [_turn_z(360.0 * i / shape.fold) for i in range(shape.fold)]
    if shape.flips:
        # Every block mirrors in x = 0: where half a turn about z is none, that is one about y.
        half_turn = [1.0, -1.0, -1.0] if shape.fold % 2 == 0 else [-1.0, 1.0, -1.0]
        turns += [turn @ np.diag(half_turn) for turn in turns]
    return np.stack(turns)


def _turn_z(angle_deg: float) -> NDArray[np.float64]:
    return euler_deg_to_matrix((0.0, 0.0, angle_deg))


def _cube_rotations() -> NDArray[np.float64]:
    rotations = []
    for axes in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            matrix = np.zeros((3, 3))
            matrix[range(3), axes] = signs
            if np.linalg.det(matrix) > 0:
                rotations.append(matrix)
    return np.stack(rotations)


@functools.cache
def orientation_class(block_type: BlockType, euler_deg: Euler) -> tuple[float, ...]:
    """Canonical name of an orientation up to the block's own symmetry: equal if they look equal.

    The least, in lexicographic order, of the nine matrix entries (rounded to 1e-4) over all
    rotations that are indistinguishable from the given one.
    """
    rotation = euler_deg_to_matrix(euler_deg)
    alike = np.round(rotation @ symmetries(block_type), 4) + 0.0
    return min(tuple(float(entry) for entry in matrix.ravel()) for matrix in alike)


def turn_deg(block_type: BlockType, one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """The least angle [degrees] by which a block is to be turned from one rotation (3, 3) to what
    looks like the other.
    """
    alike = one @ symmetries(block_type)
    cosines = (np.einsum("kij,ij->k", alike, other) - 1) / 2
    return math.degrees(math.acos(min(1.0, max(-1.0, float(cosines.max())))))
