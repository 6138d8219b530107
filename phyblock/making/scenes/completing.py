"""Scenes derived from the poses of their blocks: dependencies, layers, levels, an order."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from pydantic import Field, TypeAdapter

from phyblock.config.validation import ShapeName
from phyblock.config.yaml import FieldPath, read_yaml
from phyblock.data.base import read_data
from phyblock.data.scenes import (
    EITHER_NAME,
    MAX_BLOCKS,
    NAME,
    NAME_ALLOWED,
    Angles,
    CandidateList,
    Format,
    Levels,
    Name,
    Order,
    Position,
    StoredCandidate,
    candidate_set,
)
from phyblock.domain.blocks import Color
from phyblock.domain.scene import Block, CandidateSet, CycleError, Scene
from phyblock.errors import DataError, Problem, SpecError
from phyblock.making.checks import LEVEL_LIMITS, SceneFacts, findings_of
from phyblock.making.scenes.sketch import scene_of
from phyblock.records.record import Line, decode, validated

_SUFFIXES = (".yaml", ".yml", ".json", ".jsonl")
_ALLOWED = f"a file of scenes ({', '.join(_SUFFIXES)}), or a folder of such files"


class GivenBlock(Line, extra="forbid"):
    """A block at its goal pose; `layer` and `depend` may be given, but are derived anyway."""

    type: ShapeName
    color: Color
    position: Position
    euler: Annotated[Angles, EITHER_NAME] = (0.0, 0.0, 0.0)
    order: Order | None = None
    layer: Any = None
    depend: Any = None


class GivenScene(Line, extra="forbid"):
    """A goal structure; omitted fields are derived."""

    blocks: Annotated[tuple[GivenBlock, ...], Field(min_length=1, max_length=MAX_BLOCKS)]
    id: Name | None = None
    levels: Levels | None = None
    parents: tuple[Name, ...] = Field(default=(), max_length=100)
    candidates: CandidateList[StoredCandidate] | None = None
    format: Format = 1


class ReadScene(NamedTuple):
    """A scene that was read, with its name and its place in a file."""

    name: str
    given: GivenScene
    where: str


@dataclass(frozen=True)
class Completed:
    """A scene with all that was derived, or its problems; `notes` describe anything unusual."""

    scene: Scene | None = None
    offered: CandidateSet | None = None
    notes: tuple[str, ...] = ()
    problems: tuple[Problem, ...] = ()


def complete(read: ReadScene) -> Completed:
    """Derive a scene, and check that it can be built and stands.

    Problems are blocks that overlap, float or fall, contacts without order, and missing looks.
    """
    name, given, where = read
    try:
        scene = derived(name, given, where)
    except DataError as error:
        return Completed(problems=tuple(error.problems))
    offered = None if given.candidates is None else candidate_set(given.candidates)
    facts = SceneFacts(scene, offered)
    # Blocks that overlap or float fall as well: only the cause is reported.
    found = [*findings_of(facts, ("overlap", "floating", "order", "candidates"))]
    found = found or [*findings_of(facts, ("unstable step", "unstable"))]
    reorder = "order blocks so that each can be placed, and stands, after those before it"
    hints = {"order": reorder, "unstable step": reorder}
    noted = () if found else findings_of(facts, ("size", "hidden"))
    notes = (", ".join(filter(None, (one.message, one.found, one.allowed))) for one in noted)
    problems = (
        replace(
            one,
            where=where,
            message=f"scene {name}: {one.message}",
            hint=hints.get(one.check, ""),
        )
        for one in found
    )
    return Completed(scene, offered, tuple(notes), tuple(problems))


def derived(name: str, given: GivenScene, where: str) -> Scene:
    """Return the scene that blocks form at their poses; only their order is checked.

    If no block has an `order`, blocks are numbered as they are listed, each after those that it
    rests on. Raises DataError if contacts allow no order.
    """
    orders = [block.order for block in given.blocks if block.order is not None]
    if orders and (len(orders) < len(given.blocks) or len(set(orders)) < len(orders)):
        allowed = "a unique order for every block, or for none"
        raise DataError(Problem(where, f"scene {name}: blocks", "order", str(orders), allowed))
    blocks = [
        Block(order, one.type, one.color, one.position, one.euler, (), 1)
        for order, one in zip(orders or range(1, len(given.blocks) + 1), given.blocks, strict=True)
    ]
    try:
        scene = scene_of(name, (), blocks, given.parents)
    except CycleError as error:
        cycle = " -> ".join(str(blocks[v].order) for v in (*error.vertices, error.vertices[0]))
        message = f"scene {name}: blocks rest on one another in a circle"
        raise DataError(Problem(where, message, "blocks", cycle)) from None
    if not orders:
        placed: list[int] = []
        while ready := scene.graph.ready(sum(1 << vertex for vertex in placed)):
            placed.append(ready[0])
        sorted_blocks = [replace(blocks[v], order=n) for n, v in enumerate(placed, 1)]
        scene = scene_of(name, (), sorted_blocks, given.parents)
    fitting = (n for n in LEVEL_LIMITS if n > 1 and len(scene) <= LEVEL_LIMITS[n].most_blocks)
    return replace(scene, levels=given.levels or (next(fitting, max(LEVEL_LIMITS)),))


def read_given(path: Path) -> tuple[ReadScene, ...]:
    """Return all scenes of a file or folder, by name. Raises DataError with all problems.

    A scene without an `id` is named after its file, with its number if the file holds a list.
    """
    scenes: dict[str, ReadScene] = {}
    problems: list[Problem] = []
    files = sorted(path.iterdir()) if path.is_dir() else [path]
    for file in (one for one in files if one.is_file() and one.suffix in _SUFFIXES):
        try:
            for given, called, where in _read(file):
                name = given.id or called
                if given.id is None and not re.fullmatch(NAME, name):
                    message, hint = "has no id, and cannot be named after its file", "give it an id"
                    raise DataError(Problem(where, message, "id", name, NAME_ALLOWED, hint))
                if earlier := scenes.get(name):
                    message = f"is used by {earlier.where} already"
                    problems.append(Problem(where, message, "id", name))
                scenes[name] = ReadScene(name, given, where)
        except (DataError, SpecError) as error:
            problems += error.problems
    if not scenes and not problems:
        message = "holds no scenes" if path.exists() else "there is no such file or folder"
        problems.append(Problem(str(path), message, allowed=_ALLOWED))
    if problems:
        raise DataError(problems)
    return tuple(scenes[name] for name in sorted(scenes))


def _read(file: Path) -> Iterator[tuple[GivenScene, str, str]]:
    """Yield each scene of a file, a name made from the file's, and its place in it."""
    if file.suffix == ".jsonl":
        adapter = TypeAdapter(GivenScene)
        for number, line in enumerate(read_data(file, _ALLOWED).splitlines(), 1):
            where = f"{file}:{number}"
            yield decode(adapter, line, where, GivenScene), f"{file.stem}-{number}", where
        return
    source = read_yaml(file, may_hold_keys=True)
    data: Any = source.data
    at: FieldPath = ()
    if isinstance(data, dict) and "scenes" in data:
        at, data = ("scenes",), data["scenes"]
    is_list = isinstance(data, list)
    for number, raw in enumerate(data if is_list else [data]):
        name = f"{file.stem}-{number + 1}" if is_list else file.stem
        here = (*at, number) if is_list else at
        yield validated(GivenScene, raw, source, here), name, source.where(here)
