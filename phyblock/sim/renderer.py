"""What `sim` asks of a renderer: colored meshes and a camera in, pixels out.

A renderer draws meshes alone and says where the ground is in shadow; floor, outlines and smoothing
are made in `phyblock.sim.render`, in the same way for every renderer.

To add a renderer: write a module with a class that follows `Renderer`, name it in
`phyblock.sim.registry`, and let `tests/sim/test_renderer_laws.py` tell what it lacks.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from phyblock.sim.camera import Camera
from phyblock.sim.mesh import Mesh
from phyblock.sim.pose import Pose

__all__ = ["Light", "Prop", "Raster", "Renderer", "Rgb"]

Rgb = tuple[int, int, int]
"""Red, green and blue, 0..255."""


@dataclass(frozen=True, eq=False)
class Prop:
    """A mesh in one color at a pose.

    The same mesh is the same object in every picture, so that a renderer may keep what it makes
    of one.
    """

    mesh: Mesh
    rgb: Rgb
    pose: Pose


@dataclass(frozen=True, eq=False)
class Light:
    """A light from far away: `direction` (3,) is the unit vector to it, in the world.

    A face with the outward unit normal n has its mesh's color times
    ambient + diffuse * max(0, n . direction), or times ambient where a mesh stands in the way of
    the light.
    """

    direction: NDArray[np.float64]
    ambient: float
    diffuse: float


@dataclass(frozen=True, eq=False)
class Raster:
    """What a renderer gives: `rgb` shape (size, size, 3), 0..255, row 0 on top.

    `prop` shape (size, size) is the place in the list of the prop that each pixel shows, -1 where
    it shows none; what color such a pixel has does not matter. `face` shape (size, size) tells the
    faces of a prop apart, by any numbers: outlines run between them. `shaded` shape (size, size)
    is where the ground, the plane z = 0, lies in shadow, whatever stands before it.
    """

    rgb: NDArray[np.uint8]
    prop: NDArray[np.int64]
    face: NDArray[np.int64]
    shaded: NDArray[np.bool_]


@runtime_checkable
class Renderer(Protocol):
    """A way to draw. Threads may use it at the same time; the same call gives the same pixels."""

    def __hash__(self) -> int:
        """Pictures are kept by renderer."""

    @property
    def name(self) -> str:
        """What it is called in the keys of pictures."""

    @property
    def versions(self) -> Mapping[str, str]:
        """Name and version of each library that decides pixels, for the keys of pictures."""

    def draw(self, props: Sequence[Prop], camera: Camera, light: Light, size_px: int) -> Raster:
        """Draw what lies between the camera's near and far plane, `size_px` squared."""
