"""The checks of scenes beside one another."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from phyblock.domain.scene import Scene
from phyblock.making.checks.finding import Finding
from phyblock.making.symmetry import find_twins

__all__ = ["find_duplicates", "find_orphans"]


def find_duplicates(scenes: Iterable[Scene]) -> tuple[Finding, ...]:
    """Scenes that equal an earlier one up to quarter turns, mirroring and shifting."""
    return tuple(
        Finding(
            name, "duplicate", f"is scene {twin}, turned, mirrored or shifted at most", derived=twin
        )
        for name, twin in find_twins(scenes).items()
    )


def find_orphans(scenes: Sequence[Scene]) -> Iterator[Finding]:
    """Scenes whose parents are not base scenes of the same set."""
    bases = {scene.id for scene in scenes if scene.parents == (scene.id,)}
    for scene in scenes:
        strange = [parent for parent in scene.parents if parent not in bases]
        if strange or not scene.parents:
            message = "name no base scene of the set"
            yield Finding(scene.id, "parents", message, field="parents", declared=str(strange))
