"""What a candidate set shows before the goal is seen: its units, and what is to be told of each."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from phyblock.domain import BLOCK_TYPES, COLORS, Candidate, CandidateSet, Kind
from phyblock.types import Setting

__all__ = ["Unit", "units"]


@dataclass(frozen=True)
class Unit:
    """What a setting takes for one thing: a candidate in A, all candidates of a kind in B.

    `numbers` are those of its candidates, `candidate` the first of them. `poses` is how many
    candidates its kind has, `rank` its place among them from 0, `kinds` and `offered` how many
    kinds and candidates the whole set has, `alike` how many kinds of its type.
    """

    numbers: tuple[int, ...]
    candidate: Candidate
    poses: int
    rank: int
    kinds: int
    offered: int
    alike: int

    @property
    def place(self) -> int:
        """The number of its first candidate, from 1."""
        return self.numbers[0]

    @property
    def features(self) -> tuple[float, ...]:
        """All of it as numbers, 17 of them, for learners that take no words."""
        one = self.candidate
        known = (self.place, self.poses, self.rank, self.kinds, self.offered, self.alike)
        words = (BLOCK_TYPES.index(one.type), COLORS.index(one.color))
        return (*map(float, (*known, *words)), *one.look[2])


def units(candidates: CandidateSet, setting: Setting) -> tuple[Unit, ...]:
    """The units of a candidate set under a setting, by their numbers."""
    numbers: dict[Kind, list[int]] = {}
    for number, one in enumerate(candidates.candidates, 1):
        numbers.setdefault(one.kind, []).append(number)
    alike = Counter(block_type for block_type, _ in numbers)
    made = []
    for number, one in enumerate(candidates.candidates, 1):
        same = numbers[one.kind]
        rank = same.index(number)
        if setting == "A" or rank == 0:
            named = (number,) if setting == "A" else tuple(same)
            shown = (len(same), rank, len(numbers), len(candidates), alike[one.type])
            made.append(Unit(named, one, *shown))
    return tuple(made)
