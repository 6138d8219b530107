"""Building one block at a time: the effect of a move, under a setting and a gating.

A move names a candidate, not a block, so it may have placed any of several goal blocks. An assembly
keeps every set of placed blocks that explains the moves that succeeded (as the `optimal` matcher
does for whole plans); a move succeeds when one of them allows it, so no valid order can fail. One
set is the world that is shown; if only another one allows a move, equal blocks change places.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Literal, NamedTuple

from phyblock.domain.scene import CandidateSet, Scene
from phyblock.scoring.plan import ERROR_TYPES, Counts, ErrorType, Goal
from phyblock.types import Gating, Setting

MoveOutcome = Literal["placed", "invalid"] | ErrorType
MOVE_OUTCOMES: tuple[MoveOutcome, ...] = ("placed", *ERROR_TYPES, "invalid")


class Move(NamedTuple):
    """The effect of one move: `vertex` is the goal block that it placed, or None.

    `swapped` are pairs (from, to) of vertices between which earlier blocks changed places for it.
    """

    outcome: MoveOutcome
    vertex: int | None = None
    swapped: tuple[tuple[int, int], ...] = ()


def gated(scene: Scene, gating: Gating) -> Scene:
    """Return the scene with the dependencies of the gating.

    `aov` is the scene itself. Under `layer`, a block waits for all lower layers, as in the official
    code; layers are longest paths of dependencies, with which some official files disagree.
    """
    if gating == "aov":
        return scene
    layers = scene.graph.layers
    at = list(zip(scene.blocks, layers, strict=True))
    below = {n: tuple(block.order for block, layer in at if layer < n) for n in set(layers)}
    return replace(scene, blocks=tuple(replace(block, depend=below[layer]) for block, layer in at))


class Assembly:
    """A scene being built, move by move; sets of blocks are bit masks over its vertices.

    `placed` is the world as it is shown; `chosen` the candidate numbers that were placed, in order.
    """

    def __init__(
        self, scene: Scene, candidates: CandidateSet, setting: Setting, gating: Gating = "aov"
    ) -> None:
        self.scene = scene
        self.candidates = candidates
        self.setting = setting
        self.placed = 0
        self.chosen: list[int] = []
        self._goal = Goal(gated(scene, gating), candidates, setting)
        self._frontier = {0}
        self._above = tuple(mask.bit_count() - 1 for mask in self._goal.graph.above)
        self._roles = [(b.look, self._goal.graph.unlocks[v]) for v, b in enumerate(scene.blocks)]

    @property
    def is_complete(self) -> bool:
        """True if every block of the goal is placed."""
        return len(self.chosen) == len(self.scene)

    @property
    def vertices(self) -> tuple[int, ...]:
        """The goal vertices that are placed in the world as shown, in file order."""
        return tuple(_bits(self.placed))

    def right_moves(self) -> tuple[int, ...]:
        """The candidate numbers that would be placed now."""
        numbers = range(1, len(self.candidates) + 1)
        return tuple(n for n in numbers if any(self._goal.choices(n, m) for m in self._frontier))

    def exact_moves(self) -> tuple[int, ...]:
        """The right moves that look like a block that can be placed in the world as shown."""
        ready = self._goal.graph.ready(self.placed)
        looks = {self.scene.blocks[vertex].look for vertex in ready}
        return tuple(n for n in self.right_moves() if self.candidates[n].look in looks)

    def move(self, index: int) -> Move:
        """Try to place a candidate; a wrong move changes nothing but names the error.

        `index` may be any number: one that no candidate has is `invalid`.
        """
        if not 1 <= index <= len(self.candidates):
            return Move("invalid")
        reached = {mask | 1 << v for mask in self._frontier for v in self._choices(index, mask)}
        if not reached:
            return Move(self._goal.error(index, self.placed))
        before = self.placed
        self._frontier = reached
        self.chosen.append(index)
        # The world becomes one of the sets that explain all moves, with the least change.
        blocks = self.scene.blocks
        if open_to := self._choices(index, before):
            look = self.candidates[index].look
            vertex = max(open_to, key=lambda v: (blocks[v].look == look, self._above[v], -v))
            self.placed = before | 1 << vertex
            return Move("placed", vertex)
        self.placed = min(self._frontier, key=lambda mask: ((before & ~mask).bit_count(), mask))
        attribute = "look" if self.setting == "A" else "kind"
        entered = list(_bits(self.placed & ~before))
        pairs: list[tuple[int, int]] = []
        for left in _bits(before & ~self.placed):
            mine = getattr(blocks[left], attribute)
            twin = next(v for v in entered if getattr(blocks[v], attribute) == mine)
            entered.remove(twin)
            pairs.append((left, twin))
        return Move("placed", entered[0], tuple(pairs))

    def _choices(self, index: int, mask: int) -> list[int]:
        """Vertices a candidate can be placed as, one of each group that is interchangeable."""
        choices = self._goal.choices(index, mask)
        if len(choices) < 2:
            return choices
        return list({self._roles[v]: v for v in reversed(choices)}.values())


def placed_counts(
    scene: Scene,
    candidates: CandidateSet,
    setting: Setting,
    chosen: Sequence[int],
    fallen: Sequence[int] = (),
) -> Counts:
    """Counts over the blocks in the world, made of the candidates `chosen` (Table 3's layout).

    The world enforces the order, so a block is a true positive if the goal has an equal one,
    one-to-one. The vertices `fallen` have collapsed: candidates placed there are false positives.
    """
    attribute = "look" if setting == "A" else "kind"
    standing = list(chosen)
    for block in (scene.blocks[vertex] for vertex in fallen):
        matching = [n for n in standing if candidates[n].look == block.look]
        standing.remove((matching or [n for n in standing if candidates[n].kind == block.kind])[-1])
    wanted = Counter(getattr(block, attribute) for block in scene.blocks)
    have = Counter(getattr(candidates[index], attribute) for index in standing)
    tp = sum((wanted & have).values())
    return Counts(tp, len(chosen) - tp, len(scene) - tp)


def _bits(mask: int) -> Iterator[int]:
    return (v for v in range(mask.bit_length()) if mask >> v & 1)
