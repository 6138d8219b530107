"""The tables of a run as digests, by which two runs are told to say the same."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from phyblock.bundle.about import digest_of
from phyblock.records import Manifest, Record
from phyblock.report.write import write_tables
from phyblock.run.rewritten import write_run

__all__ = ["written_with_tables"]


def written_with_tables(
    folder: Path, manifest: Manifest, records: Iterable[Record]
) -> dict[str, str]:
    """Write a run with its tables into `folder`; the digests of the tables by their file names."""
    write_run(folder, manifest, records)
    return {path.name: digest_of(path) for path in sorted(write_tables(folder).files)}
