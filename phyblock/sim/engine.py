"""What `sim` asks of a physics engine: two protocols, in terms of blocks on a floor.

A `PhysicsEngine` opens simulations; a `Simulation` holds blocks and moves them. The floor is the
plane z = 0. Blocks are named by number, and `FLOOR` (0) stands for the floor; the caller names
only blocks that are there. Poses are those of body frames (`phyblock.domain.blocks`). What a
block is made of, an engine finds in `SHAPES` (center of mass), in `Physics.mass_kg` and in
`phyblock.sim.geometry` (`collision_pieces`, `solid_mesh` with its inertia).

To add an engine: write a module with a class that follows `PhysicsEngine`, name it in
`phyblock.sim.registry`, and let `tests/sim/test_engine_laws.py` tell what it lacks.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import NamedTuple, Protocol, runtime_checkable

from phyblock.domain.blocks import FRICTION, SHAPES, BlockType
from phyblock.sim.pose import Pose

__all__ = [
    "FLOOR",
    "GRAVITY_M_S2",
    "Contact",
    "Physics",
    "PhysicsEngine",
    "Simulation",
    "Vector",
    "Velocity",
]

Vector = tuple[float, float, float]
"""x, y and z in the world."""
FLOOR = 0
"""The floor's number among the blocks."""
GRAVITY_M_S2 = 9.81


@dataclass(frozen=True)
class Physics:
    """Settings of a simulation.

    Time step [s], iterations of the contact solver in each step, friction coefficient of any two
    bodies that touch, and gravity [m/s2], which is not straight down where the floor is to lean.
    `mass_factors` names types of which every block has so many times its mass in plastic.
    """

    time_step_s: float = 1 / 240
    iterations: int = 50
    friction: float = FRICTION
    gravity_m_s2: Vector = (0.0, 0.0, -GRAVITY_M_S2)
    mass_factors: tuple[tuple[BlockType, float], ...] = ()

    def mass_kg(self, block_type: BlockType) -> float:
        """Mass of a block of this type [kg]."""
        return SHAPES[block_type].mass_kg * dict(self.mass_factors).get(block_type, 1.0)


class Velocity(NamedTuple):
    """How a block moves: velocity of its center of mass [m/s], and its spin [rad/s]."""

    linear_m_s: Vector
    angular_rad_s: Vector


class Contact(NamedTuple):
    """A point where two bodies touch: their numbers, `first` below `second`.

    `normal` is a unit vector from the first to the second; `distance_m` is how far apart they are
    there [m], negative where they overlap.
    """

    first: int
    second: int
    normal: Vector
    distance_m: float


class Simulation(Protocol):
    """Rigid blocks on a floor.

    The same calls on the same machine give the same bits, whatever other simulations are open.
    """

    def add(self, number: int, block_type: BlockType, pose: Pose) -> None:
        """Put a block at a pose, at rest; its number is above 0 and not taken."""

    def remove(self, number: int) -> None:
        """Take a block out."""

    def step(self, n: int) -> None:
        """Simulate `n` time steps."""

    def pose(self, number: int) -> Pose:
        """Where a block is now."""

    def velocity(self, number: int) -> Velocity:
        """How a block moves now."""

    def set_velocity(self, number: int, velocity: Velocity) -> None:
        """Set how a block moves from now on, as far as contacts and gravity let it."""

    def contacts(self) -> tuple[Contact, ...]:
        """List where bodies touched in the last time step; empty before the first step."""


@runtime_checkable
class PhysicsEngine(Protocol):
    """A way to simulate; any number of its simulations may be open at once."""

    def __hash__(self) -> int:
        """Results are kept by engine."""

    @property
    def name(self) -> str:
        """What it is called in `PHYBLOCK_PHYSICS` and in what is written about a run."""

    @property
    def versions(self) -> Mapping[str, str]:
        """Name and version of each library that decides where blocks end up."""

    def open(self, physics: Physics) -> AbstractContextManager[Simulation]:
        """Open a floor without blocks, as a context manager that closes it on leaving.

        Raises SimulationError when the engine can open no more.
        """
