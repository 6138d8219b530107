"""Films for people: an assembly step by step."""

from __future__ import annotations

import io

import numpy as np
from PIL import Image

from phyblock.domain.scene import Scene
from phyblock.errors import DataError, Problem
from phyblock.sim.pictures import PictureStyle, goal_camera, picture

_STEP_MS, _END_MS = 650, 2200


def assembly_gif(scene: Scene, style: PictureStyle) -> bytes:
    """Return the assembly in the stored order as an animated GIF, which repeats.

    Every frame has the camera of the goal. Raises DataError if that order is not valid.
    """
    camera = goal_camera(scene, style)
    if not scene.graph.is_valid(range(len(scene))):
        message = "places a block before one that it depends on"
        raise DataError(Problem(scene.id, message, "order of blocks"))
    counts, shown = range(1, len(scene) + 1), (camera, style.background, style.size_px)
    images = [picture(scene.blocks[:n], *shown) for n in counts]
    # The palette is made of the first frame, the middle one and the last.
    colorful = Image.fromarray(np.concatenate([images[0], images[len(images) // 2], images[-1]]))
    palette = colorful.quantize(256, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    images = [one.quantize(palette=palette, dither=Image.Dither.NONE) for one in images]
    buffer, times_ms = io.BytesIO(), [_STEP_MS] * (len(images) - 1) + [_END_MS]
    more = {"save_all": True, "append_images": images[1:], "loop": 0, "disposal": 1}
    images[0].save(buffer, "GIF", duration=times_ms, optimize=False, **more)
    return buffer.getvalue()
