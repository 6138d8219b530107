"""Raw JSON values -> Scene and CandidateSet; whatever is broken is said, nothing is trusted."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, cast

from phyblock.domain import (
    BLOCK_TYPES,
    COLORS,
    MAX_CANDIDATES,
    AOVGraph,
    Block,
    BlockType,
    Candidate,
    CandidateSet,
    Color,
    CycleError,
    Scene,
)
from phyblock.errors import DataError, Problem

__all__ = ["MAX_BLOCKS", "RawReader", "check_solvable", "read_json"]

MAX_BLOCKS = 22
_SHOWN = 80


class RawReader:
    """Reads one raw object and collects what is wrong with it.

    The methods return a usable value or None; call `raise_if_broken` before trusting any.
    """

    def __init__(self, where: str) -> None:
        self.where = where
        self.problems: list[Problem] = []

    def complain(self, field: str, message: str, found: object = None, allowed: str = "") -> None:
        """Note one problem."""
        shown = "" if found is None else _show(found)
        self.problems.append(Problem(self.where, message, field, shown, allowed))

    def raise_if_broken(self) -> None:
        """Raise DataError with everything that was noted, if anything was."""
        if self.problems:
            raise DataError(self.problems)

    def get(self, raw: object, field: str, prefix: str = "") -> Any:
        """`raw[field]`, or None after a complaint that it is missing."""
        if not isinstance(raw, Mapping):
            self.complain(prefix.rstrip("."), "is not an object", raw, "an object")
            return None
        if field not in raw:
            self.complain(prefix + field, "is missing", sorted(map(str, raw)), f"a field {field!r}")
            return None
        return raw[field]

    def integer(self, value: object, field: str, low: int, high: int | None = None) -> int | None:
        """An integer in low..high."""
        fits = isinstance(value, int) and not isinstance(value, bool) and value >= low
        if fits and (high is None or cast(int, value) <= high):
            return cast(int, value)
        allowed = f"an integer of at least {low}" if high is None else f"an integer {low} to {high}"
        self.complain(field, "is not an allowed number", value, allowed)
        return None

    def choice(self, value: object, field: str, allowed: Sequence[str]) -> str | None:
        """One of the allowed words."""
        if isinstance(value, str) and value in allowed:
            return value
        self.complain(field, "is not known", value, ", ".join(allowed))
        return None

    def vector(self, value: object, field: str) -> tuple[float, float, float] | None:
        """Three finite numbers."""
        if isinstance(value, list | tuple) and len(value) == 3:
            numbers = [v for v in value if isinstance(v, int | float) and not isinstance(v, bool)]
            if len(numbers) == 3 and all(map(math.isfinite, numbers)):
                x, y, z = map(float, numbers)
                return (x, y, z)
        self.complain(field, "is not a vector", value, "three finite numbers")
        return None

    def items(self, value: object, field: str) -> list[Any]:
        """A non-empty list."""
        if isinstance(value, list) and value:
            return value
        self.complain(field, "is not a non-empty list", value, "a list with at least one entry")
        return []

    def blocks(self, raw: object, *, strict_layers: bool) -> tuple[Block, ...]:
        """The blocks of a scene, with a graph that is known to be sound."""
        entries = self.items(raw, "blocks")
        if len(entries) > MAX_BLOCKS:
            self.complain("blocks", "are too many", len(entries), f"at most {MAX_BLOCKS}")
        blocks = [self._block(entry, f"blocks[{i}]") for i, entry in enumerate(entries)]
        if self.problems:
            return ()
        whole = tuple(cast(Block, block) for block in blocks)
        self._check_graph(whole)
        if strict_layers and not self.problems:
            self._check_layers(whole)
        return whole

    def candidates(self, raw: object) -> CandidateSet:
        """A candidate set: at most 16, no two alike."""
        entries = self.items(raw, "candidates")
        if len(entries) > MAX_CANDIDATES:
            self.complain("candidates", "are too many", len(entries), f"at most {MAX_CANDIDATES}")
        found = [self._candidate(entry, f"candidates[{i}]") for i, entry in enumerate(entries)]
        whole = CandidateSet(tuple(candidate for candidate in found if candidate is not None))
        first: dict[object, int] = {}
        for index, candidate in enumerate(whole.candidates, 1):
            if candidate.look in first:
                self.complain(
                    f"candidates[{index - 1}]",
                    f"looks the same as candidate {first[candidate.look]}",
                    [candidate.type, candidate.color, list(candidate.euler_deg)],
                    "candidates that differ in type, color or orientation",
                )
            first.setdefault(candidate.look, index)
        return whole

    def _block(self, raw: object, at: str) -> Block | None:
        before = len(self.problems)
        order = self.integer(self.get(raw, "order", f"{at}."), f"{at}.order", 1)
        kind, color = self._kind(raw, at)
        layer = self.integer(self.get(raw, "layer", f"{at}."), f"{at}.layer", 1)
        position = self.vector(self.get(raw, "position", f"{at}."), f"{at}.position")
        euler = self._euler(raw, at)
        depend = self._depend(self.get(raw, "depend", f"{at}."), f"{at}.depend")
        if len(self.problems) > before or not (order and layer and position and euler):
            return None
        if depend is None:
            return None
        return Block(order, kind, color, position, euler, depend, layer)

    def _candidate(self, raw: object, at: str) -> Candidate | None:
        before = len(self.problems)
        kind, color = self._kind(raw, at)
        euler = self._euler(raw, at)
        if len(self.problems) > before or euler is None:
            return None
        return Candidate(kind, color, euler)

    def _kind(self, raw: object, at: str) -> tuple[BlockType, Color]:
        kind = self.choice(self.get(raw, "type", f"{at}."), f"{at}.type", BLOCK_TYPES)
        color = self.choice(self.get(raw, "color", f"{at}."), f"{at}.color", COLORS)
        return cast(BlockType, kind), cast(Color, color)

    def _euler(self, raw: object, at: str) -> tuple[float, float, float] | None:
        # The paper's text calls the field `orientation`, the released files `euler`.
        named = isinstance(raw, Mapping) and "orientation" in raw and "euler" not in raw
        field = "orientation" if named else "euler"
        return self.vector(self.get(raw, field, f"{at}."), f"{at}.{field}")

    def _depend(self, raw: object, field: str) -> tuple[int, ...] | None:
        orders = [self.integer(entry, field, 0) for entry in self.items(raw, field)]
        if not orders or None in orders:
            return None
        return tuple(order for order in orders if order)

    def _check_graph(self, blocks: Sequence[Block]) -> None:
        orders = [block.order for block in blocks]
        for i, block in enumerate(blocks):
            if block.order in orders[:i]:
                self.complain(f"blocks[{i}].order", "is used twice", block.order, "unique orders")
            for order in block.depend:
                if order not in orders:
                    known = "0 (the ground) or an order of the scene: " + ", ".join(
                        map(str, sorted(orders))
                    )
                    self.complain(f"blocks[{i}].depend", "names no block", order, known)
        if self.problems:
            return
        try:
            AOVGraph(tuple(frozenset(orders.index(order) for order in b.depend) for b in blocks))
        except CycleError as error:
            cycle = " -> ".join(str(orders[v]) for v in (*error.vertices, error.vertices[0]))
            at = f"blocks[{error.vertices[0]}].depend"
            self.complain(at, "is part of a cycle", cycle, "dependencies without a cycle")

    def _check_layers(self, blocks: tuple[Block, ...]) -> None:
        layers = Scene("", (2,), blocks, ()).graph.layers
        for i, (block, layer) in enumerate(zip(blocks, layers, strict=True)):
            if block.layer != layer:
                wanted = f"{layer}, the longest path of dependencies"
                self.complain(f"blocks[{i}].layer", "is wrong", block.layer, wanted)


def check_solvable(reader: RawReader, scene: Scene, candidates: CandidateSet) -> None:
    """Complain about every block of the scene that no candidate can stand for."""
    for order in candidates.missing(scene):
        block = next(block for block in scene.blocks if block.order == order)
        reader.complain(
            "candidates",
            f"hold nothing that block {order} of scene {scene.id} needs",
            [block.type, block.color, list(block.euler_deg)],
            "every type, color and orientation that the scene uses",
        )


def read_json(path: Path) -> Any:
    """The JSON value in `path`; DataError when it cannot be read or holds NaN or bad syntax."""
    try:
        return json.loads(path.read_bytes())
    except OSError as error:
        raise DataError(Problem(str(path), f"cannot be read: {error.strerror}")) from error
    except UnicodeDecodeError as error:
        raise DataError(Problem(str(path), f"is not UTF-8 text: {error.reason}")) from error
    except json.JSONDecodeError as error:
        where = f"{path}:{error.lineno}:{error.colno}"
        raise DataError(Problem(where, f"is not valid JSON: {error.msg}")) from error


def _show(value: object) -> str:
    text = json.dumps(value, default=str)
    return text if len(text) <= _SHOWN else text[: _SHOWN - 1] + "…"
