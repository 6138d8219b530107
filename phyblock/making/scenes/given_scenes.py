"""Scenes as people write them by hand: types, colors and poses, what else there is to be derived.

A file is YAML, JSON, or JSON with a scene a line; it holds one scene, a list of scenes, or
`scenes:` with a list.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from phyblock.config.yaml import YamlSource, read_yaml
from phyblock.datasets.raw import lines_of, parse_json, read_json
from phyblock.domain.blocks import BlockType, Color
from phyblock.domain.scene import Block
from phyblock.errors import DataError, Problem, SpecError
from phyblock.records import Line
from phyblock.records.data_values import (
    NAME_ALLOWED,
    Angles,
    Filled,
    Format,
    Name,
    Order,
    Position,
    is_name,
    triple,
)
from phyblock.records.faults import validated
from phyblock.records.scene import EITHER_NAME, MAX_BLOCKS, CandidateList, Levels

__all__ = ["GivenBlock", "GivenScene", "ReadScene", "read_given"]

_SUFFIXES = (".yaml", ".yml", ".json", ".jsonl")
_ALLOWED = f"a file of scenes ({', '.join(_SUFFIXES)}), or a folder of such files"
_PART = re.compile(r"\[(\d+)\]|([^.\[\]]+)")


class GivenBlock(Line, extra="forbid"):
    """A block at its goal pose; `layer` and `depend` may be there and are derived all the same."""

    type: BlockType
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

    blocks: Annotated[tuple[GivenBlock, ...], Filled(MAX_BLOCKS)]
    id: Name | None = None
    levels: Levels | None = None
    parents: tuple[Name, ...] = Field(default=(), max_length=100)
    candidates: CandidateList | None = None
    format: Format = 1

    @property
    def is_ordered(self) -> bool:
        """Whether every block says its `order`."""
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
        for number, line in enumerate(lines_of(file, _ALLOWED), 1):
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
