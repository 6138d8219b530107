"""A renderer in one module: each prop is the box round it in the picture, the farthest first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from phyblock.domain import quat_xyzw_to_matrix
from phyblock.sim.camera import Camera
from phyblock.sim.renderer import Light, Prop, Raster

BOX_RENDERER = f"{__name__}:BoxRenderer"
"""What `PHYBLOCK_RENDERER` calls it."""


class BoxRenderer:
    """Paints in the order of depth; of props at one depth, the larger first."""

    name = "boxes"

    @property
    def versions(self) -> Mapping[str, str]:
        return {"numpy": np.__version__}

    def draw(self, props: Sequence[Prop], camera: Camera, light: Light, size_px: int) -> Raster:
        rgb = np.full((size_px, size_px, 3), 255, dtype=np.uint8)
        shown = np.full((size_px, size_px), -1)
        boxes = []
        for place, prop in enumerate(props):
            rotation = quat_xyzw_to_matrix(prop.pose.quat_xyzw)
            corners = prop.mesh.vertices_m @ rotation.T + prop.pose.position_m
            depths = (corners - camera.eye_m) @ camera.axes[2]
            if depths.max() < camera.near_m or depths.min() > camera.far_m:
                continue
            pixels = np.rint(camera.to_pixels(corners, size_px)).clip(0, size_px).astype(int)
            left, top = pixels.min(axis=0).tolist()
            right, bottom = pixels.max(axis=0).tolist()
            depth_m = float((prop.pose.position_m - camera.eye_m) @ camera.axes[2])
            area = (right - left) * (bottom - top)
            boxes.append((-depth_m, -area, place, slice(top, bottom), slice(left, right)))
        for *_, place, rows, columns in sorted(boxes, key=lambda box: box[:3]):
            facing = max(0.0, float(-camera.axes[2] @ light.direction))
            bright = np.array(props[place].rgb) * (light.ambient + light.diffuse * facing)
            rgb[rows, columns] = bright.clip(0, 255)
            shown[rows, columns] = place
        return Raster(rgb, shown, np.zeros_like(shown), np.zeros(shown.shape, dtype=np.bool_))
