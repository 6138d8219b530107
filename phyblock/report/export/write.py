"""Exporting a run into a folder."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from phyblock.errors import Problem, StoreError
from phyblock.report.export.flat import EXPORTS
from phyblock.report.export.inspect_log import to_inspect
from phyblock.tables.load import Run

__all__ = ["FORMATS", "export_run"]

_ALL: dict[str, Callable[[Run, Path], tuple[Path, ...]]] = {"inspect": to_inspect, **EXPORTS}
FORMATS = tuple(_ALL)
"""Words for `--to`."""


def export_run(run: Run, form: str, folder: Path | None = None) -> tuple[Path, ...]:
    """Write a run in another format into `folder` (export/FORMAT in the run's); what was written.

    Raises StoreError where the folder cannot be written, SpecError where a package is missing.
    """
    target = folder or run.path / "export" / form
    try:
        target.mkdir(parents=True, exist_ok=True)
        return _ALL[form](run, target)
    except OSError as error:
        raise StoreError(Problem(str(target), f"cannot be written: {error.strerror}")) from error
