"""Scenes: goal structures, their blocks, the graph that orders them, candidates, plans, tasks.

Also the equality of structures up to turning, mirroring and shifting them. The mirror image of a
block is again a block: every type has its own mirror plane, so that the image of a pose is the
mirrored frame times the block's own mirror, a proper rotation.
"""

from __future__ import annotations

import functools
import graphlib
import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.blocks import (
    SHAPES,
    BlockType,
    Color,
    Euler,
    euler_deg_to_matrix,
    orientation_class,
)


class CycleError(ValueError):
    """The dependencies hold a cycle; `vertices` are those on it, in order."""

    def __init__(self, vertices: tuple[int, ...]) -> None:
        self.vertices = vertices
        super().__init__("cycle " + " -> ".join(str(v) for v in (*vertices, vertices[0])))


@dataclass(frozen=True)
class AOVGraph:
    """Dependencies of n blocks (paper section 3.2).

    `depends_on[v]` is placed before v. Raises ValueError for a vertex outside 0..n-1, CycleError if
    no order exists.
    """

    depends_on: tuple[frozenset[int], ...]

    def __post_init__(self) -> None:
        n = len(self.depends_on)
        for vertex, needed in enumerate(self.depends_on):
            for other in needed:
                if not 0 <= other < n:
                    raise ValueError(f"vertex {vertex} depends on {other}, outside 0..{n - 1}")
        try:
            graphlib.TopologicalSorter(dict(enumerate(self.depends_on))).prepare()
        except graphlib.CycleError as error:
            # Each vertex is needed by the next, and the first is at both ends.
            vertices = error.args[1][:0:-1]
            start = vertices.index(min(vertices))
            raise CycleError((*vertices[start:], *vertices[:start])) from None

    def __len__(self) -> int:
        return len(self.depends_on)

    @functools.cached_property
    def needed_masks(self) -> tuple[int, ...]:
        """For each vertex, the bit mask of what it directly depends on."""
        return tuple(sum(1 << other for other in needed) for needed in self.depends_on)

    @functools.cached_property
    def unlocks(self) -> tuple[tuple[int, ...], ...]:
        """For each vertex, those that directly depend on it."""
        n = len(self)
        return tuple(tuple(w for w in range(n) if v in self.depends_on[w]) for v in range(n))

    @functools.cached_property
    def below(self) -> tuple[int, ...]:
        """For each vertex, the bit mask of it and all that it depends on."""
        below = [1 << v for v in range(len(self))]
        for vertex in sorted(range(len(self)), key=self.layers.__getitem__):
            for other in self.depends_on[vertex]:
                below[vertex] |= below[other]
        return tuple(below)

    @functools.cached_property
    def above(self) -> tuple[int, ...]:
        """For each vertex, the bit mask of it and all that depends on it."""
        n, below = len(self), self.below
        return tuple(sum((below[w] >> v & 1) << w for w in range(n)) for v in range(n))

    @functools.cached_property
    def layers(self) -> tuple[int, ...]:
        """Layer of each vertex: 1 on the ground, else 1 + the highest layer it depends on."""
        layers = [0] * len(self)
        for vertex in graphlib.TopologicalSorter(dict(enumerate(self.depends_on))).static_order():
            layers[vertex] = 1 + max((layers[o] for o in self.depends_on[vertex]), default=0)
        return tuple(layers)

    def is_ready(self, vertex: int, placed: int) -> bool:
        """True if `vertex` is unplaced and all it depends on is in the bit mask `placed`."""
        needed = self.needed_masks[vertex]
        return not placed >> vertex & 1 and needed & placed == needed

    def ready(self, placed: int = 0) -> tuple[int, ...]:
        """The vertices that can be placed next, in file order."""
        return tuple(v for v in range(len(self)) if self.is_ready(v, placed))

    def is_valid(self, order: Sequence[int]) -> bool:
        """True if `order` places every vertex exactly once, each only when it is ready."""
        placed = 0
        for vertex in order:
            if not 0 <= vertex < len(self) or not self.is_ready(vertex, placed):
                return False
            placed |= 1 << vertex
        return placed == (1 << len(self)) - 1

    def random_order(self, rng: np.random.Generator) -> tuple[int, ...]:
        """A topological order in which each step is drawn evenly from the ready vertices."""
        order: list[int] = []
        placed = 0
        while len(order) < len(self):
            choices = self.ready(placed)
            vertex = choices[int(rng.integers(len(choices)))]
            order.append(vertex)
            placed |= 1 << vertex
        return tuple(order)


Kind = tuple[BlockType, Color]  # Key of setting B: type and color.
Look = tuple[BlockType, Color, tuple[float, ...]]
"""Key of setting A: type, color, and orientation up to the block's own symmetry."""


class Oriented:
    """The keys under settings B and A of anything with a type, a color and an orientation."""

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
    blocks it rests on, empty when it rests only on the ground; `layer` as declared in the file.
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
        depends_on = (frozenset(vertex_of[order] for order in b.depend) for b in self.blocks)
        return AOVGraph(tuple(depends_on))


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


@dataclass(frozen=True)
class Plan:
    """The ordered 1-based candidate numbers of a model's steps; a number may repeat."""

    steps: tuple[int, ...] = ()

    def __len__(self) -> int:
        return len(self.steps)


@dataclass(frozen=True)
class PoseStep:
    """A candidate, by its 1-based number, and the place to put it.

    `center_cm` is the center of its bounding box in its candidate's orientation [cm].
    """

    candidate: int
    center_cm: tuple[float, float, float]


@dataclass(frozen=True)
class AssemblyTask:
    """A goal structure with its candidate set.

    `composite` is the data set's picture of both, if any. If `seed` shuffled `candidates`, they are
    as shown, and `order` has their numbers in the file. With `is_blind`, the goal is not shown.
    """

    scene: Scene
    candidates: CandidateSet
    composite: Path | None = None
    order: tuple[int, ...] = ()
    is_blind: bool = False
    seed: int = 0

    @property
    def key(self) -> str:
        """The scene's id, by which samples name the task."""
        return self.scene.id

    @functools.cached_property
    def offered(self) -> tuple[tuple[Kind, bool], ...]:
        """The kind of each candidate, and True if the goal needs it in that pose."""
        needed = {block.look for block in self.scene.blocks}
        return tuple((one.kind, one.look in needed) for one in self.candidates.candidates)


Matrix = NDArray[np.float64]
_MIRROR = np.diag([-1.0, 1.0, 1.0])
"""Every block type is its own mirror image across the plane x = 0 of its body frame."""
_STEP_M = 0.001
_PHASE = 0.37
"""Keeps multiples of a quarter of a millimeter, which designs use, off the borders of cells."""


@dataclass(frozen=True)
class Symmetry:
    """A mirroring across the plane x = 0, if `mirrored`, and then `turns` quarter turns about z."""

    turns: int = 0
    mirrored: bool = False

    @functools.cached_property
    def matrix(self) -> Matrix:
        """World map, shape (3, 3); its determinant is -1 when mirrored."""
        cosine, sine = ((1, 0), (0, 1), (-1, 0), (0, -1))[self.turns % 4]
        turn = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]], dtype=np.float64)
        return turn @ _MIRROR if self.mirrored else turn


SYMMETRIES = tuple(Symmetry(turns, mirrored) for mirrored in (False, True) for turns in range(4))
"""The eight symmetries of a structure on a floor with a square grid."""


def canonical_form(blocks: Sequence[Block]) -> tuple[tuple[object, ...], ...]:
    """A name of the structure that does not change when it is turned, mirrored or shifted.

    The least, over the eight symmetries, of the sorted (type, color, pose class, place) of all
    blocks, with places in millimeters from the low corner of the block origins.
    """
    return min(_form(blocks, symmetry) for symmetry in SYMMETRIES)


def turned_form(blocks: Sequence[Block]) -> tuple[tuple[object, ...], ...]:
    """A name of the structure that changes when it is mirrored, but not when turned or shifted."""
    return min(_form(blocks, Symmetry(turns)) for turns in range(4))


def fingerprint(blocks: Sequence[Block]) -> bytes:
    """16 bytes that are equal for equal canonical forms, and in practice for no others."""
    return hashlib.sha256(repr(canonical_form(blocks)).encode()).digest()[:16]


def image_m(position_m: tuple[float, float, float], symmetry: Symmetry) -> Euler:
    """The image of a place [m]."""
    x, y, z = (symmetry.matrix @ np.array(position_m)).tolist()
    return (round(x, 6) + 0.0, round(y, 6) + 0.0, z)


@functools.cache
def image_deg(euler_deg: Euler, symmetry: Symmetry) -> Euler:
    """Angles [degrees] of the image of a pose."""
    body = _MIRROR if symmetry.mirrored else np.eye(3)
    return angles_deg(symmetry.matrix @ euler_deg_to_matrix(euler_deg) @ body)


@functools.cache
def pose_class(block_type: BlockType, euler_deg: Euler) -> tuple[float, ...]:
    """The orientation class; for an upright round block, whose facets hardly show, its axis."""
    if SHAPES[block_type].is_round and abs(euler_deg_to_matrix(euler_deg)[2, 2]) > 1 - 1e-6:
        return (0.0, 0.0, 1.0)
    return orientation_class(block_type, euler_deg)


def angles_deg(rotation: Matrix) -> Euler:
    """Extrinsic x-y-z angles [degrees] of a rotation matrix: R = Rz Ry Rx."""
    sine = -float(rotation[2, 0])
    if abs(sine) > 1 - 1e-9:
        roll, yaw = math.atan2(-rotation[1, 2], rotation[1, 1]), 0.0
        pitch = math.copysign(math.pi / 2, sine)
    else:
        roll = math.atan2(rotation[2, 1], rotation[2, 2])
        pitch = math.asin(sine)
        yaw = math.atan2(rotation[1, 0], rotation[0, 0])
    return (_neat(roll), _neat(pitch), _neat(yaw))


def _form(blocks: Sequence[Block], symmetry: Symmetry) -> tuple[tuple[object, ...], ...]:
    places = np.array([image_m(block.position_m, symmetry) for block in blocks])
    places[:, :2] -= places[:, :2].min(axis=0)
    steps = np.floor(places / _STEP_M + _PHASE).astype(int)
    named = (
        (b.type, b.color, pose_class(b.type, image_deg(b.euler_deg, symmetry)), *place)
        for b, place in zip(blocks, steps.tolist(), strict=True)
    )
    return tuple(sorted(named))


def _neat(angle_rad: float) -> float:
    return round(math.degrees(angle_rad), 6) + 0.0
