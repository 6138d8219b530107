"""Items: those that a run asks about, their order, and how a seed shows them.

A seed can show a scene with its candidates in another order, without its goal, or with the goal of
another one. All that depends on it (pictures, prompt, the reading of a reply, its scores) is made
from a `ShownTask`, whose candidates are numbered as the model saw them. Only records know the
numbers in the file. Worked examples are other items with right answers.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from typing import Generic, Protocol, TypeVar

from phyblock.config.suite import Suite
from phyblock.data import AssemblyTask
from phyblock.domain import CandidateSet, Scene
from phyblock.domain.symmetry import fingerprint
from phyblock.errors import DataError, Problem, SpecError
from phyblock.records.record import Record
from phyblock.stable import drawn_bytes
from phyblock.text import did_you_mean
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
    tasks: Sequence[AssemblyTask], levels: Sequence[int], limit: int | None
) -> tuple[AssemblyTask, ...]:
    """Return the tasks counted in any of `levels`, at most `limit` of them, in their order.

    They are evenly spread, and a higher limit keeps all that a lower one keeps.
    """
    chosen = [task for task in tasks if set(task.scene.levels) & set(levels)]
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


class Others(Generic[ItemT]):
    """Items of a pool by their sort; they stand in for an item whose base scenes they share not."""

    def __init__(self, pool: Iterable[ItemT], sort_of: Callable[[ItemT], Hashable]) -> None:
        self._sort_of = sort_of
        self._by_sort: dict[Hashable, list[ItemT]] = {}
        for one in pool:
            self._by_sort.setdefault(sort_of(one), []).append(one)

    def of(self, item: ItemT) -> list[ItemT]:
        """Return all that can stand in for an item, in the order of the pool."""
        same_sort, own = self._by_sort.get(self._sort_of(item), ()), _bases(item)
        return [one for one in same_sort if own.isdisjoint(_bases(one))]

    def drawn(self, item: ItemT, seed: int) -> ItemT:
        """Return the one whose picture is shown, which depends on item and seed alone."""
        others, digest = self.of(item), drawn_bytes("wrong image", seed, item.key)
        return others[int.from_bytes(digest, "big") % len(others)]

    def check(self, items: Iterable[ItemT], noun: str, field: str) -> None:
        """Raise SpecError for the first item that has no other; `field` is that of the suite."""
        lacking = next((item for item in items if not self.of(item)), None)
        if lacking is not None:
            message = f"has no {noun} of the same kind about another scene to take pictures from"
            raise SpecError(Problem(f"{noun} {lacking.key}", message, field))


def _bases(item: Item) -> set[str]:
    return {item.scene.id, *item.scene.parents}


@dataclass(frozen=True)
class ShownTask(AssemblyTask):
    """A task in another form than the file's.

    `candidates` are in the order shown, and `order` holds the number in the file of each of them;
    `goal` is the task whose goal is shown, None where none is; `seed` drew both.
    """

    order: tuple[int, ...] = ()
    goal: AssemblyTask | None = None
    seed: int = 0

    @property
    def shown_as(self) -> str:
        """A name that tells apart what can be shown of the task."""
        return f"{self.key} {self.order} {self.goal and self.goal.key}"


@dataclass(frozen=True)
class Presentation:
    """Conditions of scenes: without their goal where `blind`, with that of one of the `others`."""

    order: CandidateOrder = "file"
    blind: bool = False
    others: Others[AssemblyTask] | None = None

    @property
    def is_plain(self) -> bool:
        """True if scenes are shown as the file has them."""
        return self.order == "file" and not self.blind and self.others is None

    def of(self, task: AssemblyTask, seed: int) -> AssemblyTask:
        """Return the task as a seed shows it; itself where that is as the file has it."""
        if self.is_plain:
            return task
        numbers = tuple(range(1, len(task.candidates) + 1))
        if self.order == "shuffled":
            numbers = shown_order(task, seed)
        goal = None if self.blind else task
        if self.others is not None:
            goal = self.others.drawn(task, seed)
        return in_order(task, numbers, goal, seed)


def shown_order(task: AssemblyTask, seed: int) -> tuple[int, ...]:
    """Return the candidates' numbers in the file, in the order that a seed draws for the scene.

    It is sorted by digests, so that it is the same on every machine and with every library.
    """
    numbers = range(1, len(task.candidates) + 1)
    place = partial(drawn_bytes, "candidate order", seed, task.scene.id)
    return tuple(sorted(numbers, key=place))


def in_order(
    task: AssemblyTask, numbers: Sequence[int], goal: AssemblyTask | None, seed: int = 0
) -> ShownTask:
    """Return the task with the candidates of these numbers in the file, in this order, and a goal.

    Raises DataError for a number that no candidate has, and for one that is there twice.
    """
    n = len(task.candidates)
    if len(set(numbers)) < len(numbers) or not set(numbers) <= set(range(1, n + 1)):
        where, message = f"scene {task.key}", "is no order of its candidates"
        found, allowed = ", ".join(map(str, numbers)), f"the numbers 1 to {n}, each once"
        raise DataError(Problem(where, message, "shown.order", found, allowed))
    shown = CandidateSet(tuple(task.candidates[number] for number in numbers))
    return ShownTask(task.scene, shown, task.composite, tuple(numbers), goal, seed)


def as_recorded(task: AssemblyTask, record: Record) -> AssemblyTask:
    """Return the task with the candidates that a record says were shown, in their order."""
    return task if record.shown is None else in_order(task, record.shown.order, task)


def goal_of(task: AssemblyTask) -> AssemblyTask | None:
    """Return the task whose goal is shown, None where none is."""
    return task.goal if isinstance(task, ShownTask) else task


def file_plan(task: AssemblyTask, steps: Sequence[int]) -> tuple[int, ...] | None:
    """Return steps in the numbers of the file, None where those are the ones shown.

    A number that no candidate has stays as it is: no candidate has it in the file either.
    """
    if not isinstance(task, ShownTask):
        return None
    n = len(task.order)
    return tuple(task.order[step - 1] if 1 <= step <= n else step for step in steps)


def examples_of(
    suite: Suite,
    pool: Iterable[ItemT],
    items: Sequence[ItemT],
    noun: str,
    sort_of: Callable[[ItemT], Hashable] = lambda _: None,
) -> Mapping[str, tuple[ItemT, ...]]:
    """Return the worked examples that a suite wants of each item, by its key.

    They are tried in one order for all items, so that requests begin alike: those about the scenes
    that the suite names first, then as the least of its seeds draws; no two are about one scene.
    None is of another sort than the item, shares a base scene with it, or has its goal, be it
    turned, mirrored or shifted. Raises SpecError for a scene that the pool has not, and where an
    item has too few others.
    """
    wanted = suite.examples
    if not wanted:
        return {}
    n, named = (wanted, ()) if isinstance(wanted, int) else (len(wanted), wanted)
    pool = list(pool)
    known = sorted({one.scene.id for one in pool})
    problems = []
    for at, name in enumerate(named):
        if name not in known:
            where, message = suite.where("examples", at), "is no scene that an example can be about"
            allowed = f"scenes, such as {known[0]}" if known else "no scene of these data"
            hint = did_you_mean(name, known)
            problems.append(Problem(where, message, f"examples[{at}]", name, allowed, hint))
    if problems:
        raise SpecError(problems)
    seed, goals = min(suite.seeds), dict[str, bytes]()

    def place(one: ItemT) -> tuple[int, bytes]:
        at = named.index(one.scene.id) if one.scene.id in named else len(named)
        return at, drawn_bytes("example", seed, one.key)

    def goal(one: ItemT) -> bytes:
        if one.scene.id not in goals:
            goals[one.scene.id] = fingerprint(one.scene.blocks)
        return goals[one.scene.id]

    others, examples = Others(sorted(pool, key=place), sort_of), dict[str, tuple[ItemT, ...]]()
    for item in items:
        found: dict[str, ItemT] = {}
        for one in others.of(item):
            if one.scene.id not in found and goal(one) != goal(item):
                found[one.scene.id] = one
                if len(found) == n:
                    break
        if len(found) < n:
            message = f"{noun} {item.key} has fewer others to be shown as examples"
            allowed = "others of its kind that share neither base scene nor goal with it"
            where = suite.where("examples")
            raise SpecError(Problem(where, message, "examples", str(len(found)), allowed))
        examples[item.key] = tuple(found.values())
    return examples
