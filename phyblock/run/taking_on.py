"""A run that earlier readers began, taken on by the readers of today: nobody is asked again.

Every stored reply is read again, into a line of its own behind the earlier ones, which stay. Of an
episode that would go otherwise, the turns count up to the one that is read otherwise, as that reply
still answers what would be asked; it goes on from there.

`run.yaml` first names both identities, under the one that it had, so that no line of the new one
counts yet; once all are on disk, it has the new one, and no line of the earlier counts any more.
A kill at any moment leaves a run of one version of the readers, and the next command begins anew.
"""

from __future__ import annotations

import asyncio
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

from phyblock.parsing.text import READER_VERSION
from phyblock.records import Line, Manifest, Record, Reply, Turn
from phyblock.run.appending import AppendFile
from phyblock.run.judged_again import (
    Tell,
    is_read_otherwise,
    records_with_items,
    reply_judged_again,
)
from phyblock.run.plan import RunPlan
from phyblock.run.replayed import read_again
from phyblock.run.store import RunStore
from phyblock.text import counted
from phyblock.tracks import AnyTrack, EpisodeTrack

__all__ = ["begun_anew", "earlier_readers", "take_on"]

_AT_ONCE = 500
"""Lines that share a sync."""


def earlier_readers(found: Manifest) -> str:
    """Which readers read the replies of a run that earlier readers began, and which are here."""
    if not is_read_otherwise(found):
        return "An earlier version of phyblock read the replies of this run, in one of its tracks"
    read = found.versions.get("readers", 1)
    return (
        "An earlier version of phyblock read the replies of this run "
        f"(readers {read}, now {READER_VERSION})"
    )


def begun_anew(plan: RunPlan, folder: Path, found: Manifest) -> set[str]:
    """Samples that earlier readers ended and that go on under the readers of today.

    Nothing is written. Raises StoreError for a record that is not of the run.
    """
    if not plan.has_episodes:
        return set()
    # A notebook's thread has a loop already.
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(asyncio.run, _begun_anew(plan, folder, found)).result()


async def take_on(plan: RunPlan, folder: Path, found: Manifest, tell: Tell) -> Manifest:
    """Read again what the run in `folder` stored, and make it one of the readers of today.

    `found` is its manifest, under an identity that `plan` had under earlier readers; gives the one
    that it has now. `tell` is called with what was done. Raises StoreError when the folder cannot
    be written, holds what is not of the run, or is being written by another process.
    """
    today = plan.manifest.identity
    earlier = [one for one in found.identities or (found.identity,) if one != today]
    begun = found.model_copy(update={"identities": (*earlier, today)})
    with RunStore(folder, plan.going_on(begun), plan.sample_ids()) as store:
        store.take_on(begun)
        done = await _read_again(plan, folder, begun, store)
        changes = {
            "identity": today,
            # What floors reach is read by the readers too.
            "floors": plan.floors(),
            "tracks": plan.manifest.tracks,
            "versions": {**found.versions, "readers": str(READER_VERSION)},
        }
        if plan.manifest.variants:
            changes["variants"] = plan.manifest.variants
        taken = begun.model_copy(update=changes)
        store.take_on(taken)
    tell(f"{earlier_readers(found)}: {done.text}")
    return taken


@dataclass
class _Done:
    """What became of the records of a run: how many were read again, how many of these say
    something else, and how many episodes are asked on.
    """

    replies: int = 0
    otherwise: int = 0
    episodes: int = 0

    def add(self, was: Record, now: Record) -> None:
        """Count a record that was read again."""
        self.replies += 1
        said = [(one.outcome, one.said, one.is_correct, one.scores) for one in (was, now)]
        self.otherwise += said[0] != said[1]

    @property
    def text(self) -> str:
        """What a person should know of it."""
        told = f"{counted(self.replies, 'record')} read again, {self.otherwise:,} of them otherwise"
        if not self.episodes:
            return f"{told}; nobody was asked"
        episodes = f"{counted(self.episodes, 'episode')} will go on"
        return f"{told}; nobody was asked. {episodes} from the first turn that may change"


@dataclass
class _Lines:
    """Lines on their way to a file, many with one sync."""

    file: AppendFile
    waiting: list[Line] = field(default_factory=list)

    def put(self, lines: Sequence[Line]) -> None:
        """Take lines."""
        self.waiting += lines
        if len(self.waiting) >= _AT_ONCE:
            self.flush()

    def flush(self) -> None:
        """Write what waits."""
        self.file.append([line.fields() for line in self.waiting])
        self.waiting.clear()


async def _read_again(plan: RunPlan, folder: Path, begun: Manifest, store: RunStore) -> _Done:
    """Append what the readers of today make of every reply."""
    done, records, turns = _Done(), _Lines(store.records), _Lines(store.turns)
    samples = store.standing.samples
    final = {sample for sample, summary in samples.items() if summary.is_final}
    unfinished = store.begun_turns(final)
    run = plan.manifest.run

    def go_on(sample: str, replies: Sequence[Reply]) -> None:
        turns.put(
            [
                Turn(sample=sample, turn=number, reply=reply, run=run, read_again=True)
                for number, reply in enumerate(replies)
            ]
        )

    for record, track, item in records_with_items(folder, begun, _tracks(plan)):
        if track is None:
            continue
        if isinstance(track, EpisodeTrack):
            now, alike = await read_again(track, item, record)
            lines = unfinished.pop(record.sample, [])
            if now is None or not now.is_final:
                replies = [turn.reply for turn in record.asked_turns]
                go_on(record.sample, max(lines, replies, key=len)[: alike + 1])
            done.episodes += now is None
        else:
            now = await reply_judged_again(track, item, record, {})
        if now is not None:
            records.put([now.model_copy(update={"run": run, "read_again": True})])
            done.add(record, now)
    for sample, replies in unfinished.items():
        # How its turns were read stands nowhere; what was asked first followed from none.
        go_on(sample, replies[:1])
        done.episodes += 1
    turns.flush()
    records.flush()
    return done


async def _begun_anew(plan: RunPlan, folder: Path, found: Manifest) -> set[str]:
    episodes = {
        variant: {name: track for name, track in tracks.items() if isinstance(track, EpisodeTrack)}
        for variant, tracks in _tracks(plan).items()
    }
    return {
        record.sample
        for record, track, item in records_with_items(folder, plan.going_on(found), episodes)
        if isinstance(track, EpisodeTrack) and (await read_again(track, item, record))[0] is None
    }


def _tracks(plan: RunPlan) -> Mapping[str, Mapping[str, AnyTrack]]:
    """The tracks of every way of asking, as records name it."""
    variants = plan.variants.items()
    return {variant.key: {track.name: track for track in tracks} for variant, tracks in variants}
