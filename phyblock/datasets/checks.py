"""Raw JSON values -> Scene and CandidateSet; whatever is broken is said, nothing is trusted."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

from phyblock.datasets.raw import RawReader
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

__all__ = ["MAX_BLOCKS", "SceneReader"]

MAX_BLOCKS = 22


class SceneReader(RawReader):
    """Reads the parts of a scene and its candidate set, and collects what is wrong with them."""

    def blocks(self, raw: object, *, strict_layers: bool) -> tuple[Block, ...]:
        """The blocks of a scene, with a graph that is known to be sound; () after a complaint."""
        before = len(self.problems)
        entries = self.items(raw, "blocks", MAX_BLOCKS)
        found = [self.block(entry, f"blocks[{i}]") for i, entry in enumerate(entries)]
        if len(self.problems) == before:
            whole = tuple(cast(Block, block) for block in found)
            self._check_orders(whole)
            self.check_dependencies(whole)
            if strict_layers and len(self.problems) == before:
                self.check_layers(whole)
        return whole if len(self.problems) == before else ()

    def block(self, entry: object, at: str) -> Block | None:
        """One block, alone; None after a complaint."""
        raw = self.mapping(entry, at)
        order = self.integer(self.get(raw, "order", f"{at}."), f"{at}.order", 1)
        kind, color = self._kind(raw, at)
        layer = self.integer(self.get(raw, "layer", f"{at}."), f"{at}.layer", 1)
        position = self.position(self.get(raw, "position", f"{at}."), f"{at}.position")
        euler = self._euler(raw, at)
        depend = self._depend(self.get(raw, "depend", f"{at}."), f"{at}.depend")
        if order is None or kind is None or color is None or layer is None:
            return None
        if position is None or euler is None or depend is None:
            return None
        return Block(order, kind, color, position, euler, depend, layer)

    def candidates(self, raw: object) -> CandidateSet:
        """A candidate set: at most 16, no two alike; empty after a complaint."""
        before = len(self.problems)
        entries = self.items(raw, "candidates", MAX_CANDIDATES)
        found = [self._candidate(entry, f"candidates[{i}]") for i, entry in enumerate(entries)]
        first: dict[object, int] = {}
        for i, candidate in enumerate(found):
            if candidate is None:
                continue
            number = first.setdefault(candidate.look, i + 1)
            if number != i + 1:
                self.complain(
                    f"candidates[{i}]",
                    f"looks the same as candidate {number}",
                    [candidate.type, candidate.color, list(candidate.euler_deg)],
                    "candidates that differ in type, color or orientation",
                )
        sound = len(self.problems) == before
        return CandidateSet(tuple(cast(list[Candidate], found)) if sound else ())

    def check_solvable(self, scene: Scene, candidates: CandidateSet) -> None:
        """Complain about every block of the scene that no candidate can stand for."""
        missing = candidates.missing(scene)
        for block in scene.blocks:
            if block.order in missing:
                self.complain(
                    "candidates",
                    f"hold nothing that block {block.order} of scene {scene.id} needs",
                    [block.type, block.color, list(block.euler_deg)],
                    "every type, color and orientation that the scene uses",
                )

    def _candidate(self, entry: object, at: str) -> Candidate | None:
        raw = self.mapping(entry, at)
        kind, color = self._kind(raw, at)
        euler = self._euler(raw, at)
        if kind is None or color is None or euler is None:
            return None
        return Candidate(kind, color, euler)

    def _kind(self, raw: Any, at: str) -> tuple[BlockType | None, Color | None]:
        kind = self.choice(self.get(raw, "type", f"{at}."), f"{at}.type", BLOCK_TYPES)
        color = self.choice(self.get(raw, "color", f"{at}."), f"{at}.color", COLORS)
        return cast(BlockType | None, kind), cast(Color | None, color)

    def _euler(self, raw: Any, at: str) -> tuple[float, float, float] | None:
        # The paper's text calls the field `orientation`, the released files `euler`.
        named = isinstance(raw, dict) and "orientation" in raw and "euler" not in raw
        field = "orientation" if named else "euler"
        return self.angles(self.get(raw, field, f"{at}."), f"{at}.{field}")

    def _depend(self, raw: object, field: str) -> tuple[int, ...] | None:
        entries = enumerate(self.items(raw, field, MAX_BLOCKS))
        orders = [self.integer(entry, f"{field}[{i}]", 0) for i, entry in entries]
        if not orders or None in orders:
            return None
        return tuple(order for order in orders if order)

    def _check_orders(self, blocks: Sequence[Block]) -> None:
        orders = [block.order for block in blocks]
        for i, block in enumerate(blocks):
            if block.order in orders[:i]:
                self.complain(f"blocks[{i}].order", "is used twice", block.order, "unique orders")

    def check_dependencies(self, blocks: tuple[Block, ...]) -> None:
        """Complain about dependencies that name no block or run in a circle; orders are unique."""
        before = len(self.problems)
        orders = [block.order for block in blocks]
        for i, block in enumerate(blocks):
            for order in block.depend:
                if order not in orders:
                    known = "0 (the ground) or an order of the scene: " + ", ".join(
                        map(str, sorted(orders))
                    )
                    self.complain(f"blocks[{i}].depend", "names no block", order, known)
        if len(self.problems) > before:
            return
        try:
            AOVGraph(tuple(frozenset(orders.index(order) for order in b.depend) for b in blocks))
        except CycleError as error:
            cycle = " -> ".join(str(orders[v]) for v in (*error.vertices, error.vertices[0]))
            at = f"blocks[{error.vertices[0]}].depend"
            self.complain(at, "is part of a cycle", cycle, "dependencies without a cycle")

    def check_layers(self, blocks: tuple[Block, ...]) -> None:
        """Complain about every layer that is not the longest path; dependencies are sound."""
        layers = Scene("", (2,), blocks, ()).graph.layers
        for i, (block, layer) in enumerate(zip(blocks, layers, strict=True)):
            if block.layer != layer:
                wanted = f"{layer}, the longest path of dependencies"
                self.complain(f"blocks[{i}].layer", "is wrong", block.layer, wanted)
