"""Small scenes, designed by hand, for tests that look at one structure closely."""

from __future__ import annotations

import numpy as np

from phyblock.domain.scene import Scene
from phyblock.making.scenes.sketch import Draft, make_scene

_DESIGNS = {
    "l1-dog": "arch; cube 1; triangle:ramp-y -1; semi_cylinder 1",
    "l1-dolmen": "2 cylinder 2; cuboid3:flat-y; triangle",
    "l1-gate": "arch; cuboid2:flat-y; triangle",
    "l2-rocket": "cylinder; 2 triangle:ramp 2; cube; triangle",
    "l3-torii": (
        "2 cuboid1 2; 2 cylinder 2; cuboid3:flat-y; cube; 2 cuboid1:edge-x 2; cuboid3:flat-y; "
        "triangle:ramp+y -2; triangle:ramp-y 2"
    ),
    "l4-playground": (
        "cuboid1 -6; cuboid1 -2; cylinder -6; cylinder -2; cuboid3:flat-y -4; cube -4; "
        "semi_cylinder -6; semi_cylinder -2; triangle -4; cube 2 +1; cube 4; triangle:ramp+y 6; "
        "cube 2 +1; triangle:ramp+y 4; triangle 2"
    ),
}
"""Structures as `Draft.build` reads them; y runs along the front that the camera sees best."""


def built(text: str) -> Draft:
    """A draft with the blocks that a text names."""
    draft = Draft(np.random.default_rng(0))
    draft.build(text)
    return draft


def designed_scene(name: str) -> Scene:
    """The scene of that name, which begins with its level."""
    return make_scene(name, (int(name[1]),), built(_DESIGNS[name]).blocks)
