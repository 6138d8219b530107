"""Judging a bundle: its replies are scored again, and everything has to come out as it says."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

from phyblock.bundle.about import About, read_about
from phyblock.bundle.archive import unpack
from phyblock.bundle.naming import named
from phyblock.bundle.portable import localized
from phyblock.bundle.tables import written_with_tables
from phyblock.errors import Problem, StoreError
from phyblock.parsing import READER_VERSION
from phyblock.records import MANIFEST, RECORDS, Manifest, read_manifest
from phyblock.run.rescore import judged_anew
from phyblock.run.rewritten import manifest_text, records_text

__all__ = ["Verified", "opened_bundle"]

_SHOWN = 5


@dataclass(frozen=True)
class Verified:
    """A bundle that was scored again: `folder` is its run, with the data of this machine, while it
    is open; `records` and `tables` are how many came out as the same bytes.
    """

    about: About
    manifest: Manifest
    folder: Path
    records: int
    tables: int


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
            here = localized(manifest, data, where)
            (folder / MANIFEST).write_text(manifest_text(here), encoding="utf-8")
            judged, records = judged_anew(folder)
        _check_lines(where, about, folder / RECORDS, records_text(records))
        _check_floors(where, about, manifest, judged)
        tables = written_with_tables(Path(scratch) / "again", manifest, records)
        _check_tables(where, about, tables)
        yield Verified(about, manifest, folder, len(records), len(tables))


def _check_lines(where: str, about: About, told: Path, again: str) -> None:
    """Raise StoreError naming the first records that are scored otherwise than they say."""
    now = iter(again.encode().splitlines(keepends=True))
    with told.open("rb") as was:
        pairs = enumerate(zip_longest(was, now), 1)
        wrong = [number for number, (before, after) in pairs if before != after]
    if wrong:
        listed = ", ".join(map(str, wrong[:_SHOWN])) + (", ..." if len(wrong) > _SHOWN else "")
        message = "does not verify: scored again, records come out otherwise"
        found = f"{len(wrong):,} records, at lines {listed} of {RECORDS}"
        raise StoreError(Problem(where, message, found=found, hint=_hint(about)))


def _check_floors(where: str, about: About, told: Manifest, again: Manifest) -> None:
    if told.floors != again.floors:
        message = "does not verify: worked out again, floors come out otherwise"
        raise StoreError(Problem(where, message, "floors", hint=_hint(about)))


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
