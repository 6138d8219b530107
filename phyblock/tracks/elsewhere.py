"""Another scene in the place of an item's own: what a wrong picture is taken from."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Sequence
from typing import Generic, TypeVar

from phyblock.errors import Problem, SpecError
from phyblock.stable import drawn_bytes
from phyblock.tracks.base import Item

__all__ = ["Elsewhere"]


AskedT = TypeVar("AskedT", bound=Item)


class Elsewhere(Generic[AskedT]):
    """Finds, for an item, another of its sort about a scene that shares no base scene with its own.

    `pool` are those to take from, `sort_of` says what makes two stand in for one another.
    """

    def __init__(self, pool: Iterable[AskedT], sort_of: Callable[[AskedT], Hashable]) -> None:
        self._sort_of = sort_of
        self._alike: dict[Hashable, list[AskedT]] = {}
        for one in pool:
            self._alike.setdefault(sort_of(one), []).append(one)
        self._others_of: dict[str, list[AskedT]] = {}

    def of(self, item: AskedT, seed: int) -> AskedT:
        """The one whose picture is shown: it depends on item and seed alone, not on the model."""
        others = self._others(item)
        digest = drawn_bytes("wrong image", seed, item.key)
        return others[int.from_bytes(digest, "big") % len(others)]

    def each(self, item: AskedT, seeds: Iterable[int]) -> tuple[AskedT, ...]:
        """Those whose pictures are shown with any of the seeds."""
        return tuple(self.of(item, seed) for seed in seeds)

    def check(self, items: Sequence[AskedT], noun: str, field: str) -> None:
        """Raise SpecError for the first item that has no other; `field` is that of the suite."""
        lacking = next((item for item in items if not self._others(item)), None)
        if lacking is not None:
            message = f"has no {noun} of the same kind about another scene to take pictures from"
            raise SpecError(Problem(f"{noun} {lacking.key}", message, field))

    def _others(self, item: AskedT) -> list[AskedT]:
        if item.key not in self._others_of:
            own = set(_parents(item))
            alike = self._alike.get(self._sort_of(item), ())
            self._others_of[item.key] = [one for one in alike if not own & set(_parents(one))]
        return self._others_of[item.key]


def _parents(item: Item) -> tuple[str, ...]:
    return item.scene.parents or (item.scene.id,)
