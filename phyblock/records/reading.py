"""Reading a run from disk: its records and turns, line by line, and only those that are its own."""

from __future__ import annotations

from collections.abc import Collection, Container, Iterable
from pathlib import Path

from phyblock.errors import Problem, StoreError
from phyblock.records.belonging import Belonging
from phyblock.records.known import known_records
from phyblock.records.lines import TurnLines
from phyblock.records.manifest import Manifest, read_manifest
from phyblock.records.others import Turn
from phyblock.records.record import Record
from phyblock.records.record_lines import RecordLines
from phyblock.records.reply import Reply

__all__ = ["any_records", "collect_turns", "newest_starts", "read_records", "run_records"]


def run_records(
    folder: Path, manifest: Manifest | None = None, samples: Collection[str] | None = None
) -> RecordLines:
    """The records of a run folder; any that are not the run's own are a StoreError.

    `manifest` is that of the folder, read where it is not given; `samples` are the ids of its
    plan, where that is known.
    """
    belonging = Belonging.of(manifest or read_manifest(folder), samples)
    return RecordLines(folder, known_records(), belonging)


def any_records(folder: Path) -> RecordLines:
    """The records in a folder, whosever they are."""
    return RecordLines(folder, known_records(), None)


def newest_starts(lines: RecordLines, tracks: Collection[str] | None = None) -> dict[str, int]:
    """Where the newest record of every sample begins [bytes], in order of first appearance.

    Only samples of `tracks` are taken, of all where it is None.
    """
    starts: dict[str, int] = {}
    for _, record in lines:
        if tracks is None or record.track in tracks:
            starts[record.sample] = lines.start_bytes
    return starts


def read_records(folder: Path, manifest: Manifest | None = None) -> Iterable[Record]:
    """The newest record of every sample, in order of first appearance, one at a time.

    Raises StoreError for a line that is no record of the run before the first is given.
    """
    lines = run_records(folder, manifest)
    return lines.at(newest_starts(lines).values())


def collect_turns(
    lines: Iterable[tuple[str, Turn]], without: Container[str] = ()
) -> dict[str, list[Reply]]:
    """The replies of every episode that has begun, by sample id, in the order of its turns.

    Samples `without` are left out. Raises StoreError where a turn is missing.
    """
    by_sample: dict[str, dict[int, Reply]] = {}
    for where, line in lines:
        if line.sample in without:
            continue
        turns = by_sample.setdefault(line.sample, {})
        if not 0 <= line.turn <= len(turns):
            message = f"is turn {line.turn} of a sample of which {len(turns)} turns are there"
            raise StoreError(Problem(where, message, "turn", hint=TurnLines.hint))
        turns[line.turn] = line.reply
    return {sample: [turns[n] for n in sorted(turns)] for sample, turns in by_sample.items()}
