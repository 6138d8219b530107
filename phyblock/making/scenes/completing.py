"""Scenes derived from the poses of their blocks: dependencies, layers, levels, an order."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from phyblock.config.validation import ShapeName
from phyblock.config.yaml import YamlSource, read_yaml
from phyblock.data.base import lines_of, parse_json, read_json, read_text
from phyblock.data.scenes import (
    EITHER_NAME,
    MAX_BLOCKS,
    NAME_ALLOWED,
    Angles,
    CandidateList,
    Format,
    Levels,
    Name,
    Order,
    Position,
    candidate_set,
    is_name,
    triple,
)
from phyblock.domain.aov import CycleError
from phyblock.domain.blocks import KIT_PALETTE, Color
from phyblock.domain.scene import Block, CandidateSet, Scene
from phyblock.errors import DataError, Problem, SpecError
from phyblock.making.checks import LEVEL_LIMITS, OURS_IN_HASTE, CheckName, SceneFacts, findings_of
from phyblock.making.scenes.sketch import Palette, scene_of
from phyblock.records.line import Line, validated

_GEOMETRY: tuple[CheckName, ...] = ("overlap", "floating", "order", "candidates")
_STANDING: tuple[CheckName, ...] = ("unstable step", "unstable")
_NOTED: tuple[CheckName, ...] = ("size", "hidden")
_HINTS: dict[str, str] = {
    "order": "{} blocks in an order in which they can be built",
    "unstable step": "{} blocks in an order in which each of them stands when it is placed",
}


@dataclass(frozen=True)
class Completed:
    """A scene with all that was derived; `offered` are candidates that were given, and `notes` tell
    what is unusual about it.
    """

    scene: Scene
    offered: CandidateSet | None
    notes: tuple[str, ...]


def complete(read: ReadScene) -> Completed:
    """Derive a scene, and check that it can be built and stands.

    Raises DataError with what is wrong: blocks that overlap, float or fall, contacts without an
    order, candidates that lack what is needed.
    """
    scene = derived(read.name, read.given, read.where)
    offered = None if read.given.candidates is None else candidate_set(read.given.candidates)
    facts = SceneFacts(scene, offered, OURS_IN_HASTE)
    how = "number" if read.given.is_ordered else "list"
    # What overlaps or floats falls as well; that shall be told once.
    for names in (_GEOMETRY, _STANDING):
        if findings := tuple(findings_of(facts, names)):
            raise DataError(
                replace(
                    one.problem,
                    where=read.where,
                    message=f"scene {read.name}: {one.message}",
                    hint=_HINTS.get(one.check, "").format(how),
                )
                for one in findings
            )
    noted = [one.problem for one in findings_of(facts, _NOTED)]
    notes = [
        f"{one.message}: {one.found} {one.field}, {one.allowed}" if one.found else one.message
        for one in noted
    ]
    return Completed(scene, offered, (*notes, *_other(read.given, scene)))


def derived(name: str, given: GivenScene, where: str) -> Scene:
    """The scene that the poses of blocks make; nothing but its order is checked.

    Where no block says its `order`, blocks are numbered as they are listed, each behind those that
    it rests on. Raises DataError where contacts name no order.
    """
    unordered = [n for n, block in enumerate(given.blocks) if block.order is None]
    if unordered and len(unordered) < len(given.blocks):
        message = f"scene {name}: is missing, and other blocks have one"
        allowed = "an order for every block, or for none"
        raise DataError(Problem(where, message, f"blocks[{unordered[0]}].order", "", allowed))
    listed = [block.block(number) for number, block in enumerate(given.blocks, 1)]
    orders = [block.order for block in listed]
    if twice := sorted({order for order in orders if orders.count(order) > 1}):
        message = f"scene {name}: has two blocks of the same order"
        raise DataError(Problem(where, message, "order", str(twice[0]), "unique orders"))
    try:
        scene = scene_of(name, (), listed, given.parents)
        if not given.is_ordered:
            scene = scene_of(name, (), _buildable(scene), given.parents)
    except CycleError as error:
        cycle = " -> ".join(str(orders[v]) for v in (*error.vertices, error.vertices[0]))
        message = f"scene {name}: blocks rest on one another in a circle"
        raise DataError(Problem(where, message, "blocks", cycle)) from None
    return replace(scene, levels=given.levels or (_level(scene),))


def palette_of(scenes: Sequence[Scene]) -> Palette:
    """The palette that distractors are drawn from: the kit's, where the scenes keep to it."""
    kinds = {block.kind for scene in scenes for block in scene.blocks}
    return "kit" if kinds <= set(KIT_PALETTE) else "full"


def _buildable(scene: Scene) -> list[Block]:
    """The blocks with new orders: of those that can be placed, the one listed first comes next."""
    order: list[int] = []
    while ready := scene.graph.ready(sum(1 << vertex for vertex in order)):
        order.append(ready[0])
    return [replace(scene.blocks[v], order=n) for n, v in enumerate(order, 1)]


def _level(scene: Scene) -> int:
    """The first level above 1 that has room for so many blocks."""
    fitting = (n for n in LEVEL_LIMITS if n > 1 and len(scene) <= LEVEL_LIMITS[n].most_blocks)
    return next(fitting, max(LEVEL_LIMITS))


def _other(given: GivenScene, scene: Scene) -> list[str]:
    """Dependencies and layers that were given and are others by contact.

    Where no block says its `order`, numbers that were given are places in the list.
    """
    listed = [one.block(number) for number, one in enumerate(given.blocks, 1)]
    by_place = {_place(block): block for block in scene.blocks}
    order_of = {block.order: by_place[_place(block)].order for block in listed}
    notes = []
    for one, block in zip(given.blocks, (by_place[_place(block)] for block in listed), strict=True):
        depend = sorted(block.depend) or [0]
        declared = None if one.depend is None else sorted(order_of.get(n, n) for n in one.depend)
        if declared is not None and declared != depend:
            notes.append(f"block {block.order} depends on {depend} by contact, not {declared}")
        if one.layer is not None and one.layer != block.layer:
            notes.append(f"block {block.order} is on layer {block.layer}, not {one.layer}")
    return notes


def _place(block: Block) -> tuple[object, ...]:
    return block.type, block.color, block.position_m, block.euler_deg


_SUFFIXES = (".yaml", ".yml", ".json", ".jsonl")
_ALLOWED = f"a file of scenes ({', '.join(_SUFFIXES)}), or a folder of such files"
_PART = re.compile(r"\[(\d+)\]|([^.\[\]]+)")


class GivenBlock(Line, extra="forbid"):
    """A block at its goal pose; `layer` and `depend` may be there and are derived all the same."""

    type: ShapeName
    color: Color
    position: Position
    euler: Annotated[Angles, EITHER_NAME] = (0, 0, 0)
    order: Order | None = None
    layer: Any = None
    depend: Any = None

    def block(self, number: int) -> Block:
        """The block, with `number` as its order where it has none of its own."""
        order = number if self.order is None else self.order
        at, turned = triple(self.position), triple(self.euler)
        return Block(order, self.type, self.color, at, turned, (), 1)


class GivenScene(Line, extra="forbid"):
    """A goal structure; what is left out is derived."""

    blocks: Annotated[tuple[GivenBlock, ...], Field(min_length=1, max_length=MAX_BLOCKS)]
    id: Name | None = None
    levels: Levels | None = None
    parents: tuple[Name, ...] = Field(default=(), max_length=100)
    candidates: CandidateList | None = None
    format: Format = 1

    @property
    def is_ordered(self) -> bool:
        """True if every block says its `order`."""
        return all(block.order is not None for block in self.blocks)


@dataclass(frozen=True)
class ReadScene:
    """A scene that was read, and where it stands."""

    name: str
    given: GivenScene
    where: str


def read_given(path: Path) -> tuple[ReadScene, ...]:
    """All scenes of a file or folder, by name; DataError with everything that is wrong.

    A scene without an `id` is called as its file, with its number where that holds several.
    """
    scenes: list[ReadScene] = []
    problems: list[Problem] = []
    for file in _files(path):
        try:
            scenes += _read(file)
        except (DataError, SpecError) as error:
            problems += error.problems
    first: dict[str, str] = {}
    for one in scenes:
        if (earlier := first.setdefault(one.name, one.where)) != one.where:
            message, hint = f"is used by {earlier} already", "give it an id of its own"
            problems.append(Problem(one.where, message, "id", one.name, hint=hint))
    if problems:
        raise DataError(problems)
    if not scenes:
        raise DataError(Problem(str(path), "holds no scenes", allowed=_ALLOWED))
    return tuple(sorted(scenes, key=lambda one: one.name))


def _files(path: Path) -> list[Path]:
    if path.is_dir():
        files = sorted(file for file in path.iterdir() if file.suffix in _SUFFIXES)
        return [file for file in files if file.is_file()]
    if not path.is_file() or path.suffix not in _SUFFIXES:
        message = "is no file of scenes" if path.exists() else "there is no such file or folder"
        raise DataError(Problem(str(path), message, allowed=_ALLOWED))
    return [path]


def _read(file: Path) -> Iterator[ReadScene]:
    if file.suffix == ".jsonl":
        for number, line in enumerate(lines_of(read_text(file, _ALLOWED)), 1):
            where = f"{file}:{number}"
            yield _scene(parse_json(line, file, number), f"{file.stem}-{number}", where)
        return
    source = None
    if file.suffix == ".json":
        data = read_json(file)
    else:
        source = read_yaml(file)
        if source.problems:
            raise SpecError(source.problems)
        data = source.data
    at: tuple[str | int, ...] = ()
    if isinstance(data, dict) and "scenes" in data:
        at, data = ("scenes",), data["scenes"]
    several = isinstance(data, list)
    for number, raw in enumerate(data if several else [data]):
        name = f"{file.stem}-{number + 1}" if several else file.stem
        here = (*at, number) if several else at
        try:
            yield _scene(raw, name, source.where(here) if source else str(file))
        except DataError as error:
            raise DataError([_placed(one, source, here) for one in error.problems]) from None


def _scene(raw: Any, name: str, where: str) -> ReadScene:
    given = validated(GivenScene, raw, where)
    if given.id is None and not is_name(name):
        message, hint = "has no id, and cannot be called as its file", "give it an id"
        raise DataError(Problem(where, message, "id", name, NAME_ALLOWED, hint))
    return ReadScene(given.id or name, given, where)


def _placed(problem: Problem, source: YamlSource | None, at: tuple[str | int, ...]) -> Problem:
    """A problem with the line of its field, where the file tells lines."""
    if source is None:
        return problem
    parts = [int(n) if n else name for n, name in _PART.findall(problem.field)]
    return replace(problem, where=source.where((*at, *parts)))
