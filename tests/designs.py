"""Small scenes of all levels, designed by hand, for tests that look at one structure closely."""

from __future__ import annotations

import functools

import numpy as np

from phyblock.domain.scene import Scene
from phyblock.making.scenes.sketch import Draft, make_scene

_BOTH_LEVELS = ("l1-cottage", "l1-dolmen")
_DESIGNS = {
    "l1-bench": "2 cuboid1 2; cuboid3:flat-y; semi_cylinder:dome 2",
    "l1-boat": "arch:cradle; cuboid3:flat-y; cube",
    "l1-cottage": "cube -1; cube 1 +1; cuboid2:flat-y; triangle",
    "l1-dog": "arch; cube 1; triangle:ramp-y -1; semi_cylinder 1",
    "l1-dolmen": "2 cylinder 2; cuboid3:flat-y; triangle",
    "l1-gate": "arch; cuboid2:flat-y; triangle",
    "l1-lighthouse": "cube; cylinder; semi_cylinder:dome-turned",
    "l1-slide": "cube; triangle:ramp+y 2; cuboid1",
    "l2-bridge": "arch; 2 triangle:ramp 3; cuboid2:flat-y; semi_cylinder",
    "l2-castle-gate": "arch; 2 cube 3; 2 triangle:roof 3",
    "l2-chapel": "cuboid3:flat-y; cube 2; arch:gate -1; semi_cylinder -1; triangle 2",
    "l2-locomotive": "2 cylinder:lying-x 2; cuboid3:flat-y; cube -2; semi_cylinder:round+y 1.5",
    "l2-rocket": "cylinder; 2 triangle:ramp 2; cube; triangle",
    "l2-throne": "cuboid1; cuboid2:upright-x 0,-1.5; 2 cuboid1:edge-x 1.5; semi_cylinder",
    "l3-balance": (
        "cuboid2:flat-y; cylinder; arch:cradle; cuboid3:flat-y; 2 cube 2; 2 semi_cylinder 2"
    ),
    "l3-beacon": (
        "cuboid2:flat-y 0,-1; cuboid2:flat-y 0,1; cube; cuboid1; cylinder; cuboid1; cube +1; "
        "triangle"
    ),
    "l3-brick-pyramid": "2 cube 2; cube +1; 2 cube 1; cuboid2:flat-y; cube +1; semi_cylinder",
    "l3-elephant": (
        "arch 0,-1; arch 0,1; 2 cuboid2:flat-x 1; cube 1; triangle:ramp+y 3; triangle:ramp-y -1; "
        "semi_cylinder 1"
    ),
    "l3-giraffe": (
        "arch; cuboid2:flat-y; triangle:ramp-y -1; cylinder 1; cube 1; cuboid2:flat-y 1.6; "
        "triangle:ramp+y 2"
    ),
    "l3-robot": "2 cylinder 1; cuboid2:flat-y; 2 cube 1; cuboid3:flat-y; cube +1; semi_cylinder",
    "l3-torii": (
        "2 cuboid1 2; 2 cylinder 2; cuboid3:flat-y; cube; 2 cuboid1:edge-x 2; cuboid3:flat-y; "
        "triangle:ramp+y -2; triangle:ramp-y 2"
    ),
    "l3-town-hall": (
        "arch; 2 cube 3; 2 cuboid2:flat-y 2; cube +1; cuboid1; triangle; 2 triangle:ramp 3"
    ),
    "l3-tractor": (
        "2 cylinder:lying-x 2; cuboid3:flat-y; cube -2; cuboid2:flat-y 1; cuboid1 -2; "
        "semi_cylinder:round+y 2.5; triangle:ramp+y 0.5; semi_cylinder -2"
    ),
    "l3-viaduct": (
        "2 arch 2; 2 triangle:ramp 5; 2 cuboid2:flat-y 2; arch; 2 cube 3; 2 semi_cylinder 3; "
        "triangle"
    ),
    "l4-aqueduct": (
        "arch -4; arch; arch 4; 2 cuboid3:flat-y 3; 2 arch 2; 2 cube 5; 2 cuboid2:flat-y 2; "
        "2 semi_cylinder 5; arch; triangle"
    ),
    "l4-castle": (
        "arch; 2 cube 3; cuboid2:flat-y; 2 cuboid1 3; 2 cylinder 3; 2 cube 1 +1; cuboid2:flat-y; "
        "triangle; 2 cuboid1 3; 2 triangle 3"
    ),
    "l4-cathedral": (
        "arch; 2 cube 3; 2 triangle:ramp 5; cuboid2:flat-y; 2 cylinder 3; arch; 2 cube 3 +1; "
        "triangle; 2 triangle:roof 3"
    ),
    "l4-harbor": (
        "cuboid2:flat-y -5,-1; cuboid2:flat-y -5,1; cube -5; cuboid1 -5; cylinder -5; "
        "cuboid1 -5; cube -5 +1; semi_cylinder -5; arch:cradle 3; cuboid3:flat-y 3; cube 2; "
        "cube 4 +1; cuboid2:flat-y 3; semi_cylinder:round-y 4; triangle 2"
    ),
    "l4-palace": (
        "2 cuboid3:flat-y 3; 2 cube 5; 2 arch 2; 2 cuboid2:flat-y 4; cuboid2:flat-y; arch; "
        "2 cube 3 +1; 2 semi_cylinder 5; cuboid2:flat-y; 2 triangle:ramp 3; cylinder; triangle"
    ),
    "l4-playground": (
        "cuboid1 -6; cuboid1 -2; cylinder -6; cylinder -2; cuboid3:flat-y -4; cube -4; "
        "semi_cylinder -6; semi_cylinder -2; triangle -4; cube 2 +1; cube 4; triangle:ramp+y 6; "
        "cube 2 +1; triangle:ramp+y 4; triangle 2"
    ),
    "l4-temple": (
        "cuboid3:flat-y 0,-1; cuboid3:flat-y 0,1; 2 cylinder 2,-1; 2 cylinder 2,1; "
        "cuboid3:flat-y 0,-1; cuboid3:flat-y 0,1; cuboid2:flat-y 0,-1; cuboid2:flat-y 0,1; "
        "triangle:ramp+y 1,-1; 2 triangle:ramp 1,1"
    ),
    "l4-twin-towers": (
        "2 cuboid2:flat-x 3; cylinder -3,-1; cylinder -3,1; cylinder 3,-1; cylinder 3,1; "
        "2 cuboid2:flat-x 3; 2 cuboid3:flat-y 3,-1; 2 cuboid3:flat-y 3,1; 2 arch:gate-turned 3; "
        "2 triangle:roof-turned 3"
    ),
}
"""Structures as `Draft.build` reads them; y runs along the front that the camera sees best."""


def built(text: str) -> Draft:
    """A draft with the blocks that a text names."""
    draft = Draft(np.random.default_rng(0))
    draft.build(text)
    return draft


@functools.cache
def designed_scenes() -> tuple[Scene, ...]:
    """The 32 scenes, sorted by id; two are counted in levels 1 and 2."""
    return tuple(
        make_scene(name, (1, 2) if name in _BOTH_LEVELS else (int(name[1]),), built(text).blocks)
        for name, text in _DESIGNS.items()
    )


def designed_scene(name: str) -> Scene:
    """The scene of that name."""
    return next(scene for scene in designed_scenes() if scene.id == name)
