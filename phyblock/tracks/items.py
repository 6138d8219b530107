"""Items: those that a run asks about, their order, and how a seed shows them.

A seed can show a scene with its candidates in another order, or without its goal. All that depends
on it (pictures, prompt, the reading of a reply, its scores) is made from a `ShownTask`, whose
candidates are numbered as the model saw them. Only records know the numbers in the file.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from typing import Protocol, TypeVar

from phyblock.config.suite import Suite
from phyblock.data.base import AssemblyTask
from phyblock.domain.scene import CandidateSet, Scene
from phyblock.errors import DataError, Problem
from phyblock.records.record import Record
from phyblock.stable import drawn_bytes
from phyblock.types import CandidateOrder


class Item(Protocol):
    """The subject of a sample: a scene with its candidates, or a question."""

    @property
    def key(self) -> str:
        """Its name inside the track."""

    @property
    def scene(self) -> Scene:
        """The scene it is about, by whose parents statistics cluster."""


ItemT = TypeVar("ItemT", bound=Item)


def select_tasks(
    tasks: Sequence[AssemblyTask], suite: Suite, limit: int | None
) -> tuple[AssemblyTask, ...]:
    """Return the tasks of a suite's levels and difficulty, at most `limit`, in their order.

    They are evenly spread, and a higher limit keeps all that a lower one keeps.
    """
    levels, difficulty = set(suite.levels), suite.dataset.difficulty
    chosen = [task for task in tasks if levels & set(task.scene.levels)]
    if difficulty.ranges:
        from phyblock.tracks.difficulty import is_within  # Few suites ask for it.

        chosen = [task for task in chosen if is_within(task, difficulty)]
    kept = set(_fair_order([task.scene.level for task in chosen])[:limit])
    return tuple(task for position, task in enumerate(chosen) if position in kept)


def interleaved(items: Sequence[ItemT]) -> list[ItemT]:
    """Return items in an order in which any first few are a fair sample of levels and scenes."""
    return [items[position] for position in _fair_order([item.scene.level for item in items])]


def stratified(sizes: Sequence[int], limit: int) -> list[int]:
    """Return `limit` places shared among groups of the given sizes, as `_fair_order` shares."""
    groups = [group for group, size in enumerate(sizes) for _ in range(size)]
    chosen = [groups[position] for position in _fair_order(groups)[:limit]]
    return [chosen.count(group) for group in range(len(sizes))]


def spread(size: int) -> list[int]:
    """Return the positions 0 to `size` - 1, of which any first few are evenly spread.

    They are taken at 0, 1/2, 1/4, 3/4, 1/8, ... of the size: the sequence of van der Corput (1935).
    """
    digits = max(1, (size - 1).bit_length())
    parts = (int(f"{i:0{digits}b}"[::-1], 2) for i in range(2**digits))
    return list(dict.fromkeys(part * size // 2**digits for part in parts))


def _fair_order(strata: Sequence[int]) -> list[int]:
    """Return all positions: strata in turn by their sizes, positions of each evenly spread.

    Every stratum gets one place before any gets two; then each place goes to the stratum that has
    least for its size (Webster's method, which is monotone in the number of places).
    """
    members: dict[int, list[int]] = {}
    for position, stratum in enumerate(strata):
        members.setdefault(stratum, []).append(position)
    places = sorted(
        (rank > 0, Fraction(2 * rank + 1, len(of_stratum)), stratum, of_stratum[place])
        for stratum, of_stratum in members.items()
        for rank, place in enumerate(spread(len(of_stratum)))
    )
    return [position for *_, position in places]


@dataclass(frozen=True)
class ShownTask(AssemblyTask):
    """A task in another form than the file's.

    `candidates` are in the order shown, which `seed` drew, and `order` holds the number in the file
    of each of them; the goal is not shown where it `is_blind`.
    """

    order: tuple[int, ...] = ()
    is_blind: bool = False
    seed: int = 0

    @property
    def shown_as(self) -> str:
        """A name that tells apart what can be shown of the task."""
        return f"{self.key} {self.order}"


def presented(
    task: AssemblyTask, seed: int, order: CandidateOrder, *, is_blind: bool = False
) -> AssemblyTask:
    """Return the task as a seed shows it; itself where that is as the file has it."""
    if order == "shuffled":
        return in_order(task, shown_order(task, seed), seed, is_blind=is_blind)
    numbers = range(1, len(task.candidates) + 1)
    return in_order(task, numbers, seed, is_blind=True) if is_blind else task


def shown_order(task: AssemblyTask, seed: int) -> tuple[int, ...]:
    """Return the candidates' numbers in the file, in the order that a seed draws for the scene.

    It is sorted by digests, so that it is the same on every machine and with every library.
    """
    numbers = range(1, len(task.candidates) + 1)
    place = partial(drawn_bytes, "candidate order", seed, task.scene.id)
    return tuple(sorted(numbers, key=place))


def in_order(
    task: AssemblyTask, numbers: Sequence[int], seed: int = 0, *, is_blind: bool = False
) -> ShownTask:
    """Return the task with the candidates of these numbers in the file, in this order.

    Raises DataError for a number that no candidate has, and for one that is there twice.
    """
    n = len(task.candidates)
    if len(set(numbers)) < len(numbers) or not set(numbers) <= set(range(1, n + 1)):
        where, message = f"scene {task.key}", "is no order of its candidates"
        found, allowed = ", ".join(map(str, numbers)), f"the numbers 1 to {n}, each once"
        raise DataError(Problem(where, message, "shown.order", found, allowed))
    shown = CandidateSet(tuple(task.candidates[number] for number in numbers))
    return ShownTask(task.scene, shown, task.composite, tuple(numbers), is_blind, seed)


def as_recorded(task: AssemblyTask, record: Record) -> AssemblyTask:
    """Return the task with the candidates that a record says were shown, in their order."""
    return task if record.shown is None else in_order(task, record.shown.order)


def file_plan(task: AssemblyTask, steps: Sequence[int]) -> tuple[int, ...] | None:
    """Return steps in the numbers of the file, None where those are the ones shown.

    A number that no candidate has stays as it is: no candidate has it in the file either.
    """
    if not isinstance(task, ShownTask):
        return None
    n = len(task.order)
    return tuple(task.order[step - 1] if 1 <= step <= n else step for step in steps)
