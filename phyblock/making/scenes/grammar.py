"""Base scenes and their variations, each from a seed of its own.

A scene is a pure function of its request: a seed, a group, a number, and for a variation the
requests of the scenes it is made from. So any process can draw any scene, in any order.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from phyblock.domain.aov import CycleError
from phyblock.domain.blocks import COLORS
from phyblock.domain.scene import Block, Kind, Scene
from phyblock.domain.symmetry import SYMMETRIES
from phyblock.making.checks.tolerances import LEVEL_LIMITS
from phyblock.making.scenes.buildings import BUILDINGS
from phyblock.making.scenes.compositions import COMPOSITIONS, beside
from phyblock.making.scenes.creatures import CREATURES
from phyblock.making.scenes.scene_draft import PALETTES, Draft, Palette, Theme
from phyblock.making.scenes.sketch import make_scene
from phyblock.making.symmetry import transformed
from phyblock.sim.support import find_gaps
from phyblock.stable import drawn_bytes

__all__ = ["GROUP_LEVELS", "Group", "Request", "draw"]

Group = Literal["1", "1+2", "2", "3", "4"]
GROUP_LEVELS: dict[Group, tuple[int, ...]] = {
    "1": (1,),
    "1+2": (1, 2),
    "2": (2,),
    "3": (3,),
    "4": (4,),
}
"""Levels that a scene of each group counts in."""

_ALL: dict[str, Theme] = {**BUILDINGS, **CREATURES, **COMPOSITIONS}
_LARGE = ("arcade", "balance", "court", "figure", "fountain", "henge", "wall")
_SMALL = sorted(name for name in (*BUILDINGS, *CREATURES) if name not in _LARGE)
_THEMES: dict[Group, tuple[str, ...]] = {
    "1": tuple(name for name in _SMALL if name != "stair"),
    "1+2": tuple(name for name in _SMALL if name not in ("rocket", "stair")),
    "2": (*_SMALL, "figure", "henge"),
    "3": tuple(sorted((*BUILDINGS, *CREATURES))),
    "4": (*sorted(COMPOSITIONS), "house", "framed", "street", "court", "avenue", "pyramid"),
}
_LEAST: dict[Group, int] = {"1": 2, "1+2": 3, "2": 4, "3": 6, "4": 13}
_TRIES = 25
_MAX_LOOKS = 14


@dataclass(frozen=True)
class Request:
    """What a scene is drawn from; `parents` are empty for a base scene."""

    seed: int
    palette: Palette
    group: Group
    number: int
    parents: tuple[Request, ...] = ()

    def rng(self) -> np.random.Generator:
        """A random source of this request's own."""
        kind = "variation" if self.parents else "base"
        text = f"{self.seed}/{self.palette}/{self.group}/{kind}/{self.number}"
        return np.random.default_rng(int.from_bytes(drawn_bytes(text)[:16], "big"))


def draw(request: Request) -> Scene | None:
    """The scene of a request, named after its theme; None when the rules gave none that fits.

    A name is `THEME`, or `recolored` or `combined` for a variation. Its `parents` are empty: the
    names of scenes are given when they are accepted.
    """
    if request.parents:
        name, blocks = _variation(request)
        return _fitting(name, request.group, blocks)
    names = _THEMES[request.group]
    name, rng = names[request.number % len(names)], request.rng()
    for _ in range(_TRIES):
        draft = Draft(rng, request.palette)
        _ALL[name](draft)
        scene = _fitting(name, request.group, draft.blocks)
        if scene is not None:
            # A block let down along the face of another may catch on its edge and hang there.
            return None if find_gaps(scene.blocks) else scene
    return None


def _fitting(name: str, group: Group, blocks: list[Block]) -> Scene | None:
    levels = GROUP_LEVELS[group]
    most = min(LEVEL_LIMITS[level].most_blocks for level in levels)
    if not _LEAST[group] <= len(blocks) <= most:
        return None
    try:
        scene = make_scene(name, levels, blocks)
    except CycleError:
        return None
    layers = max(scene.graph.layers)
    if layers > min(LEVEL_LIMITS[level].most_layers for level in levels):
        return None
    return scene if len({block.look for block in scene.blocks}) <= _MAX_LOOKS else None


def _variation(request: Request) -> tuple[str, list[Block]]:
    """One parent in other colors, or two side by side; each turned and mirrored at random."""
    rng = request.rng()
    parts: list[list[Block]] = []
    for parent in request.parents:
        scene = draw(parent)
        assert scene is not None
        symmetry = SYMMETRIES[int(rng.integers(len(SYMMETRIES)))]
        parts.append(list(transformed(scene.blocks, symmetry)))
    if len(parts) == 1:
        return "recolored", _recolored(parts[0], request.palette, rng)
    gap, axis = (1.0, 1.0, 2.0)[int(rng.integers(3))], (1, 1, 0)[int(rng.integers(3))]
    return "combined", beside(parts, gap, axis)


def _recolored(blocks: list[Block], palette: Palette, rng: np.random.Generator) -> list[Block]:
    """Blocks of one type and color stay of one color, another one where the palette has one."""
    taken: dict[Kind, Kind] = {}
    for block in blocks:
        if block.kind in taken:
            continue
        free = [
            (block.type, color)
            for color in COLORS
            if (block.type, color) in PALETTES[palette] and (block.type, color) != block.kind
        ]
        unused = [kind for kind in free if kind not in taken.values()] or [block.kind]
        taken[block.kind] = unused[int(rng.integers(len(unused)))]
    return [replace(block, color=taken[block.kind][1]) for block in blocks]
