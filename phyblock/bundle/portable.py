"""A run without what is of one machine, and a run from elsewhere with the data of this one."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any

from phyblock.bundle.about import BundledData, data_of
from phyblock.errors import DataError, Problem, SpecError
from phyblock.records import Manifest, Record
from phyblock.resources import bundled
from phyblock.run.data import asked_about, open_dataset, recorded_dataset
from phyblock.run.reopen import reopen_tracks
from phyblock.run.rescore import recorded_suite
from phyblock.tables.design import read_design
from phyblock.tracks.kind import kind_of

__all__ = ["localized", "portable_manifest", "portable_records"]

_SERVED_AT = "served_at"
_ROOT = "root"


def portable_manifest(manifest: Manifest) -> Manifest:
    """The manifest with the last part of every path, and without the addresses of servers."""
    fields = _without_paths(manifest.fields())
    for model in fields.get("models", ()):
        model.pop(_SERVED_AT, None)
    for part in ("dataset", "questions"):
        held = getattr(manifest, part)
        if held is not None and held.root:
            fields[part][_ROOT] = Path(held.root).resolve().name
    return Manifest.model_validate(fields)


def portable_records(
    records: Iterable[Record], manifest: Manifest, folder: Path
) -> Iterator[Record]:
    """Records whose errors name no path of this machine; nothing else of them is changed."""
    named = map(Path, _paths(manifest.fields()))
    homes = {folder.resolve().parent, Path.home(), Path.cwd(), *named}
    roots = sorted((str(path) for path in homes if len(path.parts) > 1), key=len, reverse=True)
    for record in records:
        if record.error is None:
            yield record
            continue
        message = record.error.message
        for root in roots:
            message = message.replace(root, PurePosixPath(root).name)
        error = record.error.model_copy(update={"message": message})
        yield record if error == record.error else record.model_copy(update={"error": error})


def _without_paths(value: Any) -> Any:
    if isinstance(value, str):
        return _last_part(value) if _is_path(value) else value
    if isinstance(value, Mapping):
        return {key: _without_paths(below) for key, below in value.items()}
    if isinstance(value, (list, tuple)):
        return [_without_paths(below) for below in value]
    return value


def _paths(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        if _is_path(value):
            yield value
    elif isinstance(value, Mapping):
        for below in value.values():
            yield from _paths(below)
    elif isinstance(value, (list, tuple)):
        for below in value:
            yield from _paths(below)


def _is_path(text: str) -> bool:
    """Whether a text is a path that begins at the root of a machine, or at somebody's home."""
    if "\n" in text:
        return False
    return text.startswith(("/", "~/")) or PureWindowsPath(text).is_absolute()


def _last_part(text: str) -> str:
    return (PurePosixPath(text) if "/" in text else PureWindowsPath(text)).name


def localized(folder: Path, manifest: Manifest, data: Sequence[Path], where: str) -> Manifest:
    """The manifest of the run in `folder` with the places of its data on this machine.

    They are looked for in the folders `data`, by name first, and among the sets that come with
    phyblock; the first that holds what was asked is taken. Raises DataError that names what is
    missing, StoreError for a manifest that names no plan.
    """
    levels = read_design(manifest.fields(), where).suite.levels
    holds = {"dataset": partial(_is_dataset, levels), "questions": partial(_is_asked, folder)}
    problems = []
    for part, needed in data_of(manifest).items():
        places = (path for path in _places(needed.name, data) if path.is_dir())
        moved = (_moved(manifest, part, path) for path in places)
        # What questions are about is known only where the scenes were found.
        is_sure = not problems
        here = next((one for one in moved if not is_sure or holds[part](one)), None)
        if here is None:
            problems.append(_missing(where, part, needed, data))
        manifest = here or manifest
    if problems:
        raise DataError(problems)
    return manifest


def _moved(manifest: Manifest, part: str, path: Path) -> Manifest:
    """The manifest with a part of its data in another folder."""
    held = getattr(manifest, part).model_copy(update={_ROOT: str(path)})
    return manifest.model_copy(update={part: held})


def _places(name: str, folders: Sequence[Path]) -> list[Path]:
    named = [path for path in folders if path.resolve().name == name]
    plain = PurePosixPath(name).name == name and name not in ("", ".", "..")
    own = [bundled("benchmarks", "data", name)] if plain else []
    return [*named, *own, *(path for path in folders if path not in named)]


def _is_dataset(levels: Sequence[int], manifest: Manifest) -> bool:
    """Whether the scenes that the run asked about stand where it says as they were then."""
    assert manifest.dataset is not None
    try:
        dataset = open_dataset(manifest.dataset.format, Path(manifest.dataset.root))
    except DataError:
        return False
    return asked_about(manifest, levels, dataset).sha256 == manifest.dataset.sha256


def _is_asked(folder: Path, manifest: Manifest) -> bool:
    """Whether the questions that the run asked stand where it says as they were then."""
    suite = recorded_suite(folder, manifest)
    names = [name for name in suite.tracks if kind_of(name).own_root(manifest) is not None]
    try:
        dataset = recorded_dataset(folder, manifest, suite.levels, None)
        for track in reopen_tracks(folder, manifest, suite, names, dataset).values():
            track.close()
    except (DataError, SpecError):
        return False
    return True


def _missing(where: str, part: str, needed: BundledData, folders: Sequence[Path]) -> Problem:
    noun = "questions" if part == "questions" else "data set"
    looked = ", ".join(map(str, folders)) or "the sets that come with phyblock"
    digest = f", digest {needed.sha256[:12]}" if needed.sha256 else ""
    return Problem(
        where,
        f"needs the {noun} {needed.name}, which a bundle does not hold",
        f"data.{part}",
        f"not in {looked}",
        f"{needed.name}, version {needed.version}, layout {needed.format}{digest}",
        "name the folder where it is with --data",
    )
