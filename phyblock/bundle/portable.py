"""A run without what is of one machine, and a run from elsewhere with the data of this one."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any

from phyblock.bundle.about import BundledData, data_of
from phyblock.bundle.texts import Cleaner, model_name, without_paths
from phyblock.errors import DataError, Problem, SpecError
from phyblock.records.manifest import Manifest
from phyblock.records.record import Record
from phyblock.records.reply import Reply
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
    """The manifest with the last part of every path, and without the addresses of servers.

    What is sent to models stays as it is, and so does the identity, made of what the run was.
    """
    fields = without_paths(manifest.fields())
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
    """Records whose errors and names of models tell no path and no server of this machine; nothing
    else of them is changed.
    """
    held = (manifest.dataset, manifest.questions)
    named = [Path(one.root) for one in held if one is not None]
    homes = {folder.resolve().parent, Path.home(), Path.cwd(), *named}
    roots = {str(path) for path in homes if len(path.parts) > 1}
    cleaner = Cleaner(roots, [at for model in manifest.models for at in model.served_at])
    for record in records:
        changed: dict[str, Any] = {}
        if (error := record.error) is not None:
            message = cleaner.clean(error.message)
            changed["error"] = error.model_copy(update={"message": message})
        if record.reply is not None:
            changed["reply"] = _portable_reply(record.reply)
        if record.asked_turns:
            changed["turns"] = tuple(
                turn.model_copy(update={"reply": _portable_reply(turn.reply)})
                for turn in record.asked_turns
            )
        yield record.model_copy(update=changed)


def _portable_reply(reply: Reply) -> Reply:
    if (name := model_name(reply.provider_model)) == reply.provider_model:
        return reply
    return reply.model_copy(update={"provider_model": name})


def localized(folder: Path, manifest: Manifest, data: Sequence[Path], where: str) -> Manifest:
    """The manifest of the run in `folder` with the places of its data on this machine.

    They are looked for in the folders `data`, by name first, and among the sets that come with
    phyblock; the first that holds what was asked is taken. Raises DataError that names what is
    missing, StoreError for a manifest that names no plan.
    """
    levels = read_design(manifest.fields(), where).suite.levels
    holds = {"dataset": partial(_is_dataset, levels), "questions": partial(_is_asked, folder)}
    problems: list[Problem] = []
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
