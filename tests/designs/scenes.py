"""Small scenes of all levels, designed by hand, for tests that look at one structure closely."""

from __future__ import annotations

import functools

from phyblock.domain import Scene
from phyblock.making.scenes.sketch import make_scene
from tests.designs.large import LEVEL_4
from tests.designs.medium import LEVEL_3
from tests.designs.pad import Design, Pad
from tests.designs.small import LEVEL_1, LEVEL_2

__all__ = ["designed_scene", "designed_scenes"]

_BOTH_LEVELS = ("l1-cottage", "l1-dolmen")
_DESIGNS: dict[int, dict[str, Design]] = {1: LEVEL_1, 2: LEVEL_2, 3: LEVEL_3, 4: LEVEL_4}


@functools.cache
def designed_scenes() -> tuple[Scene, ...]:
    """The 32 scenes, sorted by id; two are counted in levels 1 and 2."""
    scenes = []
    for level, designs in _DESIGNS.items():
        for name, design in designs.items():
            pad = Pad()
            design(pad)
            levels = (1, 2) if name in _BOTH_LEVELS else (level,)
            scenes.append(make_scene(name, levels, pad.blocks))
    return tuple(sorted(scenes, key=lambda scene: scene.id))


def designed_scene(name: str) -> Scene:
    """The scene of that name."""
    return next(scene for scene in designed_scenes() if scene.id == name)
