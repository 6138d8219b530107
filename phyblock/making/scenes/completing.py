"""Scenes derived from the poses of their blocks: dependencies, layers, levels, an order."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from phyblock.config.validation import ShapeName
from phyblock.config.yaml import FieldPath, read_yaml
from phyblock.data import scenes as stored
from phyblock.domain.blocks import Color
from phyblock.domain.scene import Block, CandidateSet, CycleError, Scene
from phyblock.errors import DataError, Problem
from phyblock.making.checks import LEVEL_LIMITS, SceneFacts, findings_of
from phyblock.making.scenes.sketch import scene_of
from phyblock.records.record import Line, validated

_LARGEST_BYTES = 16 * 1024 * 1024  # Thousands of scenes.


class GivenBlock(Line, extra="forbid"):
    """A block at its goal pose; `order`, `layer` and `depend` may be given, but are derived."""

    type: ShapeName
    color: Color
    position: stored.Position
    euler: Annotated[stored.Angles, stored.EITHER_NAME] = (0.0, 0.0, 0.0)
    order: Any = None
    layer: Any = None
    depend: Any = None


class GivenScene(Line, extra="forbid"):
    """A goal structure; omitted fields are derived."""

    id: stored.Name
    blocks: Annotated[tuple[GivenBlock, ...], Field(min_length=1, max_length=stored.MAX_BLOCKS)]
    levels: stored.Levels | None = None
    parents: tuple[stored.Name, ...] = Field(default=(), max_length=100)
    candidates: stored.CandidateList[stored.StoredCandidate] | None = None
    format: stored.Format = 1


@dataclass(frozen=True)
class Completed:
    """A scene with all that was derived, or its problems; `notes` describe anything unusual."""

    scene: Scene | None = None
    offered: CandidateSet | None = None
    notes: tuple[str, ...] = ()
    problems: tuple[Problem, ...] = ()


def complete(read: tuple[GivenScene, str]) -> Completed:
    """Derive a scene from its place in a file, and check that it can be built and stands.

    Problems are blocks that overlap, float or fall, contacts without order, and missing looks.
    """
    given, where = read
    try:
        scene = derived(given)
    except CycleError as error:
        cycle = " -> ".join(str(v + 1) for v in (*error.vertices, error.vertices[0]))
        message = f"scene {given.id}: blocks rest on one another in a circle"
        return Completed(problems=(Problem(where, message, "blocks", cycle),))
    offered = None if given.candidates is None else stored.candidate_set(given.candidates)
    facts = SceneFacts(scene, offered)
    # Blocks that overlap or float fall as well: only the cause is reported.
    found = [*findings_of(facts, ("overlap", "floating", "candidates"))]
    found = found or [*findings_of(facts, ("unstable step", "unstable"))]
    reorder = "list blocks so that each can be placed, and stands, after those before it"
    problems = []
    for one in found:
        hint = reorder if one.check == "unstable step" else ""
        message = f"scene {scene.id}: {one.message}"
        problems.append(replace(one, where=where, message=message, hint=hint))
    noted = () if found else findings_of(facts, ("size", "hidden"))
    notes = [
        f"scene {scene.id}: {', '.join(filter(None, (one.message, one.found, one.allowed)))}"
        for one in noted
    ]
    return Completed(scene, offered, tuple(notes), tuple(problems))


def derived(given: GivenScene) -> Scene:
    """Return the scene that blocks form at their poses, numbered as they are listed, each after
    those that it rests on. Raises CycleError, by places in the list, if contacts allow no order.
    """
    blocks = [
        Block(number, one.type, one.color, one.position, one.euler, (), 1)
        for number, one in enumerate(given.blocks, 1)
    ]
    fitting = (n for n in LEVEL_LIMITS if n > 1 and len(blocks) <= LEVEL_LIMITS[n].most_blocks)
    levels = given.levels or (next(fitting, max(LEVEL_LIMITS)),)
    graph = scene_of(given.id, levels, blocks).graph
    placed: list[int] = []
    while ready := graph.ready(sum(1 << vertex for vertex in placed)):
        placed.append(ready[0])
    ordered = [replace(blocks[vertex], order=n) for n, vertex in enumerate(placed, 1)]
    return scene_of(given.id, levels, ordered, given.parents)


def read_given(file: Path) -> list[tuple[GivenScene, str]]:
    """Return the scenes of a YAML or JSON file by id, with their places in it. Raises InputError.

    It holds a scene, a list, or a mapping with `scenes`; one without `id` is named after the file.
    """
    if file.suffix not in (".yaml", ".yml", ".json"):
        allowed = "a file of scenes: .yaml, .yml or .json"
        raise DataError(Problem(str(file), "is not such a file", allowed=allowed))
    source = read_yaml(file, _LARGEST_BYTES, may_hold_keys=True)
    data: Any = source.data
    at: FieldPath = ()
    if isinstance(data, dict) and "scenes" in data:
        at, data = ("scenes",), data["scenes"]
    is_list = isinstance(data, list)
    scenes: dict[str, tuple[GivenScene, str]] = {}
    for number, raw in enumerate(data if is_list else [data]):
        here = (*at, number) if is_list else at
        name = f"{file.stem}-{number + 1}" if is_list else file.stem
        named = {"id": name, **raw} if isinstance(raw, dict) else raw
        if named is not raw and "id" not in raw and not re.fullmatch(stored.NAME, name):
            where, message = source.where(here), "has no id, and cannot be named after its file"
            raise DataError(Problem(where, message, "id", name, stored.NAME_ALLOWED))
        given, where = validated(GivenScene, named, source, here), source.where(here)
        if given.id in scenes:
            message = f"is used by {scenes[given.id][1]} already"
            raise DataError(Problem(where, message, "id", given.id))
        scenes[given.id] = given, where
    if not scenes:
        raise DataError(Problem(str(file), "holds no scenes"))
    return [scenes[name] for name in sorted(scenes)]
