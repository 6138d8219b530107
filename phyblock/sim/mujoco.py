"""MuJoCo as a physics engine, where PyBullet has no wheels; loaded when a simulation is opened.

Structures stand as in PyBullet with these settings: four substeps per time step; contacts stiff
enough not to creep, but not so stiff that they burst where facets meet edge to edge; the elliptic
friction cone; collision pieces shrunk slightly, so that blocks side by side do not touch.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from types import ModuleType
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.blocks import SHAPES, BlockType, quat_xyzw_to_matrix
from phyblock.errors import SimulationError
from phyblock.sim.engine import Physics, Pose, Velocity, World
from phyblock.sim.geometry import collision_pieces, principal_inertia_m2, rounded

_SUBSTEPS = 4
_CONTACT_STEPS = 5.0
"""Time constant of contacts in substeps; with 2, facets that meet edge to edge burst apart."""
_FRICTION_STIFFNESS = 10.0
"""Stiffness of friction over that of normal forces; with less of it blocks creep."""
_INSET_M = 0.00002  # Distance by which collision pieces are moved inward.
_KEPT = 256

Floats = NDArray[np.float64]


@functools.cache
def _loaded() -> ModuleType:
    """The `mujoco` module, kept from writing MUJOCO_LOG.TXT into the working folder."""
    import mujoco

    def ignore(_message: str) -> None:
        """Do nothing: warnings are checked after each step."""

    mujoco.set_mju_user_warning(ignore)
    return cast(ModuleType, mujoco)


@dataclass
class _Body:
    """A block; `place` (7,): position [m], quaternion w x y z; `motion` (6,): m/s, body rad/s."""

    type: BlockType
    place: Floats
    motion: Floats

    @property
    def rotation(self) -> Floats:
        """Body to world, shape (3, 3)."""
        return quat_xyzw_to_matrix(np.roll(self.place[3:], -1))

    @property
    def center_m(self) -> Floats:
        """Vector from its frame's origin to its center of mass, in the world, shape (3,) [m]."""
        return self.rotation @ np.array(SHAPES[self.type].center_of_mass_m)


class MujocoWorld(World):
    """Blocks on a plane; adding or removing a block starts a new model."""

    name = "mujoco"

    def __init__(self, physics: Physics) -> None:
        super().__init__(physics)
        self._mujoco = _loaded()
        self._bodies: dict[int, _Body] = {}
        self._model: Any = None
        self._data: Any = None

    def _add(self, order: int, block_type: BlockType, pose: Pose) -> None:
        self._interrupt()
        place = np.concatenate([pose.position_m, np.roll(pose.quat_xyzw, 1)])
        self._bodies[order] = _Body(block_type, place, np.zeros(6))

    def _remove(self, order: int) -> None:
        self._interrupt()
        del self._bodies[order]

    def _step(self, n: int) -> None:
        if n < 1:
            return
        self._begin()
        self._mujoco.mj_step(self._model, self._data, _SUBSTEPS * n)
        if any(warning.number for warning in self._data.warning):
            raise SimulationError("MuJoCo found no way on: forces or contacts beyond all bounds")

    def pose(self, order: int) -> Pose:
        """Return the current pose of a block."""
        place = self._bodies[order].place
        return Pose(place[:3].copy(), np.roll(place[3:], -1))

    def velocity(self, order: int) -> Velocity:
        """Return the current velocity of a block."""
        body = self._bodies[order]
        spin = body.rotation @ body.motion[3:]
        linear = body.motion[:3] + np.cross(spin, body.center_m)
        return Velocity(_vector(linear), _vector(spin))

    def _interrupt(self) -> None:
        """Drop the data before blocks are added or removed."""
        for body in self._bodies.values():
            body.place, body.motion = body.place.copy(), body.motion.copy()
        self._model = self._data = None

    def _begin(self) -> None:
        """Create data with the current blocks, unless they exist."""
        if self._data is not None:
            return
        types = tuple(body.type for body in self._bodies.values())
        self._model = _model(types, self.physics)
        self._data = self._mujoco.MjData(self._model)
        places, motions = self._data.qpos.reshape(-1, 7), self._data.qvel.reshape(-1, 6)
        for place, motion, body in zip(places, motions, self._bodies.values(), strict=True):
            place[:], motion[:] = body.place, body.motion
            body.place, body.motion = place, motion


def _vector(values: Floats) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z


@functools.lru_cache(maxsize=_KEPT)
def _model(types: tuple[BlockType, ...], physics: Physics) -> Any:
    """A model of blocks of these types on a floor, without their poses."""
    mujoco = _loaded()
    spec = mujoco.MjSpec()
    option = spec.option
    option.timestep = physics.time_step_s / _SUBSTEPS
    option.gravity = physics.gravity_m_s2
    option.iterations = physics.iterations
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = _FRICTION_STIFFNESS
    # MuJoCo would otherwise reset everything to its start and continue.
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    surface = {
        "friction": [physics.friction, 0.0, 0.0],
        "condim": 3,
        "solref": [_CONTACT_STEPS * option.timestep, 1.0],
    }
    plane = mujoco.mjtGeom.mjGEOM_PLANE
    spec.worldbody.add_geom(type=plane, size=[1.0, 1.0, 1.0], **surface)
    for block_type in dict.fromkeys(types):
        if not SHAPES[block_type].is_box:
            for number, piece in enumerate(collision_pieces(block_type, _INSET_M)):
                name = f"{block_type}{number}"
                spec.add_mesh(name=name, uservert=rounded(piece.vertices_m).ravel())
    for block_type in types:
        mass_kg = physics.mass_kg(block_type)
        body = spec.worldbody.add_body(
            mass=mass_kg,
            ipos=rounded(np.array(SHAPES[block_type].center_of_mass_m)),
            inertia=[mass_kg * of_axis for of_axis in principal_inertia_m2(block_type)],
            explicitinertial=True,
        )
        body.add_freejoint()
        if SHAPES[block_type].is_box:
            size = [side - _INSET_M for side in SHAPES[block_type].high_m]
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=size, **surface)
            continue
        for number in range(len(collision_pieces(block_type))):
            name = f"{block_type}{number}"
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, **surface)
    return spec.compile()
