"""Plans: the ordered candidate numbers that a model proposes."""

from __future__ import annotations

from dataclasses import dataclass

from phyblock.domain.blocks import Euler


@dataclass(frozen=True)
class Plan:
    """The ordered 1-based candidate numbers of a model's steps; a number may repeat."""

    steps: tuple[int, ...] = ()

    def __len__(self) -> int:
        return len(self.steps)


@dataclass(frozen=True)
class PoseStep:
    """A candidate, by its 1-based number, and where it is to be put.

    `center_cm` is the center of the smallest box with sides along the axes that holds the block as
    it is turned [cm]; `euler_deg` are extrinsic x-y-z angles [degrees], None where the candidate's
    own orientation is kept.
    """

    candidate: int
    center_cm: tuple[float, float, float]
    euler_deg: Euler | None = None


@dataclass(frozen=True)
class PosePlan:
    """Steps in the order in which they are carried out."""

    steps: tuple[PoseStep, ...] = ()

    def __len__(self) -> int:
        return len(self.steps)
