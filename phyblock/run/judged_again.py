"""Stored replies and episodes judged again, record by record: nothing is asked, nothing written."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

from phyblock.config.suite import Variant
from phyblock.errors import Problem, StoreError
from phyblock.parsing.text import READER_VERSION
from phyblock.records.files import RECORDS, read_records
from phyblock.records.manifest import Manifest
from phyblock.records.record import Record
from phyblock.run.extraction import read_extraction
from phyblock.run.judging import judged_apart
from phyblock.run.records import about_item
from phyblock.run.replayed import counted_again
from phyblock.text import counted
from phyblock.tracks import AnyTrack, EpisodeTrack, SingleTrack, kind_of, shown_item

Tell = Callable[[str], object]
"""Takes what a person should know of what was done."""


def untold(_: str) -> None:
    """Tell nobody."""


async def judged_again(
    folder: Path,
    manifest: Manifest,
    variants: Mapping[str, Mapping[str, AnyTrack]],
    tell: Tell,
    *,
    anew: bool,
    watch: Callable[[int], object] = lambda _: None,
) -> list[Record]:
    """The records of the run in `folder`, those of the tracks of `variants` judged again.

    With `anew`, what they say of their items is taken from the data as well. An episode that would
    take another course today stays as it was, since what was asked next followed from what was
    read then; `tell` is told. With `anew` it is a fault.
    `watch` is called with the number of records that are done.
    Raises StoreError for a record that is not of the run, and for such a fault.
    """
    or_kept = not anew
    kept: Counter[str] = Counter()
    where = str(folder / RECORDS)
    records: list[Record] = []
    for record, track, item in records_with_items(folder, manifest, variants):
        watch(len(records))
        if track is None:
            records.append(record)
            continue
        about = {**about_item(item), **track.about(item)} if anew else None
        if isinstance(track, EpisodeTrack):
            again = await counted_again(track, item, record, where, about, or_kept=or_kept)
            kept[track.name] += again is record
            records.append(again)
        else:
            records.append(await reply_judged_again(track, item, record, about or {}))
    for name, count in kept.items():
        if count:
            tell(
                f"{kind_of(name).title}: {counted(count, 'episode')} would take another course "
                f"with today's readers ({READER_VERSION}) and stay as they were: what was asked "
                "next followed from what was read."
            )
    return records


def records_with_items(
    folder: Path, manifest: Manifest, variants: Mapping[str, Mapping[str, AnyTrack]]
) -> Iterator[tuple[Record, AnyTrack | None, Any]]:
    """The newest record of every sample of the run in `folder`, with its track and its item as it
    was shown; None for both where `variants` lacks the track.

    Raises StoreError for a record that is not of the run.
    """
    where = str(folder / RECORDS)
    tracks = variants[""]
    items = {(name, item.key): item for name, track in tracks.items() for item in track.items}
    for record in read_records(folder, manifest):
        track = variants[_variant(record, variants, where).shown.key].get(record.track)
        if track is None:
            yield record, None, None
            continue
        item = items.get((track.name, record.item))
        if item is None:
            message, hint = "names an item that the run has not", "restore the file from a copy"
            raise StoreError(Problem(where, message, "key", record.item, hint=hint))
        yield record, track, shown_item(track, item, record.seed)


async def reply_judged_again(
    track: SingleTrack[Any], item: Any, record: Record, about: Mapping[str, Any]
) -> Record:
    """The record of a stored reply, judged again."""
    text = None if record.reply is None else record.reply.text
    given = {**record.as_given(), **about}
    earlier: Record | None = record
    if not record.is_judged:
        # What it holds is of no plan that was carried out.
        given["error"] = earlier = None
    again = await judged_apart(track, item, text, given, earlier)
    if again.outcome != "parse_failure" or record.extraction is None:
        return again
    return await read_extraction(track, item, again, record.extraction, earlier)


def _variant(record: Record, known: Collection[str], where: str) -> Variant:
    """The way of asking of a record; StoreError for one that the run has not."""
    variant = record.way
    if variant.shown.key not in known:
        message, hint = "was asked in no way of the run", "restore the file from a copy"
        raise StoreError(Problem(where, message, "variant", variant.key, hint=hint))
    return variant
