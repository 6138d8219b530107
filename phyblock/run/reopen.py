"""The tracks of a run opened again, for judging what it stored: nobody is asked anything."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path

from phyblock.datasets import Dataset
from phyblock.errors import DataError, Problem, StoreError
from phyblock.records import MANIFEST, Manifest
from phyblock.run.data import open_dataset
from phyblock.specs import LoadedSuite, SuiteSpec
from phyblock.specs.yaml_source import YamlSource
from phyblock.tracks import AnyTrack, kind_of
from phyblock.tracks.kind import Opening
from phyblock.tracks.opening import open_tracks
from phyblock.tracks.selection import select_tasks

__all__ = ["broken_manifest", "reopen_tracks"]

_HINT = "name the folder where it is now with --data"
_CHANGED = "is not the data set that the run was made on, or it was changed since"


def reopen_tracks(
    folder: Path,
    manifest: Manifest,
    suite: SuiteSpec,
    names: Collection[str],
    data: Path | None,
) -> dict[str, AnyTrack]:
    """The tracks of these names, known to ask what the run in `folder` asked.

    `data` is where the data set is now, if it has moved. Raises StoreError for a manifest that
    names no data, DataError for data that are not what the run was made on.
    """
    dataset = _dataset(folder, manifest, suite, data)
    path = folder / MANIFEST
    folders = {
        name: Path(root) for name in names if (root := kind_of(name).own_root(manifest)) is not None
    }
    source = YamlSource(str(path))
    loaded = LoadedSuite(suite, path, dataset.root, source, folders)
    opening = Opening(loaded, dataset, manifest.limit, with_prompts=False)
    tracks = {track.name: track for track in open_tracks(opening, tuple(names))}
    for name, track in tracks.items():
        _check_alike(name, track, manifest, folders.get(name, dataset.root))
    return tracks


def _dataset(folder: Path, manifest: Manifest, suite: SuiteSpec, data: Path | None) -> Dataset:
    """The data set of the run, whose chosen tasks are known to be those that it was made on."""
    recorded = manifest.dataset
    if recorded is None:
        raise broken_manifest(folder, "dataset")
    root = data or Path(recorded.root)
    if not root.is_dir():
        raise DataError(Problem(str(root), "the data set of the run is not there", hint=_HINT))
    dataset = open_dataset(suite.dataset.format, root)
    chosen = replace(dataset, tasks=select_tasks(dataset.tasks, suite.levels, manifest.limit))
    if chosen.sha256 != recorded.sha256:
        problem = Problem(str(root), _CHANGED, "sha256", chosen.sha256, recorded.sha256, _HINT)
        raise DataError(problem)
    return dataset


def _check_alike(name: str, track: AnyTrack, manifest: Manifest, root: Path) -> None:
    """Raise DataError where a track asks something else, or in another simulator."""
    told = manifest.tracks.get(name, {})
    for key, value in track.identity().items():
        # Prompts and pictures are left out by a track that asks nobody.
        if value is not None and value != told.get(key):
            field, was = f"tracks.{name}.{key}", str(told.get(key))
            raise DataError(Problem(str(root), _CHANGED, field, str(value), was))


def broken_manifest(folder: Path, field: str) -> StoreError:
    """The error for a manifest in which a field is missing or wrong."""
    hint = "run.yaml is written by `phyblock run` and is never edited"
    return StoreError(Problem(str(folder / MANIFEST), "is missing or wrong", field, hint=hint))
