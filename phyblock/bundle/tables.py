"""The tables of a run as digests, by which two runs are told to say the same."""

from __future__ import annotations

from pathlib import Path

from phyblock.report.inputs import digest_of_file
from phyblock.report.write import write_tables

__all__ = ["digests_of_tables"]


def digests_of_tables(folder: Path) -> dict[str, str]:
    """Write the tables of a run into its folder; their digests by their file names."""
    return {path.name: digest_of_file(path) for path in sorted(write_tables(folder).files)}
