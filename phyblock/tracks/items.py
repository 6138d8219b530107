"""Items: those that a run asks about, the order in which it asks, and their presentation.

A seed can show a scene with its candidates in another order, without its goal, or with the goal of
another one. All that depends on the presentation (pictures, prompt, the reading of a reply, its
scores) is made from a `ShownTask`, whose candidates are numbered as the model saw them. Only
records tell of the numbers in the file. Worked examples are other items with right answers.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import islice
from typing import Any, Generic, Protocol, TypeVar

from phyblock.config.suite import Suite
from phyblock.data import AssemblyTask
from phyblock.domain import CandidateSet, Scene
from phyblock.domain.symmetry import fingerprint
from phyblock.errors import DataError, Problem, SpecError
from phyblock.models.request import Image, Message
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
    tasks: Sequence[AssemblyTask],
    levels: Sequence[int],
    limit: int | None,
) -> tuple[AssemblyTask, ...]:
    """Return the tasks counted in any of `levels`, at most `limit` of them, in their order.

    They are evenly spread, and a higher limit keeps all that a lower one keeps.
    """
    chosen = [task for task in tasks if set(task.scene.levels) & set(levels)]
    if limit is None or limit >= len(chosen):
        return tuple(chosen)
    kept = set(evenly([task.scene.level for task in chosen], limit))
    return tuple(task for position, task in enumerate(chosen) if position in kept)


def evenly(strata: Sequence[int], limit: int) -> list[int]:
    """Return `limit` positions, shared among the strata and evenly spread in each."""
    return sorted(_fair_order(strata)[:limit])


def interleaved(items: Sequence[ItemT]) -> list[ItemT]:
    """Return items in an order in which any first few are a fair sample of levels and scenes."""
    return [items[position] for position in _fair_order([item.scene.level for item in items])]


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


def spread(size: int, share: int) -> list[int]:
    """`share` of the positions 0 to `size` - 1, evenly spread; more hold all that fewer hold."""
    return sorted(_spread_out(size)[:share])


def _spread_out(size: int) -> list[int]:
    """The positions 0 to `size` - 1 in an order in which any first few are evenly spread.

    They are taken at 0, 1/2, 1/4, 3/4, 1/8, ... of the size: the sequence of van der Corput (1935).
    """
    digits = max(1, (size - 1).bit_length())
    parts = (int(f"{i:0{digits}b}"[::-1], 2) for i in range(2**digits))
    return list(dict.fromkeys(part * size // 2**digits for part in parts))


def stratified(sizes: Sequence[int], limit: int) -> list[int]:
    """`limit` places shared among groups of the given sizes; a higher limit takes from none.

    Every group gets one place before any gets two; then each place goes to the group that has
    least for its size (Webster's method, which is monotone in the number of places). None gets
    more than its size.
    """
    places = sorted(
        (rank > 0, Fraction(2 * rank + 1, size), group)
        for group, size in enumerate(sizes)
        for rank in range(size)
    )
    shares = [0] * len(sizes)
    for _, _, group in places[:limit]:
        shares[group] += 1
    return shares


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
        """The one whose picture is shown: it depends on item and seed alone, not on the model."""
        others = self._others(item)
        digest = drawn_bytes("wrong image", seed, item.key)
        return others[int.from_bytes(digest, "big") % len(others)]

    def each(self, item: ItemT, seeds: Iterable[int]) -> tuple[ItemT, ...]:
        """Those whose pictures are shown with any of the seeds."""
        return tuple(self.of(item, seed) for seed in seeds)

    def check(self, items: Sequence[ItemT], noun: str, field: str) -> None:
        """Raise SpecError for the first item that has no other; `field` is that of the suite."""
        lacking = next((item for item in items if not self._others(item)), None)
        if lacking is not None:
            message = f"has no {noun} of the same kind about another scene to take pictures from"
            raise SpecError(Problem(f"{noun} {lacking.key}", message, field))

    def _others(self, item: ItemT) -> list[ItemT]:
        if item.key not in self._others_of:
            own = set(_parents(item))
            alike = self._alike.get(self._sort_of(item), ())
            self._others_of[item.key] = [one for one in alike if not own & set(_parents(one))]
        return self._others_of[item.key]


def _parents(item: Item) -> tuple[str, ...]:
    return item.scene.parents or (item.scene.id,)


@dataclass(frozen=True)
class WorkedExample:
    """An example as it is sent: its key, the question as the track asks it, a right answer."""

    key: str
    question: Message
    answer: str

    @functools.cached_property
    def turns(self) -> tuple[Message, Message]:
        """A turn of the user, whose pictures say whose they are, and one of the assistant."""
        parts = tuple(
            replace(part, label=f"example {self.key}: {part.label}")
            if isinstance(part, Image)
            else part
            for part in self.question.parts
        )
        return Message("user", parts), Message("assistant", (self.answer,))


@dataclass(frozen=True)
class Shots:
    """The worked examples of one request."""

    examples: tuple[WorkedExample, ...] = ()

    @property
    def keys(self) -> tuple[str, ...]:
        """Return the examples."""
        return tuple(example.key for example in self.examples)

    def before(self, messages: tuple[Message, ...]) -> tuple[Message, ...]:
        """Messages with the examples before the last, which asks."""
        *first, question = messages
        turns = (turn for example in self.examples for turn in example.turns)
        return (*first, *turns, question)


@dataclass
class Examples(Generic[ItemT]):
    """Chooses `n` examples for an item out of a pool.

    They are tried in one order for all items, so that requests begin alike: those about the scenes
    `named` first, then as `seed` draws; no two are about one scene. None is of another sort than
    the item, shares a base scene with it, or has its goal, be it turned, mirrored or shifted; nor
    is it so akin to one of the item's `stand_ins`, whose pictures are shown in the place of its
    own. Sorted by digests, the order is the same on every machine.
    """

    pool: Iterable[ItemT]
    n: int
    named: Sequence[str] = ()
    seed: int = 0
    sort_of: Callable[[ItemT], Hashable] = lambda _: None
    stand_ins: Callable[[ItemT], Iterable[ItemT]] = lambda _: ()
    _alike: dict[Hashable, list[ItemT]] = field(default_factory=dict, init=False)
    _goals: dict[str, bytes] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        """Put the pool in order."""
        for one in sorted(self.pool, key=self._place) if self.n else ():
            self._alike.setdefault(self.sort_of(one), []).append(one)

    def of(self, item: ItemT) -> tuple[ItemT, ...]:
        """The examples of an item, fewer than `n` where there are no more."""
        return tuple(islice(self._others(item), self.n))

    def used(self, items: Iterable[ItemT]) -> tuple[ItemT, ...]:
        """All that are examples of any of the items, by key."""
        by_key = {one.key: one for item in items for one in self.of(item)}
        return tuple(by_key[key] for key in sorted(by_key))

    def check(self, items: Sequence[ItemT], noun: str, where: str) -> None:
        """Raise SpecError for the first item that has fewer than wanted."""
        for item in items:
            if (offered := len(self.of(item))) < self.n:
                message = f"{noun} {item.key} has fewer others to be shown as examples"
                allowed = "others of its kind, of scenes that differ, which share neither base "
                allowed += "scene nor goal with it or with what is shown in its place"
                raise SpecError(Problem(where, message, "examples", str(offered), allowed))

    def _others(self, item: ItemT) -> Iterator[ItemT]:
        seen = (item, *self.stand_ins(item))
        bases = frozenset[str]().union(*(_bases(one.scene) for one in seen))
        goals = {self._goal(one) for one in seen}
        scenes: set[str] = set()
        for one in self._alike.get(self.sort_of(item), ()):
            if one.scene.id in scenes or not bases.isdisjoint(_bases(one.scene)):
                continue
            if self._goal(one) not in goals:
                scenes.add(one.scene.id)
                yield one

    def _goal(self, item: ItemT) -> bytes:
        if item.key not in self._goals:
            self._goals[item.key] = fingerprint(item.scene.blocks)
        return self._goals[item.key]

    def _place(self, one: ItemT) -> tuple[int, bytes]:
        place = self.named.index(one.scene.id) if one.scene.id in self.named else len(self.named)
        return place, drawn_bytes("example", self.seed, one.key)


def examples_of(
    suite: Suite,
    pool: Iterable[ItemT],
    items: Sequence[ItemT],
    noun: str,
    sort_of: Callable[[ItemT], Hashable] = lambda _: None,
    stand_ins: Callable[[ItemT], Iterable[ItemT]] = lambda _: (),
) -> Examples[ItemT]:
    """The examples that a suite wants, out of a pool; they are drawn by the first of its seeds.

    `sort_of` and `stand_ins` are those of `Examples`.

    Raises SpecError for a scene that the pool has not, and where an item has too few others.
    """
    where = suite.where("examples")
    wanted = suite.examples
    n, named = (wanted, ()) if isinstance(wanted, int) else (len(wanted), wanted)
    kept = list(pool) if n else []
    known = {one.scene.id for one in kept}
    if lacking := [(at, name) for at, name in enumerate(named) if name not in known]:
        message = "is no scene that an example can be about"
        allowed = f"names of scenes, such as {min(known)}" if known else "no scene of these data"
        raise SpecError(
            Problem(
                suite.where("examples", at),
                message,
                f"examples[{at}]",
                name,
                allowed,
                did_you_mean(name, sorted(known)),
            )
            for at, name in lacking
        )
    examples = Examples(kept, n, named, min(suite.seeds), sort_of, stand_ins)
    examples.check(items, noun, where)
    return examples


def _bases(scene: Scene) -> frozenset[str]:
    return frozenset((scene.id, *scene.parents))
