"""The protocol of tracks: items, requests and judgement.

Most tracks ask once a sample; step planning plays an episode of several turns.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Protocol, TypeVar, runtime_checkable

from phyblock.domain import Scene
from phyblock.models.request import Request
from phyblock.records.record import Record
from phyblock.records.reply import Reply
from phyblock.sim.engine import REFERENCE_ENGINE, physics_engine

__all__ = [
    "CARRYING",
    "ENGINE",
    "FIRST_CARRYING",
    "READER",
    "AnyTrack",
    "Episode",
    "EpisodeTrack",
    "Item",
    "ItemT",
    "Judgement",
    "JudgesApart",
    "ShowsBySeed",
    "SingleTrack",
    "Track",
    "engine_identity",
    "judgement_of",
    "shown_item",
]


ENGINE = "physics"
"""Key in a track's identity of the physics engine that decides its results, where there is one and
it is not the engine of reference. What it decided stands in the records.
"""
READER = "reader"
"""The same of the version of a reader of the track's own; what is scored again is read anew."""
CARRYING = "carrying"
"""The same of the version of how plans are carried out and what stands is measured, as the records
keep it.
"""
FIRST_CARRYING = 1
"""How plans were carried out before runs said so."""


def engine_identity() -> dict[str, Any]:
    """Return the facts of the physics engine in a track's identity: runs made before there was a
    choice say nothing, and are to go on with the engine of reference.
    """
    engine = physics_engine()
    if engine.name == REFERENCE_ENGINE:
        return {}
    return {ENGINE: {"engine": engine.name, **engine.versions}}


class Item(Protocol):
    """The subject of a sample: a scene with its candidates, or a question."""

    @property
    def key(self) -> str:
        """Its name inside the track."""

    @property
    def scene(self) -> Scene:
        """The scene it is about, by whose parents statistics cluster."""


ItemT = TypeVar("ItemT", bound=Item)


class Judgement(Protocol):
    """A reply as it was parsed and scored."""

    @property
    def is_read(self) -> bool:
        """True if anything could be read."""

    def fields(self) -> dict[str, Any]:
        """`parse`, `scores` and what else the record says of it."""


class Track(Protocol[ItemT]):
    """The common part of all tracks."""

    @property
    def name(self) -> str:
        """Its name in suites and records."""

    @property
    def items(self) -> Sequence[ItemT]:
        """Its items; every seed repeats all of them."""

    @property
    def template(self) -> str:
        """Name of the prompt; "" where every model is a recording."""

    def about(self, item: ItemT) -> dict[str, Any]:
        """Return the fields of records about an item besides its scene."""

    def identity(self) -> dict[str, Any]:
        """Digests of what decides its results: data, prompt, pictures; JSON-able."""

    def outlines(self, item: ItemT) -> Iterable[tuple[Request, bool]]:
        """The requests of an item as far as they can be told before any is answered.

        With seed 0 and no parameters, made without rendering; with each, whether its pictures are
        the real ones.
        """

    def close(self) -> None:
        """Release worker processes."""


@runtime_checkable
class SingleTrack(Track[ItemT], Protocol[ItemT]):
    """A track that asks once a sample."""

    async def request(
        self, item: ItemT, seed: int, params: Mapping[str, object], *, with_messages: bool
    ) -> Request:
        """The request of one sample; without messages for models that need none."""

    def judge(self, item: ItemT, text: str | None) -> Judgement:
        """Read and score a reply; None, where there is no reply, is scored as nothing said."""


@runtime_checkable
class ShowsBySeed(Protocol[ItemT]):
    """A track that shows an item otherwise with every seed, as with its candidates shuffled."""

    def shown(self, item: ItemT, seed: int) -> ItemT:
        """The item as a seed shows it, by which it is asked, judged and counted; its key is the
        same.
        """


def shown_item(track: AnyTrack, item: Any, seed: int) -> Any:
    """An item of a track as a seed shows it."""
    return track.shown(item, seed) if isinstance(track, ShowsBySeed) else item


@runtime_checkable
class JudgesApart(Protocol):
    """A track that takes so long to judge a reply that it does so beside the calls of others."""

    async def judge_apart(self, item: Any, text: str | None, earlier: Record | None) -> Judgement:
        """Return what `judge` does; of the `earlier` record of the same sample it may take what
        replies alone do not decide.
        """


async def judgement_of(
    track: AnySingleTrack, item: Any, text: str | None, earlier: Record | None = None
) -> Judgement:
    """A reply read and scored, for the first time or again after an `earlier` record."""
    if isinstance(track, JudgesApart):
        return await track.judge_apart(item, text, earlier)
    return track.judge(item, text)


class Episode(Protocol):
    """One sample of several turns, as a state machine that replies alone drive.

    The same replies lead to the same requests, so that a killed run goes on in the middle of an
    episode by taking the replies it has.
    """

    async def request(self) -> Request | None:
        """The next request, or None when the episode has ended."""

    def take(self, request: Request, reply: Reply) -> None:
        """Go on with the reply to the last request."""

    @property
    def is_read(self) -> bool:
        """True if anything could be read in any reply."""

    def fields(self) -> dict[str, Any]:
        """`parse`, `scores`, `turns` (a mapping for each reply taken), `ending` and what else the
        record says, as things stand.
        """


@runtime_checkable
class EpisodeTrack(Track[ItemT], Protocol[ItemT]):
    """A track whose samples are episodes."""

    def start(
        self, item: ItemT, seed: int, params: Mapping[str, object], *, with_messages: bool
    ) -> Episode:
        """An episode that has not begun."""

    def again(self, item: ItemT, record: Record) -> Episode:
        """The episode of a record before its first reply, to be judged anew.

        What replies alone do not decide, as what fell, is taken from the record.
        """


AnySingleTrack = SingleTrack[Any]
AnyTrack = AnySingleTrack | EpisodeTrack[Any]
"""A track of either kind."""
