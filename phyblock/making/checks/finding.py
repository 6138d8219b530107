"""What a check finds wrong."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from phyblock.errors import Problem

CheckName = Literal[
    "size",
    "palette",
    "overlap",
    "floating",
    "undeclared dependency",
    "dependency without contact",
    "layer",
    "order",
    "unstable",
    "unstable step",
    "hidden",
    "duplicate",
    "parents",
    "candidates",
    "too many candidates",
    "distractor",
]
Declared = str | int | tuple[int, ...]
"""A value of the file, or what it should be: a text, a number, or orders of blocks."""


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong with a scene, and the one sentence that says so.

    `blocks` are orders of blocks, 0 the ground. `value` was measured and `tolerance` would have
    passed, both in `unit`. `field` is where the file says `declared`; `derived` is what geometry,
    physics or a limit says instead.
    """

    scene: str
    check: CheckName
    message: str
    blocks: tuple[int, ...] = ()
    value: float | None = None
    tolerance: float | None = None
    unit: str = ""
    field: str = ""
    declared: Declared = ""
    derived: Declared = ""

    @property
    def problem(self) -> Problem:
        """The finding as an error says it."""
        declared, derived = _shown(self.declared), _shown(self.derived)
        return Problem(self.scene, self.message, self.field, declared, derived)

    def __str__(self) -> str:
        return str(self.problem)


def _shown(value: Declared) -> str:
    """Orders as a list of the file; an empty list says nothing."""
    if isinstance(value, tuple):
        return str(list(value)) if value else ""
    return str(value)
