"""A world of rigid blocks on a floor, in whichever physics engine is chosen."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterable

from phyblock.domain.blocks import SHAPES
from phyblock.domain.scene import Block
from phyblock.errors import SimulationError
from phyblock.sim.engine import Physics, PhysicsEngine, Simulation, Velocity
from phyblock.sim.pose import Pose
from phyblock.sim.registry import physics_engine

__all__ = ["Physics", "Pose", "World"]


class World:
    """Blocks on the ground in a simulation of their own; a context manager.

    Blocks are named by their order. The same calls on the same machine give bitwise the same
    poses. `engine` is the chosen one unless another is given. Every method raises SimulationError
    when the world is not open.
    """

    def __init__(self, physics: Physics | None = None, engine: PhysicsEngine | None = None) -> None:
        self.physics = physics or Physics()
        self._engine = engine or physics_engine()
        self._stack = contextlib.ExitStack()
        self._opened: Simulation | None = None
        self._blocks: dict[int, Block] = {}

    def __enter__(self) -> World:
        self._opened = self._stack.enter_context(self._engine.open(self.physics))
        return self

    def __exit__(self, *_: object) -> None:
        self._opened = None
        self._blocks.clear()
        self._stack.close()

    @property
    def orders(self) -> tuple[int, ...]:
        """Orders of the blocks in the world, as they were placed."""
        return tuple(self._blocks)

    def place(self, block: Block) -> None:
        """Put a block at its goal pose, at rest; SimulationError if its order is taken."""
        simulation = self._simulation()
        if block.order in self._blocks:
            raise SimulationError(f"block {block.order} is already in the world")
        simulation.add(block.order, block.type, Pose.goal(block))
        self._blocks[block.order] = block

    def place_all(self, blocks: Iterable[Block]) -> None:
        """Put several blocks at their goal poses."""
        for block in blocks:
            self.place(block)

    def remove(self, order: int) -> None:
        """Take a block out; SimulationError if it is not there."""
        self._simulation_with(order).remove(order)
        del self._blocks[order]

    def step(self, duration_s: float) -> None:
        """Simulate for `duration_s` [s], rounded to whole time steps."""
        self._simulation().step(round(duration_s / self.physics.time_step_s))

    def drive(self, order: int, velocity_m_s: tuple[float, float]) -> None:
        """Give a block this velocity in x and y; how it rises and turns is left as it is."""
        simulation = self._simulation_with(order)
        linear, angular = simulation.velocity(order)
        simulation.set_velocity(order, Velocity((*velocity_m_s, linear[2]), angular))

    def fastest_m_s(self) -> float:
        """Speed of the fastest corner of any block [m/s]; 0 in an empty world."""
        simulation = self._simulation()
        return max(
            (
                _fastest_corner_m_s(block, simulation.velocity(order))
                for order, block in self._blocks.items()
            ),
            default=0.0,
        )

    def pose(self, order: int) -> Pose:
        """Where a block is now; SimulationError if it is not there."""
        return self._simulation_with(order).pose(order)

    def poses(self) -> dict[int, Pose]:
        """Where every block is now, by order."""
        return {order: self.pose(order) for order in self._blocks}

    def _simulation(self) -> Simulation:
        if self._opened is None:
            raise SimulationError("the world is not open: use it in a with statement")
        return self._opened

    def _simulation_with(self, order: int) -> Simulation:
        simulation = self._simulation()
        if order not in self._blocks:
            raise SimulationError(f"block {order} is not in the world")
        return simulation


def _fastest_corner_m_s(block: Block, velocity: Velocity) -> float:
    """The most that any corner of a block can have [m/s]."""
    shape = SHAPES[block.type]
    reach_m = math.dist(shape.low_m, shape.high_m)
    return math.hypot(*velocity.linear_m_s) + math.hypot(*velocity.angular_rad_s) * reach_m
