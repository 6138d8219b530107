"""Building one block at a time: what a move does, under a setting and a gating.

A move names a candidate, not a block, so several goal blocks can be what it placed. An assembly
keeps every set of placed blocks that explains the moves that succeeded (as the `optimal` matcher
does for whole plans) and lets a move succeed when one of them allows it: then no valid order can
fail. One of these sets is the world that is shown; where only another one allows a move, blocks
that look alike change places.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from phyblock.domain import CandidateSet, Scene
from phyblock.scoring.error_types import ERROR_TYPES, ErrorType, error_type
from phyblock.scoring.goal import Goal
from phyblock.scoring.metrics import Counts
from phyblock.types import Gating, Setting

__all__ = [
    "MOVE_OUTCOMES",
    "Assembly",
    "Move",
    "MoveOutcome",
    "attempted_counts",
    "gated",
    "placed_counts",
]

MoveOutcome = Literal["placed", "invalid"] | ErrorType
MOVE_OUTCOMES: tuple[MoveOutcome, ...] = ("placed", *ERROR_TYPES, "invalid")


@dataclass(frozen=True)
class Move:
    """What one move did: `vertex` is the goal block that it put into the world, or None.

    `swapped` are the pairs (from, to) of vertices by which earlier blocks changed places, so that
    this move could succeed.
    """

    outcome: MoveOutcome
    vertex: int | None = None
    swapped: tuple[tuple[int, int], ...] = ()


def gated(scene: Scene, gating: Gating) -> Scene:
    """The scene whose graph says what may be placed when.

    `aov` is the scene itself: a block waits for those it depends on. Under `layer` it waits for
    all blocks of the layers below, as in the official code; layers are longest paths of
    dependencies, with which some official files disagree.
    """
    if gating == "aov":
        return scene
    layers = scene.graph.layers
    below = {
        layer: tuple(
            block.order for block, at in zip(scene.blocks, layers, strict=True) if at < layer
        )
        for layer in set(layers)
    }
    blocks = tuple(
        replace(block, depend=below[layer])
        for block, layer in zip(scene.blocks, layers, strict=True)
    )
    return replace(scene, blocks=blocks)


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
        self._above = tuple(mask.bit_count() - 1 for mask in self._goal.above)
        carried = _carried(self._goal)
        self._roles = [(b.look, carried[v]) for v, b in enumerate(scene.blocks)]

    @property
    def is_complete(self) -> bool:
        """Whether every block of the goal is placed."""
        return len(self.chosen) == len(self.scene)

    @property
    def vertices(self) -> tuple[int, ...]:
        """The goal vertices that are placed in the world as shown, in file order."""
        return tuple(v for v in range(len(self.scene)) if self.placed >> v & 1)

    def right_moves(self) -> tuple[int, ...]:
        """The candidate numbers that would be placed now."""
        numbers = range(1, len(self.candidates) + 1)
        return tuple(n for n in numbers if any(self._goal.choices(n, m) for m in self._frontier))

    def exact_moves(self) -> tuple[int, ...]:
        """The right moves that look just like a block that can be placed in the world as shown."""
        ready = self._goal.graph.ready(self.placed)
        looks = {self.scene.blocks[vertex].look for vertex in ready}
        return tuple(n for n in self.right_moves() if self.candidates[n].look in looks)

    def move(self, index: int) -> Move:
        """Try to place a candidate; a wrong move changes nothing and says what is wrong.

        `index` may be any number: one that no candidate has is `invalid`.
        """
        if not 1 <= index <= len(self.candidates):
            return Move("invalid")
        reached = {
            mask | 1 << vertex for mask in self._frontier for vertex in self._choices(index, mask)
        }
        if not reached:
            goal = self._goal
            return Move(error_type(goal.of_kind[index], goal.equal[index], self.placed))
        before = self.placed
        self._frontier = reached
        self.chosen.append(index)
        return self._show(index, before)

    def _choices(self, index: int, mask: int) -> list[int]:
        """What a candidate can be placed as: of blocks that look alike and carry the same ones,
        the first, for they are interchangeable.
        """
        choices = self._goal.choices(index, mask)
        if len(choices) < 2:
            return choices
        return list({self._roles[v]: v for v in reversed(choices)}.values())

    def _show(self, index: int, before: int) -> Move:
        """Bring the world to one of the sets that explain all moves, with the least change."""
        if open_to := self._choices(index, before):
            look, blocks = self.candidates[index].look, self.scene.blocks
            vertex = max(open_to, key=lambda v: (blocks[v].look == look, self._above[v], -v))
            self.placed = before | 1 << vertex
            return Move("placed", vertex)
        self.placed = min(self._frontier, key=lambda mask: ((before & ~mask).bit_count(), mask))
        entered = list(_bits(self.placed & ~before))
        pairs: list[tuple[int, int]] = []
        for left in _bits(before & ~self.placed):
            twin = next(v for v in entered if self._alike(left, v))
            entered.remove(twin)
            pairs.append((left, twin))
        return Move("placed", entered[0], tuple(pairs))

    def _alike(self, one: int, other: int) -> bool:
        blocks = self.scene.blocks
        if self.setting == "A":
            return blocks[one].look == blocks[other].look
        return blocks[one].kind == blocks[other].kind


def placed_counts(
    scene: Scene,
    candidates: CandidateSet,
    setting: Setting,
    chosen: Sequence[int],
    fallen: Sequence[int] = (),
) -> Counts:
    """Counts over the blocks in the world, made of the candidates `chosen` (Table 3's layout).

    The world has seen to the order, so a block is a true positive when the goal has one that is
    equal under the setting, one-to-one. The vertices `fallen` no longer stand where they belong:
    the candidates that were placed there are false positives, whatever they are.
    """
    attribute = "look" if setting == "A" else "kind"
    standing = list(chosen)
    for block in (scene.blocks[vertex] for vertex in fallen):
        alike = [n for n in standing if candidates[n].look == block.look]
        standing.remove((alike or [n for n in standing if candidates[n].kind == block.kind])[-1])
    wanted = Counter(getattr(block, attribute) for block in scene.blocks)
    have = Counter(getattr(candidates[index], attribute) for index in standing)
    tp = sum((wanted & have).values())
    return Counts(tp, len(chosen) - tp, len(scene) - tp)


def attempted_counts(placed: Counts, attempts: int) -> Counts:
    """Counts over every attempted move, those that placed nothing being false positives too."""
    return Counts(placed.tp, attempts - placed.tp, placed.fn)


def _carried(goal: Goal) -> tuple[int, ...]:
    """For each vertex, the bit mask of those that directly wait for it."""
    needed, n = goal.graph.needed_masks, len(goal.graph)
    return tuple(sum((needed[w] >> v & 1) << w for w in range(n)) for v in range(n))


def _bits(mask: int) -> Iterator[int]:
    return (v for v in range(mask.bit_length()) if mask >> v & 1)
