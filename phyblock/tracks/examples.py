"""Worked examples: other items of a track with right answers, shown before what is asked."""

from __future__ import annotations

import functools
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from typing import Generic, TypeVar

from phyblock.config.suite import Suite
from phyblock.domain import Scene
from phyblock.domain.symmetry import fingerprint
from phyblock.errors import Problem, SpecError
from phyblock.models.request import Image, Message
from phyblock.stable import drawn_bytes
from phyblock.text import did_you_mean
from phyblock.tracks.base import Item

__all__ = ["Examples", "Shots", "WorkedExample", "examples_of"]


AskedT = TypeVar("AskedT", bound=Item)


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
class Examples(Generic[AskedT]):
    """Chooses `n` examples for an item out of a pool.

    They are tried in one order for all items, so that requests begin alike: those about the scenes
    `named` first, then as `seed` draws; no two are about one scene. None is of another sort than
    the item, shares a base scene with it, or has its goal, be it turned, mirrored or shifted; nor
    is it so akin to one of the item's `stand_ins`, whose pictures are shown in the place of its
    own. Sorted by digests, the order is the same on every machine.
    """

    pool: Iterable[AskedT]
    n: int
    named: Sequence[str] = ()
    seed: int = 0
    sort_of: Callable[[AskedT], Hashable] = lambda _: None
    stand_ins: Callable[[AskedT], Iterable[AskedT]] = lambda _: ()
    _alike: dict[Hashable, list[AskedT]] = field(default_factory=dict, init=False)
    _goals: dict[str, bytes] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        """Put the pool in order."""
        for one in sorted(self.pool, key=self._place) if self.n else ():
            self._alike.setdefault(self.sort_of(one), []).append(one)

    def of(self, item: AskedT) -> tuple[AskedT, ...]:
        """The examples of an item, fewer than `n` where there are no more."""
        return tuple(islice(self._others(item), self.n))

    def used(self, items: Iterable[AskedT]) -> tuple[AskedT, ...]:
        """All that are examples of any of the items, by key."""
        by_key = {one.key: one for item in items for one in self.of(item)}
        return tuple(by_key[key] for key in sorted(by_key))

    def check(self, items: Sequence[AskedT], noun: str, where: str) -> None:
        """Raise SpecError for the first item that has fewer than wanted."""
        for item in items:
            if (offered := len(self.of(item))) < self.n:
                message = f"{noun} {item.key} has fewer others to be shown as examples"
                allowed = "others of its kind, of scenes that differ, which share neither base "
                allowed += "scene nor goal with it or with what is shown in its place"
                raise SpecError(Problem(where, message, "examples", str(offered), allowed))

    def _others(self, item: AskedT) -> Iterator[AskedT]:
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

    def _goal(self, item: AskedT) -> bytes:
        if item.key not in self._goals:
            self._goals[item.key] = fingerprint(item.scene.blocks)
        return self._goals[item.key]

    def _place(self, one: AskedT) -> tuple[int, bytes]:
        place = self.named.index(one.scene.id) if one.scene.id in self.named else len(self.named)
        return place, drawn_bytes("example", self.seed, one.key)


def examples_of(
    suite: Suite,
    pool: Iterable[AskedT],
    items: Sequence[AskedT],
    noun: str,
    sort_of: Callable[[AskedT], Hashable] = lambda _: None,
    stand_ins: Callable[[AskedT], Iterable[AskedT]] = lambda _: (),
) -> Examples[AskedT]:
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
