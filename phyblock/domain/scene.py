"""Scenes: goal structures, their blocks, and the graph that orders them."""

from __future__ import annotations

import functools
from dataclasses import dataclass

from phyblock.domain.aov import AOVGraph
from phyblock.domain.blocks import BlockType, Color, Euler, orientation_class

Kind = tuple[BlockType, Color]
"""Key of setting B: type and color."""
Look = tuple[BlockType, Color, tuple[float, ...]]
"""Key of setting A: type, color, and orientation up to the block's own symmetry."""


class Oriented:
    """The look, to settings B and A, of anything that has a type, a color and an orientation."""

    type: BlockType
    color: Color
    euler_deg: Euler

    @property
    def kind(self) -> Kind:
        """Type and color."""
        return (self.type, self.color)

    @functools.cached_property
    def look(self) -> Look:
        """Type, color and orientation class."""
        return (self.type, self.color, orientation_class(self.type, self.euler_deg))


@dataclass(frozen=True)
class Block(Oriented):
    """One block of a goal structure, at its goal pose.

    `order` is its 1-based number in the scene; `position_m` the origin of its body frame in the
    world [m], z up; `euler_deg` extrinsic x-y-z angles [degrees]; `depend` the orders of the
    blocks it rests on, empty when it rests on the ground alone; `layer` as declared in the file.
    """

    order: int
    type: BlockType
    color: Color
    position_m: tuple[float, float, float]
    euler_deg: Euler
    depend: tuple[int, ...]
    layer: int


@dataclass(frozen=True)
class Scene:
    """A goal structure.

    `levels` are the difficulty levels the scene is counted in (one, or 1 and 2); `parents` the
    base scenes it was made from, by which statistics cluster (its own id when it is a base scene);
    `look_at_m` the point the goal camera looks at [m], None when framing is automatic.
    """

    id: str
    levels: tuple[int, ...]
    blocks: tuple[Block, ...]
    parents: tuple[str, ...]
    look_at_m: tuple[float, float, float] | None = None

    def __len__(self) -> int:
        return len(self.blocks)

    @property
    def level(self) -> int:
        """The highest level the scene is counted in: the one whose AOV score it enters."""
        return max(self.levels)

    @functools.cached_property
    def graph(self) -> AOVGraph:
        """The scene's AOV graph; vertex v is `blocks[v]`."""
        vertex_of = {block.order: vertex for vertex, block in enumerate(self.blocks)}
        return AOVGraph(
            tuple(frozenset(vertex_of[order] for order in block.depend) for block in self.blocks)
        )


MAX_CANDIDATES = 16


@dataclass(frozen=True)
class Candidate(Oriented):
    """One block of the dictionary: a type, a color and an orientation [degrees]."""

    type: BlockType
    color: Color
    euler_deg: Euler


@dataclass(frozen=True)
class CandidateSet:
    """At most 16 distinct candidates, numbered from 1 in the order given."""

    candidates: tuple[Candidate, ...]

    def __len__(self) -> int:
        return len(self.candidates)

    def __getitem__(self, index: int) -> Candidate:
        """The candidate with the 1-based number `index`; IndexError outside 1..n."""
        if not 1 <= index <= len(self.candidates):
            raise IndexError(f"candidate {index} is outside 1..{len(self.candidates)}")
        return self.candidates[index - 1]

    def index_of(self, look: Look) -> int | None:
        """The 1-based number of the first candidate that looks like `look`, or None."""
        return next((i for i, c in enumerate(self.candidates, 1) if c.look == look), None)

    def first_of(self, kind: Kind) -> int | None:
        """The 1-based number of the first candidate of a kind, or None."""
        return next((i for i, c in enumerate(self.candidates, 1) if c.kind == kind), None)

    def missing(self, scene: Scene) -> tuple[int, ...]:
        """Orders of the scene's blocks that no candidate can stand for in setting A."""
        looks = {candidate.look for candidate in self.candidates}
        return tuple(block.order for block in scene.blocks if block.look not in looks)
