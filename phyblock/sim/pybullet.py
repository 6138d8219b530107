"""PyBullet as a physics engine, loaded when a simulation is opened.

Structures stand as on a real table with these settings: collision hulls shrunk by the 1 mm margin
that Bullet adds to meshes, the center of mass and the inertia of the true solid, and the square
root of the pair's friction on each body, because Bullet multiplies them.
"""

from __future__ import annotations

import functools
import math
import os
import tempfile
from pathlib import Path
from types import ModuleType
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.blocks import SHAPES, BlockType, quat_xyzw_to_matrix
from phyblock.domain.scene import Block
from phyblock.errors import SimulationError
from phyblock.sim.engine import Physics, Pose, Vector, World
from phyblock.sim.geometry import collision_pieces, principal_inertia_m2, rounded, turned

_MESH_MARGIN_M = 0.001


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


class BulletWorld(World):
    """Blocks on a plane, in a client of its own; Bullet itself uses only centers of mass."""

    name = "pybullet"

    def __init__(self, physics: Physics) -> None:
        super().__init__(physics)
        self._bullet = bullet = _loaded()
        self._client = bullet.connect(bullet.DIRECT)
        if self._client < 0:
            raise SimulationError("PyBullet gave no client: too many are open in this process")
        self._shapes: dict[BlockType, int] = {}
        self._bodies: dict[int, tuple[int, NDArray[np.float64]]] = {}
        """Number of each block in the client, and its center of mass in its own frame [m]."""
        self._call("setGravity", *physics.gravity_m_s2)
        self._call(
            "setPhysicsEngineParameter",
            fixedTimeStep=physics.time_step_s,
            numSolverIterations=physics.iterations,
            deterministicOverlappingPairs=1,
        )
        plane = self._call("createCollisionShape", bullet.GEOM_PLANE)
        self._set_friction(self._call("createMultiBody", 0, plane))

    def _call(self, name: str, *args: object, **more: object) -> Any:
        """Call a function of PyBullet for this client."""
        return getattr(self._bullet, name)(*args, physicsClientId=self._client, **more)

    def _add(self, block: Block, pose: Pose) -> None:
        block_type = block.type
        if block_type not in self._shapes:
            self._shapes[block_type] = self._shape(block_type)
        mass_kg = self.physics.mass_kg(block_type)
        body = int(self._call("createMultiBody", mass_kg, self._shapes[block_type]))
        inertia = [mass_kg * of_axis for of_axis in principal_inertia_m2(block_type)]
        self._call("changeDynamics", body, -1, localInertiaDiagonal=inertia)
        self._set_friction(body)
        offset_m = np.array(SHAPES[block_type].center_of_mass_m)
        offset_here_m = turned(offset_m, quat_xyzw_to_matrix(pose.quat_xyzw))
        place = rounded(pose.position_m + offset_here_m).tolist(), pose.quat_xyzw.tolist()
        self._call("resetBasePositionAndOrientation", body, *place)
        self._bodies[block.order] = (body, offset_m)

    def _remove(self, order: int) -> None:
        self._call("removeBody", self._bodies.pop(order)[0])

    def _step(self, n: int) -> None:
        step, client = self._bullet.stepSimulation, self._client
        for _ in range(n):
            step(physicsClientId=client)

    def __exit__(self, *_: object) -> None:
        self._bullet.disconnect(self._client)

    def pose(self, order: int) -> Pose:
        """Return the current pose of a block."""
        body, offset_m = self._bodies[order]
        center_m, quat_xyzw = map(np.array, self._call("getBasePositionAndOrientation", body))
        return Pose(center_m - quat_xyzw_to_matrix(quat_xyzw) @ offset_m, quat_xyzw)

    def velocity(self, order: int) -> tuple[Vector, Vector]:
        """Return the velocity of a block's center of mass [m/s], and its angular one [rad/s]."""
        linear, angular = self._call("getBaseVelocity", self._bodies[order][0])
        return linear, angular

    def _set_friction(self, body: int) -> None:
        self._call(
            "changeDynamics",
            body,
            -1,
            lateralFriction=math.sqrt(self.physics.friction),
            rollingFriction=0.0,
            spinningFriction=0.0,
            restitution=0.0,
        )

    def _shape(self, block_type: BlockType) -> int:
        """Create the collision shape of a type around its center of mass."""
        if SHAPES[block_type].is_box:
            # Bullet keeps its margin inside a box.
            half_m = list(SHAPES[block_type].high_m)
            kind = self._bullet.GEOM_BOX
            return int(self._call("createCollisionShape", kind, halfExtents=half_m))
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
            kind = self._bullet.GEOM_MESH
            shape = self._call("createCollisionShape", kind, fileName=str(path))
        if shape < 0:
            raise SimulationError(f"PyBullet refused the collision shape of {block_type}")
        return int(shape)
