"""Episodes played again from the replies that a run stored."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import takewhile
from typing import Any

from phyblock.errors import Problem, StoreError
from phyblock.records import Record
from phyblock.run.records import judged
from phyblock.tracks import Episode, EpisodeTrack, Item

__all__ = ["counted_again", "read_again"]

_HOW = "rule"
"""What says how a reply was read, from which nothing follows."""


async def counted_again(
    track: EpisodeTrack[Item],
    item: Item,
    record: Record,
    where: str,
    about: Mapping[str, Any] | None = None,
    *,
    or_kept: bool = False,
) -> Record:
    """A record of an episode with what measures count of it now; all else stays as it is.

    Where `about`, what it should say of its item, is given, that and every turn are held against
    it, too. For an episode that goes otherwise than it did, StoreError, which names `where`, is
    raised, or, with `or_kept`, the same record returned.
    """
    episode = await _played(track, item, record)
    given = {**record.as_given(), **(about or {})}
    turns = {"turns": given["turns"]} if "turns" in given else {}
    again = judged(given, item, episode, turns if about is None else _turns(episode, record))
    changed = _changed(record, again)
    if changed and or_kept:
        return record
    if changed:
        message = "goes otherwise than it did, in another version"
        hint = "the version of phyblock that made the run plays it as it went"
        raise StoreError(Problem(where, message, changed[0], record.sample, hint=hint))
    return record.model_copy(update={"counts": again.counts})


async def read_again(
    track: EpisodeTrack[Item], item: Item, record: Record
) -> tuple[Record | None, int]:
    """The record of an episode as it is read now, None where it would go otherwise; and how many
    of its first turns go as they did, so that the reply to the next answers what would be asked.
    """
    episode = await _played(track, item, record)
    now = episode.fields()["turns"]
    both = list(zip(record.asked_turns, now, strict=False))
    alike = sum(1 for _ in takewhile(lambda pair: _goes_on(pair[0].fields(), pair[1]), both))
    again = judged(record.as_given(), item, episode, _turns(episode, record))
    is_same = alike == len(record.asked_turns) and not {*_changed(record, again)} - {"turns"}
    return (again if is_same else None), alike


def _turns(episode: Episode, record: Record) -> dict[str, Any]:
    """The turns of a record with what became of them now."""
    asked, now = record.asked_turns, episode.fields()["turns"]
    return {"turns": [{**was.fields(), **more} for was, more in zip(asked, now, strict=False)]}


def _changed(record: Record, again: Record) -> list[str]:
    """Fields of a record that say something else now, but for what measures count."""
    was, now = record.fields(), again.fields()
    return [name for name in was if name != "counts" and not _alike(was[name], now.get(name))]


def _goes_on(was: Mapping[str, Any], now: Mapping[str, Any]) -> bool:
    """Whether a turn came to what it comes to now, as far as its line says."""
    return all(
        _goes_on(value, now[name])
        if isinstance(value, Mapping) and isinstance(now[name], Mapping)
        else _alike(value, now[name])
        for name, value in was.items()
        if name in now and name != _HOW
    )


def _alike(was: object, now: object) -> bool:
    """Whether two values say the same; a part that one of them lacks is null, as lines of earlier
    versions lack what came later.
    """
    if isinstance(was, Mapping) and isinstance(now, Mapping):
        return all(_alike(was.get(name), now.get(name)) for name in was.keys() | now.keys())
    if isinstance(was, (list, tuple)) and isinstance(now, (list, tuple)):
        return len(was) == len(now) and all(map(_alike, was, now))
    return was == now


async def _played(track: EpisodeTrack[Item], item: Item, record: Record) -> Episode:
    """The episode that the replies of a record make, to where it ends or they do."""
    episode = track.again(item, record)
    for turn in record.asked_turns:
        request = await episode.request()
        if request is None:
            return episode
        episode.take(request, turn.reply)
    # What the last reply comes to shows when the next is asked for: blocks are let go.
    await episode.request()
    return episode
