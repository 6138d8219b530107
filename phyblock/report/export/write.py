"""Exporting a run into a folder."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from phyblock.files import OutFolder, writing
from phyblock.report.export.flat import EXPORTS
from phyblock.report.export.inspect_log import to_inspect
from phyblock.run.store import run_folder
from phyblock.tables.load import Run

__all__ = ["FORMATS", "export_run"]

_ALL: dict[str, Callable[[Run, Path], tuple[Path, ...]]] = {"inspect": to_inspect, **EXPORTS}
FORMATS = tuple(_ALL)
"""Words for `--to`."""


def export_run(run: Run, form: str, folder: Path | None = None) -> tuple[Path, ...]:
    """Write a run in another format into `folder` (export/FORMAT in the run's); what was written.

    Raises StoreError where the folder cannot be written or a file is in the way that we never
    wrote, SpecError where a package is missing.
    """
    out = OutFolder(folder) if folder else run_folder(run.path)
    below = "" if folder else f"export/{form}/"
    target = out.path / below
    with writing(target), out.making(below) as made:
        files = _ALL[form](run, made)
    return tuple(target / file.relative_to(made) for file in files)
