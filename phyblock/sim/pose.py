"""Where a block is, as physics knows it: a place and a unit quaternion."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.blocks import Euler, euler_deg_to_quat_xyzw, quat_xyzw_to_matrix
from phyblock.domain.scene import Block

__all__ = ["Pose", "quat_xyzw_to_euler_deg"]

_POSITION_DIGITS = 4
_ANGLE_DIGITS = 2


@dataclass(frozen=True, eq=False)
class Pose:
    """Where a block is: its body frame's origin (3,) [m] and orientation (4,), x y z w."""

    position_m: NDArray[np.float64]
    quat_xyzw: NDArray[np.float64]

    @classmethod
    def goal(cls, block: Block) -> Pose:
        """The pose that the scene gives the block."""
        return cls(np.array(block.position_m), euler_deg_to_quat_xyzw(block.euler_deg))

    def distance_m(self, other: Pose) -> float:
        """Distance between the two origins [m]."""
        return float(np.linalg.norm(self.position_m - other.position_m))

    def angle_deg(self, other: Pose) -> float:
        """Angle of the turn from one orientation to the other [degrees]."""
        cosine = min(1.0, abs(float(self.quat_xyzw @ other.quat_xyzw)))
        return math.degrees(2 * math.acos(cosine))

    def put(self, block: Block) -> Block:
        """The block put here, its place and angles rounded to 0.1 mm and 0.01 degrees."""
        x, y, z = (round(float(place), _POSITION_DIGITS) + 0.0 for place in self.position_m)
        euler = quat_xyzw_to_euler_deg(self.quat_xyzw)
        a, b, c = (round(angle, _ANGLE_DIGITS) + 0.0 for angle in euler)
        return replace(block, position_m=(x, y, z), euler_deg=(a, b, c))


def quat_xyzw_to_euler_deg(quat_xyzw: NDArray[np.float64]) -> Euler:
    """Extrinsic x-y-z angles [degrees] of a unit quaternion (x, y, z, w)."""
    rotation = quat_xyzw_to_matrix(quat_xyzw)
    pitch = np.arcsin(np.clip(-rotation[2, 0], -1.0, 1.0))
    if abs(rotation[2, 0]) > 1 - 1e-9:
        roll, yaw = 0.0, np.arctan2(-rotation[0, 1], rotation[1, 1])
    else:
        roll = np.arctan2(rotation[2, 1], rotation[2, 2])
        yaw = np.arctan2(rotation[1, 0], rotation[0, 0])
    x, y, z = (float(np.degrees(angle)) for angle in (roll, pitch, yaw))
    return (x, y, z)
