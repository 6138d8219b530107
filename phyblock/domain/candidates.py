"""Candidate sets: the numbered dictionary of blocks a model chooses from."""

from __future__ import annotations

from dataclasses import dataclass

from phyblock.domain.blocks import BlockType, Color, Euler
from phyblock.domain.scene import Kind, Look, Oriented, Scene

__all__ = ["MAX_CANDIDATES", "Candidate", "CandidateSet"]

MAX_CANDIDATES = 16


@dataclass(frozen=True)
class Candidate(Oriented):
    """One block of the dictionary: a type, a color and an orientation [degrees]."""

    type: BlockType
    color: Color
    euler_deg: Euler


@dataclass(frozen=True)
class CandidateSet:
    """At most 16 distinct candidates, numbered from 1 in the order given."""

    candidates: tuple[Candidate, ...]

    def __len__(self) -> int:
        return len(self.candidates)

    def __getitem__(self, index: int) -> Candidate:
        """The candidate with the 1-based number `index`; IndexError outside 1..n."""
        if not 1 <= index <= len(self.candidates):
            raise IndexError(f"candidate {index} is outside 1..{len(self.candidates)}")
        return self.candidates[index - 1]

    def index_of(self, look: Look) -> int | None:
        """The 1-based number of the first candidate that looks like `look`, or None."""
        return next((i for i, c in enumerate(self.candidates, 1) if c.look == look), None)

    def first_of(self, kind: Kind) -> int | None:
        """The 1-based number of the first candidate of a kind, or None."""
        return next((i for i, c in enumerate(self.candidates, 1) if c.kind == kind), None)

    def missing(self, scene: Scene) -> tuple[int, ...]:
        """Orders of the scene's blocks that no candidate can stand for in setting A."""
        looks = {candidate.look for candidate in self.candidates}
        return tuple(block.order for block in scene.blocks if block.look not in looks)
