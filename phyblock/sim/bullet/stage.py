"""The stage that pictures are taken on: one PyBullet client a process, its shapes kept.

PyBullet never gives back the memory of a visual shape, not even when its client is closed: a
fresh client for each picture grows by megabytes a scene. So the client and the few shapes that
there are stay, and only bodies come and go. They go in reverse, which hands the same numbers to
the next ones: a picture does not depend on those taken before it.
"""

from __future__ import annotations

import contextlib
import functools
import tempfile
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import ModuleType

import numpy as np

from phyblock.sim.bullet.client import connect
from phyblock.sim.bullet.egl import load_egl
from phyblock.sim.mesh import Mesh
from phyblock.sim.renderer import Prop, Rgb

__all__ = ["Stage", "stage"]


class Stage:
    """A client with the visual shapes made so far; use it through `stage`."""

    def __init__(self, *, with_egl: bool) -> None:
        self._bullet, self._client = connect()
        self._make_shape = self._shape_in_memory
        if with_egl:
            load_egl(self._bullet, self._client)
            self._make_shape = self._shape_from_file
        self._shapes: dict[tuple[int, Rgb], tuple[int, Mesh]] = {}
        self._lock = threading.Lock()

    @contextlib.contextmanager
    def showing(self, props: Sequence[Prop]) -> Iterator[tuple[ModuleType, int, tuple[int, ...]]]:
        """Put props up, and take them down on leaving; one user at a time.

        Gives the module, the client and the body number of each prop. Meshes must be the same
        objects from picture to picture, for their shapes are kept.
        """
        with self._lock:
            bodies: list[int] = []
            try:
                bodies += (self._put_up(prop) for prop in props)
                yield self._bullet, self._client, tuple(bodies)
            finally:
                for body in reversed(bodies):
                    self._bullet.removeBody(body, physicsClientId=self._client)

    def _put_up(self, prop: Prop) -> int:
        return int(
            self._bullet.createMultiBody(
                baseVisualShapeIndex=self._shape(prop.mesh, prop.rgb),
                basePosition=prop.pose.position_m.tolist(),
                baseOrientation=prop.pose.quat_xyzw.tolist(),
                physicsClientId=self._client,
            )
        )

    def _shape(self, mesh: Mesh, rgb: Rgb) -> int:
        """The kept shape; the mesh is kept with it, so that its identity stays taken."""
        key = (id(mesh), rgb)
        if key not in self._shapes:
            self._shapes[key] = (self._make_shape(mesh, rgb), mesh)
        return self._shapes[key][0]

    def _shape_in_memory(self, mesh: Mesh, rgb: Rgb) -> int:
        """Every triangle with corners of its own, which keeps the shading of faces flat."""
        corners = mesh.corners_m.reshape(-1, 3)
        return int(
            self._bullet.createVisualShape(
                self._bullet.GEOM_MESH,
                vertices=corners.tolist(),
                indices=list(range(len(corners))),
                normals=np.repeat(mesh.normals, 3, axis=0).tolist(),
                uvs=[[0.0, 0.0]] * len(corners),
                rgbaColor=[*(channel / 255 for channel in rgb), 1.0],
                physicsClientId=self._client,
            )
        )

    def _shape_from_file(self, mesh: Mesh, rgb: Rgb) -> int:
        """The same shape for EGL, which crashes on meshes that come from memory."""
        corners, normals = mesh.corners_m.reshape(-1, 3), np.repeat(mesh.normals, 3, axis=0)
        lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in corners.tolist()]
        lines += [f"vn {x!r} {y!r} {z!r}" for x, y, z in normals.tolist()]
        numbers = range(1, len(corners), 3)
        lines += [f"f {i}//{i} {i + 1}//{i + 1} {i + 2}//{i + 2}" for i in numbers]
        with tempfile.TemporaryDirectory(prefix="phyblock-") as folder:
            path = Path(folder, "shape.obj")
            path.write_text("\n".join(lines) + "\n", encoding="ascii")
            return int(
                self._bullet.createVisualShape(
                    self._bullet.GEOM_MESH,
                    fileName=str(path),
                    rgbaColor=[*(channel / 255 for channel in rgb), 1.0],
                    physicsClientId=self._client,
                )
            )


_opening = threading.Lock()


def stage(*, with_egl: bool) -> Stage:
    """This process's stage; its client stays open until the process ends."""
    with _opening:
        return _only_stage(with_egl)


@functools.cache
def _only_stage(with_egl: bool) -> Stage:
    return Stage(with_egl=with_egl)
