"""A line of `scenes.jsonl`: a goal structure, its blocks and its candidate set.

The checks of relations (orders, dependencies, layers, looks) serve every layout that is read.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from typing import Annotated, Any

from pydantic import AliasChoices, Field, StrictInt, WithJsonSchema
from typing_extensions import Self

from phyblock.domain.aov import AOVGraph, CycleError
from phyblock.domain.blocks import BlockType, Color
from phyblock.domain.scene import MAX_CANDIDATES, Block, Candidate, CandidateSet, Scene
from phyblock.records.data_values import (
    Angles,
    Filled,
    Format,
    Name,
    Order,
    OrderOrGround,
    Position,
    Triple,
    plain,
    rounded,
    triple,
)
from phyblock.records.decode import shown
from phyblock.records.faults import Fault, free_of, worded
from phyblock.records.line import Line

__all__ = [
    "EITHER_NAME",
    "MAX_BLOCKS",
    "BlockList",
    "CandidateList",
    "Levels",
    "SceneBlocks",
    "StoredBlock",
    "StoredCandidate",
    "StoredScene",
    "candidate_set",
    "look_faults",
    "missing_faults",
]

MAX_BLOCKS = 22
_MOST_PARENTS = 100
_LEVELS = ([1], [2], [3], [4], [1, 2])
_NO_LEVELS = ("are not allowed", "one level 1 to 4, or [1, 2]")

# The paper's text calls the field `orientation`, the released files `euler`.
EITHER_NAME = Field(validation_alias=AliasChoices("euler", "orientation"))
"""An orientation, by either name."""


class StoredBlock(Line, extra="ignore"):
    """A block of a goal structure at its goal pose."""

    order: Order
    """Its number, from 1, unique in the scene."""
    type: BlockType
    """Its shape."""
    color: Color
    """Its color."""
    layer: Order
    """1 on the ground, else 1 + the highest layer that it depends on (checked)."""
    depend: Annotated[tuple[OrderOrGround, ...], Filled(MAX_BLOCKS)]
    """Orders of the blocks that must stand before it; 0 is the ground; never empty, no cycles."""
    position: Position
    """Origin of the body frame in the world [m], z up, the ground at z = 0."""
    euler: Annotated[Angles, EITHER_NAME]
    """Extrinsic x-y-z angles [degrees]: R = Rz·Ry·Rx (scipy's `'xyz'`)."""

    @classmethod
    def of(cls, block: Block, position: Triple | None = None) -> Self:
        """A block as it is written; `position` where that is to be written in another way."""
        return cls(
            order=block.order,
            type=block.type,
            color=block.color,
            layer=block.layer,
            depend=block.depend or (0,),
            position=plain(block.position_m) if position is None else position,
            euler=plain(block.euler_deg),
        )

    def block(self) -> Block:
        """The block that it says."""
        depend = tuple(order for order in self.depend if order)
        position_m, euler_deg = triple(self.position), triple(self.euler)
        return Block(self.order, self.type, self.color, position_m, euler_deg, depend, self.layer)


class StoredCandidate(Line, extra="ignore"):
    """A block of the dictionary shown to a model."""

    type: BlockType
    """Its shape."""
    color: Color
    """Its color."""
    euler: Annotated[Angles, EITHER_NAME]
    """As of a block."""
    required: Any = None
    """Whether the scene needs it; not read."""

    @classmethod
    def of(cls, candidate: Candidate, *, required: bool) -> Self:
        """A candidate as it is written."""
        euler = plain(candidate.euler_deg)
        return cls(type=candidate.type, color=candidate.color, euler=euler, required=required)

    @functools.cached_property
    def candidate(self) -> Candidate:
        """The candidate that it says."""
        return Candidate(self.type, self.color, triple(self.euler))


def _order_faults(blocks: Sequence[StoredBlock]) -> Iterator[Fault]:
    orders = [block.order for block in blocks]
    for i, order in enumerate(orders):
        if order in orders[:i]:
            yield Fault("is used twice", "unique orders", str(order), (i, "order"))


def _dependency_faults(blocks: Sequence[StoredBlock]) -> list[Fault]:
    """Dependencies that name no block or run in a circle, in a list whose orders are unique."""
    orders = [block.order for block in blocks]
    known = "0 (the ground) or an order of the scene: " + ", ".join(map(str, sorted(orders)))
    unknown = [
        Fault("names no block", known, str(order), (i, "depend"))
        for i, block in enumerate(blocks)
        for order in block.depend
        if order and order not in orders
    ]
    if unknown:
        return unknown
    try:
        _graph(blocks)
    except CycleError as error:
        cycle = " -> ".join(str(orders[v]) for v in (*error.vertices, error.vertices[0]))
        at = (error.vertices[0], "depend")
        return [Fault("is part of a cycle", "dependencies without a cycle", cycle, at)]
    return []


def _layer_faults(blocks: Sequence[StoredBlock]) -> Iterator[Fault]:
    for i, (block, layer) in enumerate(zip(blocks, _graph(blocks).layers, strict=True)):
        if block.layer != layer:
            wanted = f"{layer}, the longest path of dependencies"
            yield Fault("is wrong", wanted, str(block.layer), (i, "layer"))


def _graph(blocks: Sequence[StoredBlock]) -> AOVGraph:
    vertex = {block.order: v for v, block in enumerate(blocks)}
    return AOVGraph(tuple(frozenset(vertex[o] for o in b.depend if o) for b in blocks))


def look_faults(candidates: Sequence[StoredCandidate]) -> Iterator[Fault]:
    """Candidates that look the same as an earlier one."""
    first: dict[object, int] = {}
    for i, stored in enumerate(candidates):
        number = first.setdefault(stored.candidate.look, i + 1)
        if number != i + 1:
            message = f"looks the same as candidate {number}"
            found = shown([stored.type, stored.color, list(stored.euler)])
            allowed = "candidates that differ in type, color or orientation"
            yield Fault(message, allowed, found, (i,))


def candidate_set(stored: Sequence[StoredCandidate]) -> CandidateSet:
    """The candidate set that these are."""
    return CandidateSet(tuple(one.candidate for one in stored))


def missing_faults(scene: Scene, candidates: CandidateSet) -> Iterator[Fault]:
    """Every block of the scene that no candidate can stand for."""
    missing = candidates.missing(scene)
    for block in scene.blocks:
        if block.order in missing:
            message = f"hold nothing that block {block.order} of scene {scene.id} needs"
            found = shown([block.type, block.color, list(block.euler_deg)])
            allowed = "every type, color and orientation that the scene uses"
            yield Fault(message, allowed, found, ("candidates",))


def _level_faults(levels: Sequence[int]) -> Iterator[Fault]:
    if list(levels) not in _LEVELS:
        yield Fault(*_NO_LEVELS)


BlockList = Annotated[tuple[StoredBlock, ...], Filled(MAX_BLOCKS), free_of(_order_faults)]
"""Blocks with unique orders; their dependencies may be unsound."""
SceneBlocks = Annotated[BlockList, free_of(_dependency_faults)]
"""Blocks whose dependencies are a graph without cycles."""
CandidateList = Annotated[tuple[StoredCandidate, ...], Filled(MAX_CANDIDATES), free_of(look_faults)]
"""Candidates of which no two look the same."""
Levels = Annotated[
    tuple[StrictInt, ...],
    worded(*_NO_LEVELS),
    free_of(_level_faults),
    WithJsonSchema({"enum": list(_LEVELS)}),
]
"""The levels that a scene counts in."""


class StoredScene(Line, extra="ignore"):
    """A goal structure with its candidate set."""

    id: Name
    """Unique in the file; up to 100 letters, digits, `.`, `_`, `-`, a letter or digit first."""
    levels: Levels
    """The levels that the scene counts in: `[1]`, `[2]`, `[3]`, `[4]` or `[1, 2]`."""
    parents: Annotated[tuple[Name, ...], Filled(_MOST_PARENTS)]
    """The base scenes that it was made from, one at least; a base scene names itself. Statistics
    cluster by them."""
    blocks: Annotated[SceneBlocks, free_of(_layer_faults)]
    """The goal structure: 1 to 22 blocks."""
    candidates: CandidateList
    """1 to 16 candidates, numbered from 1 in this order. No two may look the same, and every block
    needs one of its look."""
    format: Format = 1
    """Version of the line, 1 where it does not say."""

    @classmethod
    def of(cls, scene: Scene, candidates: CandidateSet) -> Self:
        """A scene as it is written: lengths to a micrometer."""
        looks = {block.look for block in scene.blocks}
        return cls(
            id=scene.id,
            levels=scene.levels,
            parents=scene.parents,
            blocks=tuple(StoredBlock.of(b, rounded(b.position_m)) for b in scene.blocks),
            candidates=tuple(
                StoredCandidate.of(candidate, required=candidate.look in looks)
                for candidate in candidates.candidates
            ),
        )

    def scene(self) -> Scene:
        """The goal structure."""
        blocks = tuple(stored.block() for stored in self.blocks)
        return Scene(self.id, self.levels, blocks, self.parents)
