"""Episodes played again from the replies that a run stored."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from phyblock.errors import Problem, StoreError
from phyblock.records.record import Record
from phyblock.run.records import judged
from phyblock.tracks import Episode, EpisodeTrack, Item


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


def _turns(episode: Episode, record: Record) -> dict[str, Any]:
    """The turns of a record with what became of them now."""
    asked, now = record.asked_turns, episode.fields()["turns"]
    return {"turns": [{**was.fields(), **more} for was, more in zip(asked, now, strict=False)]}


def _changed(record: Record, again: Record) -> list[str]:
    """Fields of a record that say something else now, but for what measures count."""
    was, now = record.fields(), again.fields()
    return [name for name in was if name != "counts" and not _alike(was[name], now.get(name))]


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
