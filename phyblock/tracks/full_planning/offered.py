"""What a candidate set shows before the goal is seen: its units, and what is to be told of each."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from phyblock.domain import BLOCK_TYPES, COLORS, Candidate, CandidateSet, Kind
from phyblock.words import Setting

__all__ = ["Unit", "units"]


@dataclass(frozen=True)
class Unit:
    """What a setting takes for one thing: a candidate in A, all candidates of a kind in B.

    `number` is that of the candidate, in B of the first of its kind. `poses` is how many
    candidates its kind has, `rank` its place among them from 0, `kinds` and `offered` how many
    kinds and candidates the whole set has, `alike` how many kinds of its type.
    """

    number: int
    candidate: Candidate
    poses: int
    rank: int
    kinds: int
    offered: int
    alike: int

    @property
    def numbers(self) -> tuple[float, ...]:
        """All of it as numbers, shape (16,), for learners that take no words."""
        one = self.candidate
        known = (self.number, self.poses, self.rank, self.kinds, self.offered, self.alike)
        words = (BLOCK_TYPES.index(one.type), COLORS.index(one.color))
        return (*map(float, (*known, *words)), *one.look[2])


def units(candidates: CandidateSet, setting: Setting) -> tuple[Unit, ...]:
    """The units of a candidate set under a setting, by their numbers."""
    poses = Counter(candidate.kind for candidate in candidates.candidates)
    alike = Counter(block_type for block_type, _ in poses)
    ranks: Counter[Kind] = Counter()
    found = []
    for number, one in enumerate(candidates.candidates, 1):
        rank = ranks[one.kind]
        ranks[one.kind] += 1
        if setting == "A" or rank == 0:
            about = (poses[one.kind], rank, len(poses), len(candidates), alike[one.type])
            found.append(Unit(number, one, *about))
    return tuple(found)
