"""Scenes as a seed shows them: candidates in another order, the goal left out or another one.

All that depends on how a scene is shown (pictures, prompt, the reading of a reply, its scores) is
made from a `ShownTask`, whose candidates are numbered as the model saw them. Only records tell of
the numbers in the file.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from phyblock.data import AssemblyTask
from phyblock.domain import CandidateSet
from phyblock.errors import DataError, Problem
from phyblock.records.record import Record
from phyblock.stable import drawn_bytes
from phyblock.tracks.elsewhere import Elsewhere
from phyblock.types import CandidateOrder

__all__ = [
    "Showing",
    "ShownTask",
    "TaskShowing",
    "as_recorded",
    "file_plan",
    "in_order",
    "showing_fields",
    "shown_order",
]


@dataclass(frozen=True)
class Showing:
    """The presentation of scenes in a suite: `blind` leaves out the goal, `wrong_image` shows
    another one.

    What is drawn is drawn anew with each of the `seeds`.
    """

    order: CandidateOrder = "file"
    blind: bool = False
    wrong_image: bool = False
    seeds: tuple[int, ...] = (0,)

    @property
    def is_plain(self) -> bool:
        """True if scenes are shown as the file has them."""
        return self.order == "file" and not self.blind and not self.wrong_image


@dataclass(frozen=True)
class ShownTask(AssemblyTask):
    """A task in another form than the file's.

    `candidates` are in the order shown, and `order` holds the number in the file of each of them;
    `goal` is the task whose goal is shown, None where none is; `seed` drew both.
    """

    order: tuple[int, ...] = ()
    goal: AssemblyTask | None = None
    seed: int = 0


class TaskShowing:
    """Shows tasks in one way; `pool` are those whose goals may stand in for others.

    Another goal is one of the same level. Raises SpecError where one of `tasks` has none.
    """

    def __init__(
        self,
        how: Showing,
        tasks: Sequence[AssemblyTask] = (),
        pool: Iterable[AssemblyTask] = (),
        field: str = "",
    ) -> None:
        self.how = how
        self._elsewhere: Elsewhere[AssemblyTask] | None = None
        if how.wrong_image:
            self._elsewhere = Elsewhere(pool, lambda task: task.scene.level)
            self._elsewhere.check(tasks, "scene", field)

    def of(self, task: AssemblyTask, seed: int) -> AssemblyTask:
        """The task as a seed shows it; itself where that is as the file has it."""
        if self.how.is_plain:
            return task
        numbers = tuple(range(1, len(task.candidates) + 1))
        if self.how.order == "shuffled":
            numbers = shown_order(task, seed)
        goal = None if self.how.blind else task
        if self._elsewhere is not None and not self.how.blind:
            goal = self._elsewhere.of(task, seed)
        return replace(in_order(task, numbers, goal), seed=seed)

    @property
    def seeds(self) -> tuple[int, ...]:
        """The seeds of the suite, of those that show the same only the first."""
        return self.how.seeds[:1] if self.how.is_plain else self.how.seeds

    def stand_ins(self, task: AssemblyTask) -> tuple[AssemblyTask, ...]:
        """The tasks whose goals are shown in the place of its own."""
        if self._elsewhere is None or self.how.blind:
            return ()
        return self._elsewhere.each(task, self.how.seeds)

    def each(self, tasks: Sequence[AssemblyTask]) -> list[AssemblyTask]:
        """The tasks in every form in which the suite shows them."""
        return [self.of(task, seed) for seed in self.seeds for task in tasks]


def in_order(
    task: AssemblyTask, numbers: Sequence[int], goal: AssemblyTask | None, *, some: bool = False
) -> ShownTask:
    """The task with its candidates in an order, given by their numbers in the file, and a goal.

    Raises DataError for numbers that are not those of its candidates, each once, or once at most
    where `some` of them were shown.
    """
    known = range(1, len(task.candidates) + 1)
    is_some = some and len(set(numbers)) == len(numbers) and set(numbers) <= set(known)
    if sorted(numbers) != list(known) and not is_some:
        allowed = f"the numbers 1 to {len(task.candidates)}, each once"
        found = ", ".join(map(str, numbers))
        raise DataError(
            Problem(
                f"scene {task.key}", "is no order of its candidates", "shown.order", found, allowed
            )
        )
    shown = CandidateSet(tuple(task.candidates[number] for number in numbers))
    return ShownTask(task.scene, shown, task.composite, tuple(numbers), goal)


def as_recorded(task: AssemblyTask, record: Record) -> AssemblyTask:
    """The task with the candidates that a record says were shown, in their order."""
    return task if record.shown is None else in_order(task, record.shown.order, task, some=True)


def shown_order(task: AssemblyTask, seed: int) -> tuple[int, ...]:
    """The candidates' numbers in the file, in the order that a seed draws for the scene.

    It is sorted by digests, so that it is the same on every machine and with every library.
    """

    def place(number: int) -> bytes:
        return drawn_bytes("candidate order", seed, task.scene.id, number)

    return tuple(sorted(range(1, len(task.candidates) + 1), key=place))


def file_plan(task: AssemblyTask, steps: Sequence[int]) -> tuple[int, ...] | None:
    """Steps in the numbers of the file, None where those are the ones shown.

    A number that no candidate has stays as it is: no candidate has it in the file either.
    """
    if not isinstance(task, ShownTask):
        return None
    n = len(task.order)
    return tuple(task.order[step - 1] if 1 <= step <= n else step for step in steps)


def showing_fields(task: AssemblyTask) -> dict[str, Any]:
    """Return the fields of records about how a task was shown; nothing where it was as the file has
    it.
    """
    if not isinstance(task, ShownTask):
        return {}
    goal = None if task.goal is None else task.goal.key
    return {"shown": {"order": list(task.order), "goal": goal}}
