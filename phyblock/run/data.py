"""Opening the data set that a suite or a manifest names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from phyblock.data import SCENES_FILE, Dataset, read_builtin, read_official
from phyblock.errors import DataError, Problem
from phyblock.records.manifest import MANIFEST, Manifest
from phyblock.resources import bundled_sets
from phyblock.tracks.selection import select_tasks

__all__ = ["CHANGED", "asked_about", "open_dataset", "recorded_dataset"]

CHANGED = "is not the data set that the run was made on, or it was changed since"
_HINT = "name the folder where it is now with --data"


def open_dataset(format_name: str, path: Path) -> Dataset:
    """Read a data set; DataError when it is not there or broken."""
    if format_name == "official":
        return read_official(path)
    if path.is_dir():
        return read_builtin(path)
    names = ", ".join(bundled_sets(SCENES_FILE))
    allowed = f"a folder with {SCENES_FILE}, or a bundled data set: {names}"
    raise DataError(Problem(str(path), "is no data set", "dataset.path", allowed=allowed))


def recorded_dataset(
    folder: Path, manifest: Manifest, levels: Sequence[int], data: Path | None
) -> Dataset:
    """The whole data set of the run in `folder`, from `data` or from where the run found it.

    Raises DataError where the manifest names none, or where what it was asked about of these
    levels is not what stands there.
    """
    recorded = manifest.dataset
    if recorded is None:
        raise DataError(Problem(str(folder / MANIFEST), "names no data set", "dataset"))
    root = data or Path(recorded.root)
    if not root.is_dir():
        raise DataError(Problem(str(root), "the data set of the run is not there", hint=_HINT))
    dataset = open_dataset(recorded.format, root)
    digest = asked_about(manifest, levels, dataset).sha256
    if digest != recorded.sha256:
        raise DataError(Problem(str(root), CHANGED, "sha256", digest, recorded.sha256, _HINT))
    return dataset


def asked_about(manifest: Manifest, levels: Sequence[int], dataset: Dataset) -> Dataset:
    """What of a data set a run asks about, whose suite has these levels."""
    tasks = select_tasks(dataset.tasks, levels, manifest.limit)
    return replace(dataset, tasks=tasks)
