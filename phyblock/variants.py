"""One way of asking among those that a suite varies: a choice of levels of its factors."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["REPEAT", "Variant"]

REPEAT = "repeats"
"""The factor that changes nothing that is sent: its levels ask the same again."""


@dataclass(frozen=True)
class Variant:
    """The factors in which a way of asking differs from the reference of its run, with levels.

    Another run may have another reference: only where two suites vary alike do names agree.
    """

    levels: tuple[tuple[str, str], ...] = ()

    @property
    def key(self) -> str:
        """What its run calls it: `background=lawn,repeats=2`, "" for the reference."""
        return ",".join(f"{factor}={level}" for factor, level in self.levels)

    @property
    def repeat(self) -> int:
        """For which time the same is asked, from 1."""
        return int(dict(self.levels).get(REPEAT, "1"))

    @property
    def shown(self) -> Variant:
        """What of it changes what is sent, alike for all repeats."""
        return Variant(tuple(pair for pair in self.levels if pair[0] != REPEAT))
