"""`scenes.jsonl`: one goal structure and its candidate set per line; see docs/data-format.md.

All layouts use the same types of values and checks of orders, dependencies, layers and looks.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import AfterValidator, AliasChoices, Field, PlainSerializer, StrictInt, TypeAdapter

from phyblock.config.validation import Fault, OneOf, ShapeName, checked, form
from phyblock.config.yaml import shown
from phyblock.data.base import Dataset, lines_of, read_each, read_set, report
from phyblock.domain.blocks import Color
from phyblock.domain.scene import (
    MAX_CANDIDATES,
    AOVGraph,
    AssemblyTask,
    Block,
    Candidate,
    CandidateSet,
    CycleError,
    Scene,
)
from phyblock.records.record import Line, decode

SCENES_FILE = "scenes.jsonl"
MAX_BLOCKS = 40
NAME = r"^[A-Za-z0-9][A-Za-z0-9._-]{0,99}$"
NAME_ALLOWED = "up to 100 letters, digits, '.', '_' or '-', a letter or digit first"
_LEVELS = ((1,), (2,), (3,), (4,), (5,), (1, 2))
# Without -0.0, so that equal scenes have equal digests.
_UNSIGNED_ZERO = AfterValidator(lambda number: number + 0.0)
# Whole numbers are easier to read in a file as integers.
_PLAIN = PlainSerializer(lambda number: int(number) if number.is_integer() else number)
# Bounds are far above any use, and small enough for exact geometry.
_Length = Annotated[float, Field(strict=True, ge=-100, le=100), _UNSIGNED_ZERO]
_Meters = Annotated[_Length, _PLAIN]
_Degrees = Annotated[float, Field(strict=True, ge=-36_000, le=36_000), _UNSIGNED_ZERO, _PLAIN]
_Elevation = Annotated[float, Field(strict=True, ge=1, le=90), _PLAIN]
Position = tuple[_Meters, _Meters, _Meters]
"""A point [m]."""
Angles = tuple[_Degrees, _Degrees, _Degrees]
"""Three angles [degrees]."""
View = tuple[_Degrees, _Elevation]
"""Azimuth and elevation of a camera [degrees]."""
Format = Literal[1]
"""Version of a line of data; a newer one may have another meaning."""
Order = Annotated[int, Field(strict=True, ge=1, le=9999)]
"""Number of a block or of a layer."""
OrderOrGround = Annotated[int, Field(strict=True, ge=0, le=9999)]
"""Number of a block, 0 for the ground."""
Name = Annotated[str, form(NAME, NAME_ALLOWED)]
"""A name that is safe in file names and tables."""
Text = Annotated[str, form(r"\S", "a text that is not blank")]
"""A text that is not blank."""
# The paper's text calls the field `orientation`, the released files `euler`.
EITHER_NAME = Field(validation_alias=AliasChoices("euler", "orientation"))
"""An orientation, by either name."""


class StoredBlock(Line, extra="ignore"):
    """A block of a goal structure at its goal pose."""

    order: Order
    """Its number, from 1, unique in the scene."""
    type: ShapeName
    """Its shape."""
    color: Color
    """Its color."""
    layer: Order
    """1 on the ground, else 1 + the highest layer it depends on (checked)."""
    depend: Annotated[tuple[OrderOrGround, ...], Field(min_length=1, max_length=MAX_BLOCKS)]
    """Orders of the blocks that must stand before it; 0 is the ground; never empty, no cycles."""
    position: Position
    """Origin of the body frame in the world [m], z up, the ground at z = 0."""
    euler: Annotated[Angles, EITHER_NAME]
    """Extrinsic x-y-z angles [degrees]: R = Rz·Ry·Rx (scipy's `'xyz'`)."""

    @classmethod
    def of(cls, block: Block) -> Self:
        """Return the stored form of a block."""
        pose = {"position": block.position_m, "euler": block.euler_deg}
        return cls.model_validate({**vars(block), **pose, "depend": block.depend or (0,)})

    def block(self) -> Block:
        """Return the block of the line."""
        depend = tuple(order for order in self.depend if order)
        pose = self.position, self.euler
        return Block(self.order, self.type, self.color, *pose, depend, self.layer)


class SceneBlock(StoredBlock):
    """A block of a scene, with lengths written as decimals."""

    position: tuple[_Length, _Length, _Length]
    """Origin of the body frame in the world [m], z up, the ground at z = 0."""


class StoredKind(Line, extra="ignore"):
    """The kind of a block in a picture."""

    type: ShapeName
    """Its shape."""
    color: Color
    """Its color."""


class StoredCandidate(StoredKind):
    """A block of the dictionary shown to a model."""

    euler: Annotated[Angles, EITHER_NAME]
    """As for a block."""
    required: Any = None
    """True if the scene needs it; not read."""

    @functools.cached_property
    def candidate(self) -> Candidate:
        """Return the candidate of the line."""
        return Candidate(self.type, self.color, self.euler)


_CandidateT = TypeVar("_CandidateT", bound=StoredCandidate)


def _graph(blocks: Sequence[StoredBlock]) -> AOVGraph:
    vertex = {block.order: v for v, block in enumerate(blocks)}
    return AOVGraph(tuple(frozenset(vertex[o] for o in b.depend if o) for b in blocks))


def _block_faults(blocks: Sequence[StoredBlock]) -> Iterator[Fault]:
    """Yield duplicate orders, else dependencies on unknown blocks, else a cycle."""
    orders = [block.order for block in blocks]
    twice = [i for i, order in enumerate(orders) if order in orders[:i]]
    for i in twice:
        yield Fault("is used twice", "unique orders", str(orders[i]), (i, "order"))
    known = "0 (the ground) or an order of the scene: " + ", ".join(map(str, sorted(orders)))
    needed = [(i, order) for i, block in enumerate(blocks) for order in block.depend if order]
    dangling = [(i, order) for i, order in needed if order not in orders and not twice]
    for i, order in dangling:
        yield Fault("names no block", known, str(order), (i, "depend"))
    try:
        if not twice and not dangling:
            _graph(blocks)
    except CycleError as error:
        cycle = " -> ".join(str(orders[v]) for v in (*error.vertices, error.vertices[0]))
        at = (error.vertices[0], "depend")
        yield Fault("is part of a cycle", "dependencies without a cycle", cycle, at)


def _layer_faults(blocks: Sequence[StoredBlock]) -> Iterator[Fault]:
    for i, (block, layer) in enumerate(zip(blocks, _graph(blocks).layers, strict=True)):
        if block.layer != layer:
            wanted = f"{layer}, the longest path of dependencies"
            yield Fault("is wrong", wanted, str(block.layer), (i, "layer"))


def _look_faults(candidates: Sequence[StoredCandidate]) -> Iterator[Fault]:
    """Yield candidates that look the same as an earlier one."""
    first: dict[object, int] = {}
    for i, stored in enumerate(candidates):
        number = first.setdefault(stored.candidate.look, i + 1)
        if number != i + 1:
            message = f"looks the same as candidate {number}"
            found = shown([stored.type, stored.color, stored.euler])
            allowed = "candidates that differ in type, color or orientation"
            yield Fault(message, allowed, found, (i,))


SceneBlocks = Annotated[
    tuple[SceneBlock, ...], Field(min_length=1, max_length=MAX_BLOCKS), checked(_block_faults)
]
"""Blocks with unique orders whose dependencies have no cycle."""
CandidateList = Annotated[
    tuple[_CandidateT, ...], Field(min_length=1, max_length=MAX_CANDIDATES), checked(_look_faults)
]
"""Candidates of which no two look the same."""
Levels = Annotated[tuple[StrictInt, ...], OneOf(lambda: _LEVELS)]
"""The levels that a scene counts in."""


class StoredScene(Line, extra="ignore"):
    """A goal structure with its candidate set."""

    id: Name
    """Unique in the file; up to 100 letters, digits, `.`, `_`, `-`, a letter or digit first."""
    levels: Levels
    """The levels that the scene counts in: `[1]`, `[2]`, `[3]`, `[4]`, `[5]` or `[1, 2]`."""
    parents: Annotated[tuple[Name, ...], Field(min_length=1, max_length=100)]
    """Its base scenes, at least one, by which statistics cluster; a base scene names itself."""
    blocks: Annotated[SceneBlocks, checked(_layer_faults)]
    """The goal structure: 1 to 40 blocks."""
    candidates: CandidateList[StoredCandidate]
    """1 to 16 candidates, numbered from 1. No two look the same, and every block has its like."""
    format: Format = 1
    """Version of the line; default 1."""

    @classmethod
    def of(cls, scene: Scene, candidates: CandidateSet) -> Self:
        """Return the stored form of a scene: lengths to a micrometer."""
        looks = {block.look for block in scene.blocks}
        offered = [
            StoredCandidate(type=c.type, color=c.color, euler=c.euler_deg, required=c.look in looks)
            for c in candidates.candidates
        ]
        blocks = []
        for block in scene.blocks:
            x, y, z = (round(length, 6) + 0.0 for length in block.position_m)
            blocks.append(SceneBlock.of(replace(block, position_m=(x, y, z))))
        about: dict[str, Any] = {"id": scene.id, "levels": scene.levels, "parents": scene.parents}
        return cls(**about, blocks=tuple(blocks), candidates=tuple(offered))

    def scene(self) -> Scene:
        """Return the goal structure."""
        blocks = tuple(stored.block() for stored in self.blocks)
        return Scene(self.id, self.levels, blocks, self.parents)


def candidate_set(stored: Sequence[StoredCandidate]) -> CandidateSet:
    """Return the candidate set of stored candidates."""
    return CandidateSet(tuple(one.candidate for one in stored))


def task_of(
    scene: Scene, candidates: CandidateSet, where: str, composite: Path | None = None
) -> AssemblyTask:
    """Return a scene with its candidates. Raises DataError for a block without a candidate."""
    allowed = "every type, color and orientation that the scene uses"
    faults = []
    for block in (one for one in scene.blocks if candidates.index_of(one.look) is None):
        message = f"hold nothing that block {block.order} of scene {scene.id} needs"
        found = shown([block.type, block.color, block.euler_deg])
        faults.append(Fault(message, allowed, found, ("candidates",)))
    report(faults, where)
    return AssemblyTask(scene, candidates, composite)


def read_builtin(folder: Path) -> Dataset:
    """Return all scenes of a data set folder. Raises DataError with all its problems."""
    return _read_scenes(folder, read_set(folder / SCENES_FILE))


@functools.lru_cache(2)
def _read_scenes(folder: Path, content: bytes) -> Dataset:
    """Return the scenes in a file's content; cached, since a command reads them several times."""
    adapter = TypeAdapter(StoredScene)

    def read(line: bytes, where: str) -> AssemblyTask:
        stored = decode(adapter, line, where, StoredScene)
        return task_of(stored.scene(), candidate_set(stored.candidates), where)

    tasks = read_each(lines_of(folder / SCENES_FILE, content, "scene"), read)
    return Dataset(folder.name, folder, tuple(sorted(tasks, key=lambda task: task.key)))
