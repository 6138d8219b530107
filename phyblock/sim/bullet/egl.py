"""PyBullet's EGL plugin, which draws on a graphics card or a software OpenGL, where it works.

A plugin that fails to load ends its process, so a child process tries it.
"""

from __future__ import annotations

import functools
import importlib.util
import os
import tempfile
from collections.abc import Callable
from multiprocessing import get_context
from pathlib import Path
from types import ModuleType

from phyblock.errors import SimulationError
from phyblock.sim.bullet.client import client as fresh_client

__all__ = ["draw_with_egl", "egl_works", "load_egl", "succeeds_in_child"]

_PATIENCE_S = 60.0
_PROBE_PX = 32
_TRIANGLE = "v -1 -1 0\nv 1 -1 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1\n"


@functools.cache
def egl_works() -> bool:
    """Whether the plugin draws on this machine, tried once."""
    return succeeds_in_child(draw_with_egl)


def load_egl(bullet: ModuleType, client: int) -> None:
    """Load the plugin into a client; SimulationError when there is none. May end the process."""
    found = importlib.util.find_spec("eglRenderer")
    if found is None or found.origin is None:
        raise SimulationError("PyBullet came without its EGL plugin")
    if bullet.loadPlugin(found.origin, "_eglRendererPlugin", physicsClientId=client) < 0:
        raise SimulationError("PyBullet could not load its EGL plugin")


def succeeds_in_child(probe: Callable[[], object], patience_s: float = _PATIENCE_S) -> bool:
    """Whether `probe` returns in a process of its own: no exception, crash or hang."""
    child = get_context("spawn").Process(target=_quietly, args=(probe,), daemon=False)
    child.start()
    child.join(patience_s)
    if child.is_alive():
        child.kill()
        child.join()
    worked = child.exitcode == 0
    child.close()
    return worked


def draw_with_egl() -> None:
    """Draw a red triangle; SimulationError when it does not come out."""
    with fresh_client() as (bullet, client), tempfile.TemporaryDirectory() as folder:
        load_egl(bullet, client)
        path = Path(folder, "triangle.obj")
        path.write_text(_TRIANGLE, encoding="ascii")
        shape = bullet.createVisualShape(
            bullet.GEOM_MESH, fileName=str(path), rgbaColor=[1, 0, 0, 1], physicsClientId=client
        )
        body = bullet.createMultiBody(baseVisualShapeIndex=shape, physicsClientId=client)
        _, _, _, _, seen = bullet.getCameraImage(
            _PROBE_PX,
            _PROBE_PX,
            bullet.computeViewMatrix([0, 0, 2], [0, 0, 0], [0, 1, 0]),
            bullet.computeProjectionMatrixFOV(60, 1, 0.1, 5),
            renderer=bullet.ER_BULLET_HARDWARE_OPENGL,
            physicsClientId=client,
        )
        middle = _PROBE_PX // 2
        if int(seen.reshape(_PROBE_PX, _PROBE_PX)[middle, middle]) != body:
            raise SimulationError("the EGL plugin draws nothing")


def _quietly(probe: Callable[[], object]) -> None:
    """Run a probe with everything that it or a driver prints thrown away."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    os.dup2(null, 2)
    probe()
