"""Plans: the ordered candidate numbers that a model proposes."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Plan"]


@dataclass(frozen=True)
class Plan:
    """The ordered 1-based candidate numbers of a model's steps; a number may repeat."""

    steps: tuple[int, ...] = ()

    def __len__(self) -> int:
        return len(self.steps)
