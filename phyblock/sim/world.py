"""A world of rigid blocks on a plane, simulated by PyBullet.

The measured conditions for wooden-block structures to stand as they do on a table: collision
hulls moved inward by the 1 mm margin that Bullet adds to meshes, the cylinder as the 18-gon it
is, the arch as ten convex pieces, the center of mass and the inertia of the true solid, and the
square root of the pair's friction on each body, because Bullet multiplies them.
"""

from __future__ import annotations

import contextlib
import math
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType, TracebackType

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.blocks import (
    FRICTION,
    SHAPES,
    BlockType,
    euler_deg_to_quat_xyzw,
    quat_xyzw_to_matrix,
)
from phyblock.domain.scene import Block
from phyblock.errors import SimulationError
from phyblock.sim import engine
from phyblock.sim.geometry import collision_pieces, solid_mesh

__all__ = ["Physics", "Pose", "World"]

_BOXES: frozenset[BlockType] = frozenset({"cube", "cuboid1", "cuboid2", "cuboid3"})
_MESH_MARGIN_M = 0.001
_GRAVITY_M_S2 = 9.81


@dataclass(frozen=True)
class Physics:
    """Settings of a simulation: time step [s], solver iterations, friction of a pair."""

    time_step_s: float = 1 / 240
    iterations: int = 50
    friction: float = FRICTION


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


class World:
    """Blocks on the ground in a PyBullet client of their own; a context manager.

    Blocks are named by their order. The same calls on the same machine give bitwise the same
    poses. Every method raises SimulationError when the world is not open.
    """

    def __init__(self, physics: Physics | None = None) -> None:
        self.physics = physics or Physics()
        self._stack = contextlib.ExitStack()
        self._engine: tuple[ModuleType, int] | None = None
        self._shapes: dict[BlockType, int] = {}
        self._bodies: dict[int, tuple[int, Block]] = {}

    def __enter__(self) -> World:
        self._engine = self._stack.enter_context(engine.client())
        bullet, client = self._engine
        bullet.setGravity(0, 0, -_GRAVITY_M_S2, physicsClientId=client)
        bullet.setPhysicsEngineParameter(
            fixedTimeStep=self.physics.time_step_s,
            numSolverIterations=self.physics.iterations,
            deterministicOverlappingPairs=1,
            physicsClientId=client,
        )
        plane = bullet.createCollisionShape(bullet.GEOM_PLANE, physicsClientId=client)
        ground = bullet.createMultiBody(0, plane, physicsClientId=client)
        self._set_contact(ground)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._engine = None
        self._shapes.clear()
        self._bodies.clear()
        self._stack.close()

    @property
    def orders(self) -> tuple[int, ...]:
        """Orders of the blocks in the world, as they were placed."""
        return tuple(self._bodies)

    def place(self, block: Block) -> None:
        """Put a block at its goal pose, at rest; SimulationError if its order is taken."""
        bullet, client = self._open()
        if block.order in self._bodies:
            raise SimulationError(f"block {block.order} is already in the world")
        body = bullet.createMultiBody(
            baseMass=SHAPES[block.type].mass_kg,
            baseCollisionShapeIndex=self._shape(block.type),
            physicsClientId=client,
        )
        inertia = np.diag(solid_mesh(block.type).inertia_m2) * SHAPES[block.type].mass_kg
        bullet.changeDynamics(
            body, -1, localInertiaDiagonal=inertia.tolist(), physicsClientId=client
        )
        self._set_contact(body)
        self._bodies[block.order] = (body, block)
        self._move(block.order, Pose.goal(block))

    def place_all(self, blocks: Iterable[Block]) -> None:
        """Put several blocks at their goal poses."""
        for block in blocks:
            self.place(block)

    def remove(self, order: int) -> None:
        """Take a block out; SimulationError if it is not there."""
        bullet, client = self._open()
        bullet.removeBody(self._body(order), physicsClientId=client)
        del self._bodies[order]

    def step(self, duration_s: float) -> None:
        """Simulate for `duration_s` [s], rounded to whole time steps."""
        bullet, client = self._open()
        for _ in range(round(duration_s / self.physics.time_step_s)):
            bullet.stepSimulation(physicsClientId=client)

    def settle(self, limit_s: float = 5.0, speed_m_s: float = 1e-3) -> bool:
        """Simulate until every block is slower than `speed_m_s` [m/s], or `limit_s` [s] is over.

        Speeds are those of the fastest corner. Returns whether the world came to rest; it is
        looked at every tenth of a second, and never called at rest in the first.
        """
        for _ in range(round(limit_s / 0.1)):
            self.step(0.1)
            if self.fastest_m_s() < speed_m_s:
                return True
        return False

    def fastest_m_s(self) -> float:
        """Speed of the fastest corner of any block [m/s]; 0 in an empty world."""
        self._open()
        return max((self._speed_m_s(order) for order in self._bodies), default=0.0)

    def pose(self, order: int) -> Pose:
        """Where a block is now; SimulationError if it is not there."""
        bullet, client = self._open()
        center, quat = bullet.getBasePositionAndOrientation(
            self._body(order), physicsClientId=client
        )
        quat_xyzw = np.array(quat)
        offset = np.array(SHAPES[self._bodies[order][1].type].center_of_mass_m)
        return Pose(np.array(center) - quat_xyzw_to_matrix(quat_xyzw) @ offset, quat_xyzw)

    def poses(self) -> dict[int, Pose]:
        """Where every block is now, by order."""
        return {order: self.pose(order) for order in self._bodies}

    def _open(self) -> tuple[ModuleType, int]:
        if self._engine is None:
            raise SimulationError("the world is not open: use it in a with statement")
        return self._engine

    def _body(self, order: int) -> int:
        if order not in self._bodies:
            raise SimulationError(f"block {order} is not in the world")
        return self._bodies[order][0]

    def _move(self, order: int, pose: Pose) -> None:
        bullet, client = self._open()
        offset = np.array(SHAPES[self._bodies[order][1].type].center_of_mass_m)
        center = pose.position_m + quat_xyzw_to_matrix(pose.quat_xyzw) @ offset
        bullet.resetBasePositionAndOrientation(
            self._body(order), center.tolist(), pose.quat_xyzw.tolist(), physicsClientId=client
        )

    def _speed_m_s(self, order: int) -> float:
        bullet, client = self._open()
        linear, angular = bullet.getBaseVelocity(self._body(order), physicsClientId=client)
        shape = SHAPES[self._bodies[order][1].type]
        return math.hypot(*linear) + math.hypot(*angular) * math.dist(shape.low_m, shape.high_m)

    def _set_contact(self, body: int) -> None:
        bullet, client = self._open()
        bullet.changeDynamics(
            body,
            -1,
            lateralFriction=math.sqrt(self.physics.friction),
            rollingFriction=0.0,
            spinningFriction=0.0,
            restitution=0.0,
            physicsClientId=client,
        )

    def _shape(self, block_type: BlockType) -> int:
        """Collision shape of a type about its center of mass, made once a world."""
        if block_type not in self._shapes:
            self._shapes[block_type] = self._make_shape(block_type)
        return self._shapes[block_type]

    def _make_shape(self, block_type: BlockType) -> int:
        bullet, client = self._open()
        if block_type in _BOXES:
            return int(
                bullet.createCollisionShape(
                    bullet.GEOM_BOX,
                    halfExtents=SHAPES[block_type].high_m,
                    physicsClientId=client,
                )
            )
        with tempfile.TemporaryDirectory(prefix="phyblock-") as folder:
            path = Path(folder, f"{block_type}.obj")
            path.write_text(_hulls_as_obj(block_type), encoding="ascii")
            shape = bullet.createCollisionShape(
                bullet.GEOM_MESH, fileName=str(path), physicsClientId=client
            )
        if shape < 0:
            raise SimulationError(f"PyBullet refused the collision shape of {block_type}")
        return int(shape)


def _hulls_as_obj(block_type: BlockType) -> str:
    """The convex pieces as an OBJ of one object each, which Bullet reads as a compound of hulls.

    A file, since PyBullet takes no more than one hull from memory. Its faces are a mere fan:
    Bullet wraps a hull round the corners.
    """
    center = np.array(SHAPES[block_type].center_of_mass_m)
    lines: list[str] = []
    first = 1
    for number, piece in enumerate(collision_pieces(block_type, _MESH_MARGIN_M)):
        lines.append(f"o piece{number}")
        lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in (piece.vertices_m - center).tolist()]
        count = len(piece.vertices_m)
        lines += [f"f {first} {first + i} {first + i + 1}" for i in range(1, count - 1)]
        first += count
    return "\n".join(lines) + "\n"
