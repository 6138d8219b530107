"""What drawing costs: our renderer beside PyBullet's TinyRenderer, in one run.

    python benchmarks/perf/pictures.py [--every 40] [--size 1024] [--rounds 3]

Goals of the built-in set, every so many, by the same camera. TinyRenderer is called directly and
draws the plain solids, without outlines and without shadows, its shapes made before. Ours draws
round sides, shadows on blocks and ground, and numbers faces; `unlit` is ours without the shadows on
blocks. CPU milliseconds in this process, the least of the rounds, which take turns. `picture` is
all that a finished picture of half the size takes: floor, outlines, smoothing.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pybullet

from phyblock.datasets import read_builtin
from phyblock.domain import euler_deg_to_quat_xyzw
from phyblock.resources import bundled
from phyblock.sim import PictureStyle
from phyblock.sim.camera import Camera
from phyblock.sim.geometry import solid_mesh
from phyblock.sim.mesh import Mesh
from phyblock.sim.pictures import drawn, goal_camera
from phyblock.sim.raster.renderer import NumpyRenderer
from phyblock.sim.render import COLOR_RGB, DrawnBlock, light_direction, picture, props_of
from phyblock.sim.renderer import Light

OURS = NumpyRenderer()


class TinyRenderer:
    """PyBullet's software renderer with the solids of some blocks on its stage."""

    def __init__(self, blocks: Sequence[DrawnBlock]) -> None:
        self._client = pybullet.connect(pybullet.DIRECT)
        for block in blocks:
            mesh = solid_mesh(block.type)
            pybullet.createMultiBody(
                baseVisualShapeIndex=self._shape(mesh, COLOR_RGB[block.color]),
                basePosition=block.position_m,
                baseOrientation=euler_deg_to_quat_xyzw(block.euler_deg).tolist(),
                physicsClientId=self._client,
            )

    def _shape(self, mesh: Mesh, rgb: tuple[int, int, int]) -> int:
        corners = mesh.corners_m.reshape(-1, 3)
        return int(
            pybullet.createVisualShape(
                pybullet.GEOM_MESH,
                vertices=corners.tolist(),
                indices=list(range(len(corners))),
                normals=np.repeat(mesh.normals, 3, axis=0).tolist(),
                uvs=[[0.0, 0.0]] * len(corners),
                rgbaColor=[*(channel / 255 for channel in rgb), 1.0],
                physicsClientId=self._client,
            )
        )

    def draw(self, camera: Camera, light: Light, size_px: int) -> None:
        """Draw the solids once."""
        target = camera.eye_m + camera.axes[2]
        view = pybullet.computeViewMatrix(camera.eye_m, target, camera.axes[1])
        planes = (camera.near_m, camera.far_m)
        pybullet.getCameraImage(
            size_px,
            size_px,
            view,
            pybullet.computeProjectionMatrixFOV(camera.field_of_view_deg, 1.0, *planes),
            lightDirection=light.direction.tolist(),
            lightAmbientCoeff=light.ambient,
            lightDiffuseCoeff=light.diffuse,
            lightSpecularCoeff=0.0,
            shadow=0,
            renderer=pybullet.ER_TINY_RENDERER,
            physicsClientId=self._client,
        )

    def close(self) -> None:
        """Take the stage down."""
        pybullet.disconnect(self._client)


def cpu_ms(work: Callable[[], Any]) -> float:
    start = time.process_time()
    work()
    return (time.process_time() - start) * 1000


def measure(blocks: Sequence[DrawnBlock], camera: Camera, size_px: int, rounds: int) -> list[float]:
    props, tiny = props_of(blocks), TinyRenderer(blocks)
    light = Light(light_direction(camera), 0.55, 0.55)
    unlit = Light(light.direction, 1.0, 0.0)
    works: list[Callable[[], Any]] = [
        lambda: tiny.draw(camera, light, size_px),
        lambda: OURS.draw(props, camera, light, size_px),
        lambda: OURS.draw(props, camera, unlit, size_px),
        lambda: picture(blocks, camera, "checkerboard", size_px // 2),
    ]
    for work in works:
        work()
    spent = [[cpu_ms(work) for work in works] for _ in range(rounds)]
    tiny.close()
    return np.min(spent, axis=0).tolist()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--every", type=int, default=40)
    parser.add_argument("--size", type=int, default=1024)
    parser.add_argument("--rounds", type=int, default=3)
    given = parser.parse_args()
    style, rows = PictureStyle(), []
    print(f"{'scene':22}{'blocks':>7}{'tiny':>9}{'ours':>9}{'unlit':>9}{'picture':>9}{'ratio':>8}")
    for task in read_builtin(bundled("benchmarks", "data", "phyblock-400")).tasks[:: given.every]:
        camera, blocks = goal_camera(task.scene, style), drawn(task.scene)
        row = measure(blocks, camera, given.size, given.rounds)
        rows.append(row)
        cells = "".join(f"{number:9.1f}" for number in row)
        print(f"{task.scene.id:22}{len(blocks):7}{cells}{row[1] / row[0]:8.2f}", flush=True)
    mean = np.mean(rows, axis=0)
    cells = "".join(f"{number:9.1f}" for number in mean)
    print(f"{'mean':29}{cells}{mean[1] / mean[0]:8.2f}")


if __name__ == "__main__":
    main()
