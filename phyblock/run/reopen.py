"""The tracks of a run opened again, for judging what it stored: nobody is asked anything."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from phyblock.config.suite import Suite, SuiteFiles
from phyblock.config.yaml import YamlSource
from phyblock.data import Dataset
from phyblock.errors import DataError, Problem
from phyblock.records.manifest import MANIFEST, Manifest
from phyblock.run.data import CHANGED
from phyblock.tracks import AnyTrack, kind_of
from phyblock.tracks.base import CARRYING, ENGINE, READER
from phyblock.tracks.kind import Opening
from phyblock.tracks.opening import open_tracks

__all__ = ["reopen_tracks"]


def reopen_tracks(
    folder: Path,
    manifest: Manifest,
    suite: Suite,
    names: Collection[str],
    dataset: Dataset,
) -> dict[str, AnyTrack]:
    """The tracks of these names, known to ask what the run in `folder` asked.

    `dataset` is the run's. Raises DataError for other data of a track than those that the run was
    made on.
    """
    path = folder / MANIFEST
    folders = {
        name: Path(root) for name in names if (root := kind_of(name).own_root(manifest)) is not None
    }
    source = YamlSource(str(path))
    suite = suite.with_files(SuiteFiles(path, dataset.root, source, folders))
    opening = Opening(suite, dataset, manifest.limit, with_prompts=False)
    tracks = {track.name: track for track in open_tracks(opening, tuple(names))}
    for name, track in tracks.items():
        _check_alike(name, track, manifest, folders.get(name, dataset.root))
    return tracks


def _check_alike(name: str, track: AnyTrack, manifest: Manifest, root: Path) -> None:
    """Raise DataError where a track asks something else; engines and readers ask nothing."""
    told = manifest.tracks.get(name, {})
    for key, value in track.identity().items():
        # Prompts and pictures are left out by a track that asks nobody.
        if key not in (CARRYING, ENGINE, READER) and value is not None and value != told.get(key):
            field, was = f"tracks.{name}.{key}", str(told.get(key))
            raise DataError(Problem(str(root), CHANGED, field, str(value), was))
