"""PyBullet as a physics engine, loaded when a simulation is opened.

Structures stand as on a real table with these settings: collision hulls shrunk by the 1 mm margin
that Bullet adds to meshes, the center of mass and the inertia of the true solid, and the square
root of the pair's friction on each body, because Bullet multiplies them.
"""

from __future__ import annotations

import contextlib
import functools
import math
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import cast

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.blocks import SHAPES, BlockType, quat_xyzw_to_matrix
from phyblock.errors import SimulationError
from phyblock.sim.engine import Physics, Pose, Velocity
from phyblock.sim.geometry import collision_pieces, principal_inertia_m2, rounded, turned

_MESH_MARGIN_M = 0.001


class BulletEngine:
    """Opens simulations, each in its own PyBullet client."""

    name = "pybullet"

    @contextlib.contextmanager
    def open(self, physics: Physics) -> Iterator[_Simulation]:
        """Open a floor without blocks. Raises SimulationError if too many are open."""
        bullet = _loaded()
        client = bullet.connect(bullet.DIRECT)
        if client < 0:
            raise SimulationError("PyBullet gave no client: too many are open in this process")
        try:
            yield _Simulation(bullet, client, physics)
        finally:
            bullet.disconnect(client)


@functools.cache
def _loaded() -> ModuleType:
    """The `pybullet` module; its C code's build banner is kept off standard error."""
    kept = os.dup(2)
    null = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, 2)
        import pybullet
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(null)
    return cast(ModuleType, pybullet)


class _Simulation:
    """Blocks on a plane, as `Simulation`; Bullet itself uses only centers of mass."""

    def __init__(self, bullet: ModuleType, client: int, physics: Physics) -> None:
        self._bullet, self._client, self._physics = bullet, client, physics
        self._shapes: dict[BlockType, int] = {}
        self._bodies: dict[int, tuple[int, NDArray[np.float64]]] = {}
        """Number of each block in the client, and its center of mass in its own frame [m]."""
        bullet.setGravity(*physics.gravity_m_s2, physicsClientId=client)
        bullet.setPhysicsEngineParameter(
            fixedTimeStep=physics.time_step_s,
            numSolverIterations=physics.iterations,
            deterministicOverlappingPairs=1,
            physicsClientId=client,
        )
        plane = bullet.createCollisionShape(bullet.GEOM_PLANE, physicsClientId=client)
        self._set_friction(bullet.createMultiBody(0, plane, physicsClientId=client))

    def add(self, number: int, block_type: BlockType, pose: Pose) -> None:
        if block_type not in self._shapes:
            self._shapes[block_type] = self._shape(block_type)
        mass_kg = self._physics.mass_kg(block_type)
        body = self._bullet.createMultiBody(
            baseMass=mass_kg,
            baseCollisionShapeIndex=self._shapes[block_type],
            physicsClientId=self._client,
        )
        inertia = [mass_kg * of_axis for of_axis in principal_inertia_m2(block_type)]
        self._bullet.changeDynamics(
            body, -1, localInertiaDiagonal=inertia, physicsClientId=self._client
        )
        self._set_friction(body)
        offset_m = np.array(SHAPES[block_type].center_of_mass_m)
        offset_here_m = turned(offset_m, quat_xyzw_to_matrix(pose.quat_xyzw))
        center_m = rounded(pose.position_m + offset_here_m)
        self._bullet.resetBasePositionAndOrientation(
            body, center_m.tolist(), pose.quat_xyzw.tolist(), physicsClientId=self._client
        )
        self._bodies[number] = (int(body), offset_m)

    def remove(self, number: int) -> None:
        self._bullet.removeBody(self._bodies.pop(number)[0], physicsClientId=self._client)

    def step(self, n: int) -> None:
        for _ in range(n):
            self._bullet.stepSimulation(physicsClientId=self._client)

    def pose(self, number: int) -> Pose:
        body, offset_m = self._bodies[number]
        found = self._bullet.getBasePositionAndOrientation(body, physicsClientId=self._client)
        center_m, quat_xyzw = map(np.array, found)
        return Pose(center_m - quat_xyzw_to_matrix(quat_xyzw) @ offset_m, quat_xyzw)

    def velocity(self, number: int) -> Velocity:
        body, _ = self._bodies[number]
        return Velocity(*self._bullet.getBaseVelocity(body, physicsClientId=self._client))

    def _set_friction(self, body: int) -> None:
        self._bullet.changeDynamics(
            body,
            -1,
            lateralFriction=math.sqrt(self._physics.friction),
            rollingFriction=0.0,
            spinningFriction=0.0,
            restitution=0.0,
            physicsClientId=self._client,
        )

    def _shape(self, block_type: BlockType) -> int:
        """Create the collision shape of a type around its center of mass."""
        if SHAPES[block_type].is_box:
            # Bullet keeps its margin inside a box.
            half_m = list(SHAPES[block_type].high_m)
            shape = self._bullet.createCollisionShape(
                self._bullet.GEOM_BOX, halfExtents=half_m, physicsClientId=self._client
            )
            return int(shape)
        # PyBullet accepts only one hull from memory, but several from a file.
        center = np.array(SHAPES[block_type].center_of_mass_m)
        lines: list[str] = []
        first = 1
        for number, piece in enumerate(collision_pieces(block_type, _MESH_MARGIN_M)):
            lines.append(f"o piece{number}")
            vertices_m = rounded(piece.vertices_m - center).tolist()
            lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices_m]
            count = len(piece.vertices_m)
            lines += [f"f {first} {first + i} {first + i + 1}" for i in range(1, count - 1)]
            first += count
        with tempfile.TemporaryDirectory(prefix="phyblock-") as folder:
            path = Path(folder, f"{block_type}.obj")
            path.write_text("\n".join(lines) + "\n", encoding="ascii")
            shape = self._bullet.createCollisionShape(
                self._bullet.GEOM_MESH, fileName=str(path), physicsClientId=self._client
            )
        if shape < 0:
            raise SimulationError(f"PyBullet refused the collision shape of {block_type}")
        return int(shape)
