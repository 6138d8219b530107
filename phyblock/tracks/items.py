"""Items: those that a run asks about, their order, and how a seed presents them.

A seed can show a scene with its candidates in another order, without its goal, or with the goal of
another one. All that depends on the presentation (pictures, prompt, the reading of a reply, its
scores) is made from a `ShownTask`, whose candidates are numbered as the model saw them. Only
records know the numbers in the file. Worked examples are other items with right answers.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, Generic, Protocol, TypeVar

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


def spread(size: int, share: int) -> list[int]:
    """Return `share` of the positions 0 to `size` - 1, evenly spread; more hold all of fewer."""
    return sorted(_spread_out(size)[:share])


def stratified(sizes: Sequence[int], limit: int) -> list[int]:
    """Return `limit` places shared among groups of the given sizes, as `_fair_order` shares."""
    groups = [group for group, size in enumerate(sizes) for _ in range(size)]
    chosen = [groups[position] for position in _fair_order(groups)[:limit]]
    return [chosen.count(group) for group in range(len(sizes))]


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
        for rank, place in enumerate(_spread_out(len(of_stratum)))
    )
    return [position for *_, position in places]


def _spread_out(size: int) -> list[int]:
    """Return the positions 0 to `size` - 1, of which any first few are evenly spread.

    They are taken at 0, 1/2, 1/4, 3/4, 1/8, ... of the size: the sequence of van der Corput (1935).
    """
    digits = max(1, (size - 1).bit_length())
    parts = (int(f"{i:0{digits}b}"[::-1], 2) for i in range(2**digits))
    return list(dict.fromkeys(part * size // 2**digits for part in parts))


def _bases(item: Item) -> set[str]:
    return {item.scene.id, *item.scene.parents}


class Elsewhere(Generic[ItemT]):
    """Finds, for an item, another of its sort about a scene that shares no base scene with its own.

    `pool` are those to take from, `sort_of` says what makes two stand in for one another.
    """

    def __init__(self, pool: Iterable[ItemT], sort_of: Callable[[ItemT], Hashable]) -> None:
        self._sort_of = sort_of
        self._alike: dict[Hashable, list[ItemT]] = {}
        for one in pool:
            self._alike.setdefault(sort_of(one), []).append(one)
        self._others_of: dict[str, list[ItemT]] = {}

    def of(self, item: ItemT, seed: int) -> ItemT:
        """Return the one whose picture is shown, which depends on item and seed alone."""
        others = self.others(item)
        digest = drawn_bytes("wrong image", seed, item.key)
        return others[int.from_bytes(digest, "big") % len(others)]

    def check(self, items: Sequence[ItemT], noun: str, field: str) -> None:
        """Raise SpecError for the first item that has no other; `field` is that of the suite."""
        lacking = next((item for item in items if not self.others(item)), None)
        if lacking is not None:
            message = f"has no {noun} of the same kind about another scene to take pictures from"
            raise SpecError(Problem(f"{noun} {lacking.key}", message, field))

    def others(self, item: ItemT) -> list[ItemT]:
        """Return all that can stand in for an item, in the order of the pool."""
        if item.key not in self._others_of:
            alike, own = self._alike.get(self._sort_of(item), ()), _bases(item)
            self._others_of[item.key] = [one for one in alike if own.isdisjoint(_bases(one))]
        return self._others_of[item.key]


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
    """The presentation of scenes in a suite; what is drawn is drawn again with each of the `seeds`.

    `blind` leaves out the goal; with `elsewhere` that of another scene of its level is shown.
    """

    order: CandidateOrder = "file"
    blind: bool = False
    elsewhere: Elsewhere[AssemblyTask] | None = None
    seeds: tuple[int, ...] = (0,)

    @property
    def is_plain(self) -> bool:
        """True if scenes are shown as the file has them."""
        return self.order == "file" and not self.blind and self.elsewhere is None

    def of(self, task: AssemblyTask, seed: int) -> AssemblyTask:
        """Return the task as a seed shows it; itself where that is as the file has it."""
        if self.is_plain:
            return task
        numbers = tuple(range(1, len(task.candidates) + 1))
        if self.order == "shuffled":
            numbers = shown_order(task, seed)
        goal = None if self.blind else task
        if self.elsewhere is not None:
            goal = self.elsewhere.of(task, seed)
        return replace(in_order(task, numbers, goal), seed=seed)

    @property
    def drawn_seeds(self) -> tuple[int, ...]:
        """The seeds, of those that show the same only the first."""
        return self.seeds[:1] if self.is_plain else self.seeds


def other_goals(pool: Iterable[AssemblyTask]) -> Elsewhere[AssemblyTask]:
    """Return the goals that can stand in for one another: those of one level."""
    return Elsewhere(pool, lambda task: task.scene.level)


def in_order(task: AssemblyTask, numbers: Sequence[int], goal: AssemblyTask | None) -> ShownTask:
    """Return the task with the candidates of these numbers in the file, in this order, and a goal.

    Raises DataError for a number that no candidate has, and for one that is there twice.
    """
    n = len(task.candidates)
    if len(set(numbers)) < len(numbers) or not set(numbers) <= set(range(1, n + 1)):
        where, message = f"scene {task.key}", "is no order of its candidates"
        found, allowed = ", ".join(map(str, numbers)), f"the numbers 1 to {n}, each once"
        raise DataError(Problem(where, message, "shown.order", found, allowed))
    shown = CandidateSet(tuple(task.candidates[number] for number in numbers))
    return ShownTask(task.scene, shown, task.composite, tuple(numbers), goal)


def as_recorded(task: AssemblyTask, record: Record) -> AssemblyTask:
    """Return the task with the candidates that a record says were shown, in their order."""
    return task if record.shown is None else in_order(task, record.shown.order, task)


def shown_order(task: AssemblyTask, seed: int) -> tuple[int, ...]:
    """Return the candidates' numbers in the file, in the order that a seed draws for the scene.

    It is sorted by digests, so that it is the same on every machine and with every library.
    """

    def place(number: int) -> bytes:
        return drawn_bytes("candidate order", seed, task.scene.id, number)

    return tuple(sorted(range(1, len(task.candidates) + 1), key=place))


def file_plan(task: AssemblyTask, steps: Sequence[int]) -> tuple[int, ...] | None:
    """Return steps in the numbers of the file, None where those are the ones shown.

    A number that no candidate has stays as it is: no candidate has it in the file either.
    """
    if not isinstance(task, ShownTask):
        return None
    n = len(task.order)
    return tuple(task.order[step - 1] if 1 <= step <= n else step for step in steps)


def presentation_fields(task: AssemblyTask) -> dict[str, Any]:
    """Return the fields of records on how a task was shown; none where as the file has it."""
    if not isinstance(task, ShownTask):
        return {}
    goal = None if task.goal is None else task.goal.key
    return {"shown": {"order": list(task.order), "goal": goal}}


class Examples(Generic[ItemT]):
    """Chooses `n` worked examples for an item out of a pool.

    They are tried in one order for all items, so that requests begin alike: those about the scenes
    `named` first, then as `seed` draws; no two are about one scene. None is of another sort than
    the item, shares a base scene with it, or has its goal, be it turned, mirrored or shifted.
    """

    def __init__(
        self,
        pool: Iterable[ItemT],
        n: int,
        named: Sequence[str] = (),
        seed: int = 0,
        sort_of: Callable[[ItemT], Hashable] = lambda _: None,
    ) -> None:
        def place(one: ItemT) -> tuple[int, bytes]:
            # Sorted by digests, the order is the same on every machine.
            at = named.index(one.scene.id) if one.scene.id in named else len(named)
            return at, drawn_bytes("example", seed, one.key)

        self._n = n
        self._pool = Elsewhere(sorted(pool, key=place) if n else (), sort_of)
        self._goals: dict[str, bytes] = {}

    def of(self, item: ItemT) -> tuple[ItemT, ...]:
        """Return the examples of an item, fewer than `n` where there are no more."""
        found: dict[str, ItemT] = {}
        for one in self._pool.others(item) if self._n else ():
            if len(found) == self._n:
                break
            if one.scene.id not in found and self._goal(one) != self._goal(item):
                found[one.scene.id] = one
        return tuple(found.values())

    def used(self, items: Iterable[ItemT]) -> tuple[ItemT, ...]:
        """Return all that are examples of any of the items, by key."""
        by_key = {one.key: one for item in items for one in self.of(item)}
        return tuple(by_key[key] for key in sorted(by_key))

    def _goal(self, item: ItemT) -> bytes:
        if item.key not in self._goals:
            self._goals[item.key] = fingerprint(item.scene.blocks)
        return self._goals[item.key]


def examples_of(
    suite: Suite,
    pool: Iterable[ItemT],
    items: Sequence[ItemT],
    noun: str,
    sort_of: Callable[[ItemT], Hashable] = lambda _: None,
) -> Examples[ItemT]:
    """Return the examples that a suite wants, drawn from a pool by the least of its seeds.

    `sort_of` says what an item and its examples share. Raises SpecError for a scene that the pool
    has not, and where an item has too few others.
    """
    wanted = suite.examples
    n, named = (wanted, ()) if isinstance(wanted, int) else (len(wanted), wanted)
    kept = list(pool) if n else []
    known = sorted({one.scene.id for one in kept})
    problems = []
    for at, name in enumerate(named):
        if name not in known:
            where, message = suite.where("examples", at), "is no scene that an example can be about"
            allowed = f"scenes, such as {known[0]}" if known else "no scene of these data"
            hint = did_you_mean(name, known)
            problems.append(Problem(where, message, f"examples[{at}]", name, allowed, hint))
    if problems:
        raise SpecError(problems)
    examples = Examples(kept, n, named, min(suite.seeds), sort_of)
    for item in items if n else ():
        if (offered := len(examples.of(item))) < n:
            where, message = suite.where("examples"), "has fewer others to be shown as examples"
            allowed = "others of its kind that share neither base scene nor goal with it"
            message = f"{noun} {item.key} {message}"
            raise SpecError(Problem(where, message, "examples", str(offered), allowed))
    return examples
