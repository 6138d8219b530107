"""Physics engines behind one class, in terms of blocks on a floor, and the choice of one.

The floor is the plane z = 0; poses are those of body frames. PyBullet is used if it is installed,
else MuJoCo; the environment variable `PHYBLOCK_PHYSICS` chooses by name.
"""

from __future__ import annotations

import functools
import importlib
import importlib.metadata
import math
import os
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib.util import find_spec
from typing import ClassVar, NamedTuple, Self, cast

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.blocks import (
    FRICTION,
    SHAPES,
    BlockType,
    Euler,
    euler_deg_to_quat_xyzw,
    quat_xyzw_to_matrix,
)
from phyblock.domain.scene import Block
from phyblock.errors import InputError, Problem
from phyblock.sim.geometry import rounded, significant

Vector = tuple[float, float, float]  # x, y and z in the world.
GRAVITY_M_S2 = 9.81
_POSITION_DIGITS = 4
_ANGLE_DIGITS = 2


@dataclass(frozen=True, eq=False)
class Pose:
    """Origin (3,) [m] of a block's body frame, and its orientation (4,), a quaternion x y z w."""

    position_m: NDArray[np.float64]
    quat_xyzw: NDArray[np.float64]

    @classmethod
    def goal(cls, block: Block) -> Pose:
        """The goal pose of the block."""
        return cls(np.array(block.position_m), euler_deg_to_quat_xyzw(block.euler_deg))

    def distance_m(self, other: Pose) -> float:
        """Distance between the two origins [m]."""
        return float(np.linalg.norm(self.position_m - other.position_m))

    def angle_deg(self, other: Pose) -> float:
        """Angle of the turn from one orientation to the other [degrees]."""
        cosine = min(1.0, abs(float(self.quat_xyzw @ other.quat_xyzw)))
        return math.degrees(2 * math.acos(cosine))

    def put(self, block: Block) -> Block:
        """The block at this pose, with place and angles rounded to 0.1 mm and 0.01 degrees."""
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
    return float(np.degrees(roll)), float(np.degrees(pitch)), float(np.degrees(yaw))


@dataclass(frozen=True)
class Physics:
    """Settings of a simulation.

    Time step [s], iterations of the contact solver per step, friction coefficient of any two
    touching bodies, gravity [m/s2], and factors of the mass of blocks by type.
    """

    time_step_s: float = 1 / 240
    iterations: int = 50
    friction: float = FRICTION
    gravity_m_s2: Vector = (0.0, 0.0, -GRAVITY_M_S2)
    mass_factors: tuple[tuple[BlockType, float], ...] = ()

    def mass_kg(self, block_type: BlockType) -> float:
        """Mass of a block of this type [kg]."""
        factor = dict(self.mass_factors).get(block_type, 1.0)
        return significant(SHAPES[block_type].mass_kg * factor)


class World(ABC):
    """Rigid blocks on a floor, by their order; a context manager.

    Each physics engine is a subclass. Any number of worlds may be open at once, and the same calls
    on one machine give the same bits. Raises SimulationError if it cannot be opened.
    """

    name: ClassVar[str]
    """The engine's name in `ENGINES`, and in the files of runs."""

    def __init__(self, physics: Physics) -> None:
        self.physics = physics
        self._blocks: dict[int, Block] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:  # noqa: B027
        """Free what the engine holds for this world."""

    def place(self, *blocks: Block) -> None:
        """Put blocks at their goal poses, at rest, rounded to digits that machines agree on."""
        for block in blocks:
            goal = Pose.goal(block)
            self._add(block, Pose(rounded(goal.position_m), rounded(goal.quat_xyzw)))
            self._blocks[block.order] = block

    def remove(self, order: int) -> None:
        """Remove a block."""
        self._remove(order)
        del self._blocks[order]

    def step(self, duration_s: float) -> None:
        """Simulate for `duration_s` [s], rounded to whole time steps."""
        self._step(round(duration_s / self.physics.time_step_s))

    def fastest_m_s(self) -> float:
        """Upper bound of the speed of the fastest corner [m/s]; 0 in an empty world."""
        fastest = 0.0
        for order, block in self._blocks.items():
            shape, (linear_m_s, angular_rad_s) = SHAPES[block.type], self.velocity(order)
            reach_m = math.dist(shape.low_m, shape.high_m)
            fastest = max(fastest, math.hypot(*linear_m_s) + math.hypot(*angular_rad_s) * reach_m)
        return fastest

    def poses(self) -> dict[int, Pose]:
        """Return the current poses of all blocks, by order."""
        return {order: self.pose(order) for order in self._blocks}

    @abstractmethod
    def pose(self, order: int) -> Pose:
        """Return the current pose of a block."""

    @abstractmethod
    def velocity(self, order: int) -> tuple[Vector, Vector]:
        """Return the velocity of a block's center of mass [m/s], and its angular one [rad/s]."""

    @abstractmethod
    def _add(self, block: Block, pose: Pose) -> None:
        """Add a block at a pose, at rest."""

    @abstractmethod
    def _remove(self, order: int) -> None:
        """Remove a block."""

    @abstractmethod
    def _step(self, n: int) -> None:
        """Simulate `n` time steps."""


PhysicsEngine = type[World]  # The class of an engine's worlds.
PHYSICS_VARIABLE = "PHYBLOCK_PHYSICS"
REFERENCE_ENGINE = "pybullet"
"""The engine of the built-in data, and of records that name no engine."""


class KnownEngine(NamedTuple):
    """The subclass of `World` in the module of its name, its distribution, and install hint."""

    world: str
    distribution: str
    hint: str


ENGINES: Mapping[str, KnownEngine] = {
    REFERENCE_ENGINE: KnownEngine(
        "BulletWorld", "pybullet", "PyBullet has wheels for Python 3.11 on Linux, x86-64"
    ),
    "mujoco": KnownEngine(
        "MujocoWorld", "mujoco-core", "pip install 'phyblock[mujoco]', for Python 3.11 and newer"
    ),
}
"""The physics engines by the names of their libraries; the first installed is the default."""


def installed_engines() -> tuple[str, ...]:
    """Return the names of engines whose libraries are installed; nothing is imported."""
    return tuple(name for name in ENGINES if find_spec(name) is not None)


def physics_engine() -> PhysicsEngine:
    """Return the engine of `PHYBLOCK_PHYSICS`, or the default. Raises InputError if missing."""
    name = os.environ.get(PHYSICS_VARIABLE, next(iter(installed_engines()), REFERENCE_ENGINE))
    if name not in ENGINES:
        allowed = ", ".join(ENGINES)
        raise InputError(Problem(PHYSICS_VARIABLE, "is not known", found=name, allowed=allowed))
    if name not in installed_engines():
        hint = ENGINES[name].hint
        raise InputError(Problem(PHYSICS_VARIABLE, "is not installed", found=name, hint=hint))
    module = importlib.import_module(f"phyblock.sim.{name}")
    return cast(PhysicsEngine, getattr(module, ENGINES[name].world))


def open_world(physics: Physics | None = None, engine: PhysicsEngine | None = None) -> World:
    """Open a floor without blocks in an engine, by default the one in use."""
    return (engine or physics_engine())(physics or Physics())


def described_engine() -> str:
    """Return the engine in use and its version, `pybullet 3.2.7`; raises as `physics_engine`."""
    name = physics_engine().name
    return f"{name} {engine_version(name)}"


@functools.cache
def engine_version(name: str) -> str:
    """The installed version of an engine's library."""
    try:
        return importlib.metadata.version(ENGINES[name].distribution)
    except importlib.metadata.PackageNotFoundError:  # Some builds have another name.
        return importlib.metadata.version(name)


def other_engine() -> str:
    """Return the engine in use, for messages, or "" if it is that of the built-in data."""
    is_usual = physics_engine().name == REFERENCE_ENGINE
    return "" if is_usual else f"the physics engine {described_engine()}"
