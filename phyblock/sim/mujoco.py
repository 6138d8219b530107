"""MuJoCo as a physics engine, where PyBullet has no wheels; loaded when a simulation is opened.

Structures stand as in PyBullet with these settings: four substeps per time step; contacts stiff
enough not to creep, but not so stiff that they burst where facets meet edge to edge; the elliptic
friction cone; collision pieces shrunk slightly, so that blocks side by side do not touch.
"""

from __future__ import annotations

import functools
from types import ModuleType
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.blocks import SHAPES, BlockType, quat_xyzw_to_matrix
from phyblock.domain.scene import Block
from phyblock.errors import SimulationError
from phyblock.sim.engine import Physics, Pose, Vector, World
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

    # Warnings are checked after each step.
    mujoco.set_mju_user_warning(lambda _message: None)
    return cast(ModuleType, mujoco)


class MujocoWorld(World):
    """Blocks on a plane; adding or removing a block starts a new model."""

    name = "mujoco"

    def __init__(self, physics: Physics) -> None:
        super().__init__(physics)
        self._states: dict[int, tuple[Floats, Floats]] = {}
        """Place (7,), [m] and quaternion w x y z, and motion (6,), m/s and body rad/s."""
        self._model: Any = None
        self._data: Any = None

    def _add(self, block: Block, pose: Pose) -> None:
        self._interrupt()
        place = np.concatenate([pose.position_m, np.roll(pose.quat_xyzw, 1)])
        self._states[block.order] = place, np.zeros(6)

    def _remove(self, order: int) -> None:
        self._interrupt()
        del self._states[order]

    def _interrupt(self) -> None:
        """Drop the data before blocks are added or removed."""
        for order, (place, motion) in self._states.items():
            self._states[order] = place.copy(), motion.copy()
        self._model = self._data = None

    def _step(self, n: int) -> None:
        if n < 1:
            return
        mujoco = _loaded()
        if self._data is None:
            self._model = _model(tuple(b.type for b in self._blocks.values()), self.physics)
            self._data = mujoco.MjData(self._model)
            places, motions = self._data.qpos.reshape(-1, 7), self._data.qvel.reshape(-1, 6)
            for order, *state in zip(self._blocks, places, motions, strict=True):
                for now, before in zip(state, self._states[order], strict=True):
                    now[:] = before
                self._states[order] = (state[0], state[1])
        mujoco.mj_step(self._model, self._data, _SUBSTEPS * n)
        if any(warning.number for warning in self._data.warning):
            raise SimulationError("MuJoCo found no way on: forces or contacts beyond all bounds")

    def pose(self, order: int) -> Pose:
        """Return the current pose of a block."""
        place, _ = self._states[order]
        return Pose(place[:3].copy(), np.roll(place[3:], -1))

    def velocity(self, order: int) -> tuple[Vector, Vector]:
        """Return the velocity of a block's center of mass [m/s], and its angular one [rad/s]."""
        place, motion = self._states[order]
        rotation = quat_xyzw_to_matrix(np.roll(place[3:], -1))
        center_m = rotation @ np.array(SHAPES[self._blocks[order].type].center_of_mass_m)
        spin = rotation @ motion[3:]
        return _vector(motion[:3] + np.cross(spin, center_m)), _vector(spin)


def _vector(values: Floats) -> Vector:
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
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1.0, 1.0, 1.0], **surface)
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
