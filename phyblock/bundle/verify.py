"""Judging a bundle: its replies are scored again, and everything has to come out as it says."""

from __future__ import annotations

import contextlib
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

from phyblock.bundle.about import About, read_about
from phyblock.bundle.archive import unpack
from phyblock.bundle.naming import named
from phyblock.bundle.portable import localized
from phyblock.bundle.tables import digests_of_tables
from phyblock.errors import Problem, StoreError
from phyblock.parsing.text import READER_VERSION
from phyblock.records.files import RECORDS
from phyblock.records.manifest import MANIFEST, Manifest, read_manifest
from phyblock.records.record import Record
from phyblock.run.rescore import judged_anew
from phyblock.run.rewritten import manifest_text, record_lines, write_run
from phyblock.tables.design import read_design
from phyblock.tracks.kind import kinds_with_physics

__all__ = ["FELL", "Verified", "opened_bundle"]

FELL = "what fell is taken from the records"
"""What is not scored again, in words."""
_SHOWN = 5


@dataclass(frozen=True)
class Verified:
    """A bundle that was scored again: `folder` is its run, with the data of this machine, while it
    is open; `records` and `tables` are how many came out as the same bytes, `expected` how many
    samples a whole run has. Of the tracks in `physics`, by their titles, what fell is taken from
    the records.
    """

    about: About
    manifest: Manifest
    folder: Path
    records: int
    tables: int
    expected: int
    physics: tuple[str, ...]

    @property
    def is_whole(self) -> bool:
        """Whether no sample was left out."""
        return self.records == self.expected


@contextlib.contextmanager
def opened_bundle(path: Path, data: Sequence[Path] = (), name: str = "") -> Iterator[Verified]:
    """Unpack a bundle, score its replies again, and hold records and tables against what it says.

    `data` are folders in which its data may be, beside the sets that come with phyblock; `name` is
    what messages call it. Raises StoreError for what is no bundle, was changed, or scores otherwise
    than it says, and DataError where its data are not at hand.
    """
    where = name or str(path)
    with tempfile.TemporaryDirectory(prefix="phyblock-") as scratch:
        folder = Path(scratch) / "run"
        folder.mkdir()
        with named(folder, where):
            unpack(path, folder)
            manifest = read_manifest(folder)
            about = read_about(path, folder, manifest)
            here = localized(folder, manifest, data, where)
            (folder / MANIFEST).write_text(manifest_text(here), encoding="utf-8")
            judged, records = judged_anew(folder)
        _check_lines(where, about, folder / RECORDS, records)
        _check_worked_out(where, about, manifest, judged)
        again = Path(scratch) / "again"
        write_run(again, manifest, ())
        # What was scored again has come out as the same bytes.
        shutil.copyfile(folder / RECORDS, again / RECORDS)
        n_records = len(records)
        del records
        _check_tables(where, about, digests_of_tables(again))
        expected = read_design(manifest.fields(), where).all_samples
        physics = tuple(kind.title for kind in kinds_with_physics(manifest.suite))
        yield Verified(about, manifest, folder, n_records, len(about.tables), expected, physics)


def _check_lines(where: str, about: About, stored: Path, again: Iterable[Record]) -> None:
    """Raise StoreError naming the first records that are scored otherwise than they say."""
    now = (line.encode() for line in record_lines(again))
    with stored.open("rb") as was:
        pairs = enumerate(zip_longest(was, now), 1)
        wrong = [number for number, (before, after) in pairs if before != after]
    if wrong:
        listed = ", ".join(map(str, wrong[:_SHOWN])) + (", ..." if len(wrong) > _SHOWN else "")
        message = "does not verify: scored again, records come out otherwise"
        found = f"{len(wrong):,} records, at lines {listed} of {RECORDS}"
        raise StoreError(Problem(where, message, found=found, hint=_hint(about)))


def _check_worked_out(where: str, about: About, stored: Manifest, again: Manifest) -> None:
    """Raise StoreError naming what follows from suite and data and is said otherwise."""
    for field in ("floors", "items", "scenes", "scenes_by_level"):
        if getattr(stored, field) != getattr(again, field):
            message = f"does not verify: worked out again, {field} come out otherwise"
            raise StoreError(Problem(where, message, field, hint=_hint(about)))


def _check_tables(where: str, about: About, tables: dict[str, str]) -> None:
    names = sorted({*tables, *about.tables})
    wrong = [name for name in names if tables.get(name) != about.tables.get(name)]
    if wrong:
        listed = ", ".join(wrong[:_SHOWN]) + (", ..." if len(wrong) > _SHOWN else "")
        message = "does not verify: made again, tables come out otherwise"
        raise StoreError(Problem(where, message, found=listed, hint=_hint(about)))


def _hint(about: About) -> str:
    """What may be behind it."""
    if about.readers != READER_VERSION:
        return (
            f"replies were read by readers {about.readers}, here are {READER_VERSION}: take the "
            f"phyblock that made it ({about.phyblock}), or score the run again with phyblock score"
        )
    return "score the run again with phyblock score, and bundle what that makes"
