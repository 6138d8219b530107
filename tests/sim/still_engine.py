"""A physics engine in one module: blocks stay where they are put, whatever is below them."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping

from phyblock.domain import Block, BlockType
from phyblock.sim.engine import Contact, Physics, Velocity
from phyblock.sim.pose import Pose
from phyblock.sim.support import support_graph

STILL_ENGINE = f"{__name__}:StillEngine"
"""What `PHYBLOCK_PHYSICS` calls it."""
STILL = Velocity((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


class StillEngine:
    name = "still"

    @property
    def versions(self) -> Mapping[str, str]:
        return {"still": "1"}

    @contextlib.contextmanager
    def open(self, physics: Physics) -> Iterator[StillSimulation]:  # noqa: ARG002
        yield StillSimulation()


class StillSimulation:
    """Every block is held by glue, which a step of time makes hold again."""

    def __init__(self) -> None:
        self._types: dict[int, BlockType] = {}
        self._poses: dict[int, Pose] = {}
        self._velocities: dict[int, Velocity] = {}
        self._contacts: tuple[Contact, ...] = ()

    def add(self, number: int, block_type: BlockType, pose: Pose) -> None:
        self._types[number], self._poses[number] = block_type, pose
        self._velocities[number] = STILL

    def remove(self, number: int) -> None:
        for kept in (self._types, self._poses, self._velocities):
            del kept[number]

    def step(self, n: int) -> None:
        if n > 0:
            self._velocities = dict.fromkeys(self._types, STILL)
            self._contacts = self._supports()

    def pose(self, number: int) -> Pose:
        return self._poses[number]

    def velocity(self, number: int) -> Velocity:
        return self._velocities[number]

    def set_velocity(self, number: int, velocity: Velocity) -> None:
        self._velocities[number] = velocity

    def contacts(self) -> tuple[Contact, ...]:
        return self._contacts

    def _supports(self) -> tuple[Contact, ...]:
        """What rests on what, from geometry."""
        at = (0.0, 0.0, 0.0)
        blocks = [
            self._poses[number].put(Block(number, block_type, "red", at, at, (), 1))
            for number, block_type in self._types.items()
        ]
        found = []
        for above, carriers in support_graph(blocks).items():
            for below in carriers:
                first, second = sorted((below, above))
                found.append(Contact(first, second, (0.0, 0.0, 1.0 if first == below else -1.0), 0))
        return tuple(sorted(found))
