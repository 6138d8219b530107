"""PyBullet as a renderer: its software renderer (TinyRenderer), or OpenGL by its EGL plugin."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from phyblock.errors import SimulationError
from phyblock.sim.bullet.client import version
from phyblock.sim.bullet.egl import egl_works
from phyblock.sim.bullet.stage import stage
from phyblock.sim.camera import Camera
from phyblock.sim.renderer import Light, Prop, Raster

__all__ = ["BulletRenderer", "egl_or_tiny_renderer", "egl_renderer", "tiny_renderer"]


class BulletRenderer:
    """Draws with `getCameraImage`, on the stage that lasts as long as the process."""

    def __init__(self, *, with_egl: bool) -> None:
        self._with_egl = with_egl

    @property
    def name(self) -> str:
        """Either `egl` or `tinyrenderer`."""
        return "egl" if self._with_egl else "tinyrenderer"

    @property
    def versions(self) -> Mapping[str, str]:
        """PyBullet's."""
        return {"pybullet": version()}

    def draw(self, props: Sequence[Prop], camera: Camera, light: Light, size_px: int) -> Raster:
        """Draw props with one light, `size_px` squared."""
        with stage(with_egl=self._with_egl).showing(props) as (bullet, client, bodies):
            width, height, rgba, _, seen = bullet.getCameraImage(
                size_px,
                size_px,
                _view_matrix(camera),
                _projection_matrix(camera),
                lightDirection=light.direction.tolist(),
                lightAmbientCoeff=light.ambient,
                lightDiffuseCoeff=light.diffuse,
                lightSpecularCoeff=0.0,
                shadow=0,
                renderer=(
                    bullet.ER_BULLET_HARDWARE_OPENGL if self._with_egl else bullet.ER_TINY_RENDERER
                ),
                physicsClientId=client,
            )
        colors = np.asarray(rgba, dtype=np.uint8).reshape(height, width, 4)[..., :3]
        shown = np.asarray(seen, dtype=np.int64).reshape(height, width)
        # The last place is for -1, which is no body.
        place = np.full(max(bodies, default=-1) + 2, -1)
        place[list(bodies)] = np.arange(len(bodies))
        return Raster(colors.copy(), place[shown])


def tiny_renderer() -> BulletRenderer:
    """The renderer that gives the same pictures on every machine."""
    return BulletRenderer(with_egl=False)


def egl_renderer() -> BulletRenderer:
    """The renderer by OpenGL; SimulationError where a trial shows that it does not work."""
    if not egl_works():
        raise SimulationError(
            "PHYBLOCK_RENDERER asks for egl, but a trial in a child process failed"
        )
    return BulletRenderer(with_egl=True)


def egl_or_tiny_renderer() -> BulletRenderer:
    """The renderer by OpenGL where it works, else TinyRenderer."""
    return BulletRenderer(with_egl=egl_works())


def _view_matrix(camera: Camera) -> list[float]:
    """OpenGL view matrix, column-major, 16 numbers."""
    matrix = np.eye(4)
    matrix[:3, :3] = camera.axes * [[1.0], [1.0], [-1.0]]
    matrix[:3, 3] = -matrix[:3, :3] @ camera.eye_m
    return _column_major(matrix)


def _projection_matrix(camera: Camera) -> list[float]:
    """OpenGL projection matrix, column-major, 16 numbers."""
    near, far = camera.near_m, camera.far_m
    matrix = np.zeros((4, 4))
    matrix[0, 0] = matrix[1, 1] = 1 / camera.half_tangent
    matrix[2, 2] = (far + near) / (near - far)
    matrix[2, 3] = 2 * far * near / (near - far)
    matrix[3, 2] = -1.0
    return _column_major(matrix)


def _column_major(matrix: NDArray[np.float64]) -> list[float]:
    return [float(entry) for entry in matrix.T.ravel()]
