"""A sketch pad for structures: put blocks down one after another, as a person builds.

A block is lowered at a place on the grid, in a named pose, and its height follows from what it
lands on; so designs have no heights, overlaps or gaps. `rules.yaml` draws whole structures.
"""

from __future__ import annotations

import copy
import functools
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any, Literal, TypeVar, cast

import numpy as np

from phyblock.domain import scene
from phyblock.domain.blocks import BLOCK_TYPES, COLORS, KIT_PALETTE, SHAPES, BlockType, Color, Euler
from phyblock.domain.scene import AOVGraph, Block, Scene, Symmetry
from phyblock.files import read_own_yaml
from phyblock.sim import contact

POSES: Mapping[BlockType, Mapping[str, Euler]] = {
    block_type: shape.poses for block_type, shape in SHAPES.items()
}
"""Euler angles [degrees] of each named pose; the first is the default of designs."""


def transformed(blocks: Sequence[Block], symmetry: Symmetry) -> tuple[Block, ...]:
    """Return the blocks turned or mirrored about the origin; their graph does not change."""
    images = []
    for block in blocks:
        place_m = scene.image_m(block.position_m, symmetry)
        euler_deg = _turned(block.type, block.euler_deg, symmetry)
        images.append(replace(block, position_m=place_m, euler_deg=euler_deg))
    return tuple(images)


def colorless(blocks: Iterable[Block]) -> bytes:
    """Return a fingerprint that structures share if they differ only in colors."""
    return scene.fingerprint([replace(block, color=COLORS[0]) for block in blocks])


@functools.cache
def _turned(block_type: BlockType, euler_deg: Euler, symmetry: Symmetry) -> Euler:
    """Return the angles of the image of a pose, as in `POSES` if that has the pose."""
    angles = scene.image_deg(euler_deg, symmetry)
    wanted = scene.pose_class(block_type, angles)
    for known in POSES[block_type].values():
        if scene.pose_class(block_type, known) == wanted:
            return known
    return angles


UNIT_M = 0.025
"""Grid unit [m]: half the side of a cube."""
_LIFT_M = 1.0


def lowered(block: Block, onto: Sequence[Block], x_m: float, y_m: float) -> Block:
    """Lower a block, the middle of its outline over (x, y) [m], to the first block or the floor."""
    middle = contact.bounds_m(block).mean(axis=0)
    x, y = (
        float(round(start + to - float(half), 6)) + 0.0
        for start, to, half in zip(block.position_m, (x_m, y_m), middle, strict=False)
    )
    lifted = replace(block, position_m=(x, y, block.position_m[2] + _LIFT_M))
    fall_m = contact.drop_height_m(lifted, onto)
    return replace(lifted, position_m=(x, y, round(lifted.position_m[2] - fall_m, 6) + 0.0))


def make_scene(name: str, levels: tuple[int, ...], blocks: list[Block]) -> Scene:
    """Return the scene of blocks, its ground plan centered at the origin; raises as `scene_of`."""
    middle_x, middle_y, _ = contact.whole_bounds_m(blocks).mean(axis=0).tolist()
    centered = []
    for block in blocks:
        x, y, z = block.position_m
        place = (round(x - middle_x, 6) + 0.0, round(y - middle_y, 6) + 0.0, z)
        centered.append(replace(block, position_m=place))
    return scene_of(name, levels, centered)


def scene_of(
    name: str, levels: tuple[int, ...], blocks: Sequence[Block], parents: tuple[str, ...] = ()
) -> Scene:
    """Return the scene that blocks form where they are: dependencies from contact, layers from the
    longest path. Raises CycleError if contacts allow no order.
    """
    below = contact.support_graph(blocks)
    finished = tuple(
        replace(block, depend=tuple(sorted(below[block.order] - {contact.GROUND})), layer=layer)
        for block, layer in zip(blocks, graph_of(below).layers, strict=True)
    )
    return Scene(name, levels, finished, parents or (name,))


def graph_of(below: Mapping[int, Collection[int]]) -> AOVGraph:
    """Return the graph of blocks, by the orders that each rests on. Raises CycleError."""
    number = {order: vertex for vertex, order in enumerate(below)}
    held = (frozenset(number[o] for o in under if o != contact.GROUND) for under in below.values())
    return AOVGraph(tuple(held))


Palette = Literal["kit", "full"]
"""The official kit's pairs of type and color, or all pairs."""
PALETTES: dict[Palette, tuple[tuple[BlockType, Color], ...]] = {
    "kit": KIT_PALETTE,
    "full": tuple(product(BLOCK_TYPES, COLORS)),
}
"""The pairs of type and color in each palette."""
T = TypeVar("T")
Step = str | list[Any] | dict[str, Any]


@functools.cache
def rules() -> dict[str, Step]:
    """Return the rules that draw structures, by name."""
    return cast(dict[str, Step], read_own_yaml(Path(__file__).with_name("rules.yaml")))


class Draft:
    """A structure under construction, with the random source and the colors that its rules use.

    A cube has one of two tones of the structure, 0 or 1, so that a storey has one color; any other
    type has one color per structure, the kit's own with the palette `kit`.
    """

    def __init__(self, rng: np.random.Generator, palette: Palette = "kit") -> None:
        self.blocks: list[Block] = []
        self.rng = rng
        order = rng.permutation(len(COLORS))
        self._tones: tuple[Color, ...] = tuple(COLORS[i] for i in order[:2])
        self._colors = {block_type: shape.kit_colors[0] for block_type, shape in SHAPES.items()}
        if palette == "full":
            drawn = rng.integers(len(COLORS), size=len(BLOCK_TYPES))
            self._colors = {t: COLORS[int(i)] for t, i in zip(BLOCK_TYPES, drawn, strict=True)}

    def pick(self, options: Sequence[T]) -> T:
        """Return one of the options, each equally likely."""
        return options[int(self.rng.integers(len(options)))]

    def put(
        self,
        block_type: BlockType,
        y: float = 0.0,
        x: float = 0.0,
        pose: str = "",
        color: Color | None = None,
    ) -> None:
        """Lower a block, the center of its outline at (x, y) [grid units], by default in the first
        of its `POSES` and in the kit's color.
        """
        poses = POSES[block_type]
        euler = poses[pose] if pose else next(iter(poses.values()))
        color = color or SHAPES[block_type].kit_colors[0]
        block = replace(contact.at((block_type, euler)), order=len(self.blocks) + 1, color=color)
        self.blocks.append(lowered(block, self.blocks, x * UNIT_M, y * UNIT_M))

    def build(self, text: str, tone: int = 0) -> None:
        """Lower blocks one after another, as in `2 cube 1; arch:cradle 0,-1; cube +1; top`.

        Each part is a type, with a pose after a colon, a place y or y,x [grid units], and a number
        of tones above `tone`. A leading 2 puts one at -y and one at +y, where the poses `ramp` and
        `round` face away from the middle. `top` is a random roof or dome, its ridge either way.
        """
        for part in filter(None, text.split("; ")):
            words = part.split()
            is_pair = words[0] == "2"
            block_type, _, pose = words[is_pair].partition(":")
            place = [word for word in words[is_pair + 1 :] if word[0] != "+"]
            y, _, x = place[0].partition(",") if place else ("0", "", "")
            if block_type == "top":
                block_type = self.pick(("triangle", "semi_cylinder"))
                kind = "roof" if block_type == "triangle" else "dome"
                pose = self.pick((kind, f"{kind}-turned"))
            raised = sum(int(word) for word in words if word[0] == "+")
            color = self._colors[block_type]  # type: ignore[index]
            if block_type == "cube":
                color = self._tones[(tone + raised) % 2]
            for sign in (-1, 1) if is_pair else (1,):
                sided = f"{pose}{'-+'[sign > 0]}y" if pose in ("ramp", "round") else pose
                self.put(block_type, sign * float(y), float(x or 0), sided, color)  # type: ignore[arg-type]

    def follow(self, steps: Step, tone: int = 0) -> None:
        """Follow the steps of a rule of `rules.yaml` in order, with tones counted from `tone`."""
        for step in steps if isinstance(steps, list) else [steps]:
            if isinstance(step, list):
                self.follow(self.pick(step), tone)
            elif isinstance(step, dict) and "maybe" in step:
                is_done = self.rng.random() < step.get("chance", 0.5)
                self.follow(step["maybe"] if is_done else step.get("else", ""), tone)
            elif isinstance(step, dict):
                parts: dict[str, list[Block]] = {}
                for name, names in step["parts"].items():
                    apart = copy.copy(self)
                    parts[name] = apart.blocks = []
                    apart.follow(apart.pick(names))
                row = [
                    transformed(parts[name[1:]], _ACROSS) if name[0] == "~" else parts[name]
                    for name in step["row"]
                ]
                self.blocks += beside(row, self.pick(step["gaps"]))
            else:
                for part in filter(None, step.split("; ")):
                    name, *raised = part.split()
                    if name in rules():
                        self.follow(rules()[name], tone + sum(map(int, raised)))
                    else:
                        self.build(part, tone)


_ACROSS = Symmetry(2, mirrored=True)
"""The mirror image across the plane y = 0."""


def beside(parts: Sequence[Sequence[Block]], gap_units: float, axis: int = 1) -> list[Block]:
    """Return the parts side by side along x, the depth (`axis` 0), or y, the front (1), with gaps
    between their outlines [grid units], numbered from 1.
    """
    row: list[Block] = []
    edge_m = 0.0
    for part in parts:
        low_m, high_m = contact.whole_bounds_m(part)
        shift = -(low_m + high_m) / 2
        shift[2] = 0.0
        shift[axis] = edge_m - low_m[axis]
        for block in part:
            x, y, z = np.round(np.array(block.position_m) + shift, 6) + 0.0
            place = (float(x), float(y), float(z))
            row.append(replace(block, order=len(row) + 1, position_m=place))
        edge_m += float(high_m[axis] - low_m[axis]) + gap_units * UNIT_M
    return row
