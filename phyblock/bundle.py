"""A run as one file that others can score again: its manifest, its records and their digests.

A bundle is a ZIP archive of three members, the same bytes for the same run. It holds no prompts,
pictures or addresses of servers, of local paths only the last part, and of failed requests only
kind and status. It may be hostile: members have known names and sizes, and no path in it is used.
"""

from __future__ import annotations

import hashlib
import io
import json
import shutil
import tempfile
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import version
from itertools import zip_longest
from pathlib import Path

from phyblock import files
from phyblock.config.yaml import dump_yaml
from phyblock.errors import DataError, InputError, Problem, SpecError, StoreError, reason_of
from phyblock.records.files import MANIFEST, RECORDS, Manifest, read_manifest, read_records
from phyblock.records.record import Record
from phyblock.results.load import design_of
from phyblock.run.manifest import portable_manifest, without_paths
from phyblock.run.rescore import recorded_dataset, reopen_tracks, rescored
from phyblock.run.store import record_lines
from phyblock.tracks.base import simulating

BUNDLE_FILE = "bundle.zip"  # Its name in the run's folder, unless another place is named.
ABOUT = "bundle.json"
"""Member with the version of phyblock that made the bundle, and digests of the others."""
_MB = 1024 * 1024
MEMBERS = {MANIFEST: 2 * _MB, RECORDS: 512 * _MB, ABOUT: _MB}
"""Members in their order, with their largest sizes [bytes]."""
_LARGEST_BYTES = 128 * _MB
_BROKEN = (zipfile.BadZipFile, zlib.error, EOFError, OSError, ValueError, RuntimeError)
_HINT = "ask for the bundle again, or make it again with phyblock bundle"
_NEVER_VERIFIED = (
    "What was sent: a bundle holds the digests of prompts and pictures, not the originals.",
    "That the models gave these replies, when, how fast and at what cost: no bundle can show it.",
)


@dataclass(frozen=True)
class Verified:
    """A bundle that was scored again.

    `folder` is its run with this machine's data, while it is open; `records` and `expected` are the
    numbers of records and of samples of a complete run; `unverified` says what was not checked.
    """

    phyblock: str
    manifest: Manifest
    folder: Path
    records: int
    expected: int
    unverified: tuple[str, ...]


def bundle_run(folder: Path, out: Path | None = None) -> Path:
    """Write a bundle of the run in `folder`; return its path. Raises StoreError if that fails."""
    manifest = read_manifest(folder)
    records = record_lines(map(portable, read_records(folder, manifest)))
    members = {MANIFEST: [dump_yaml(portable_manifest(manifest).fields())], RECORDS: records}
    # The temporary file has no name: a kill leaves nothing behind.
    with tempfile.TemporaryFile() as file:
        with zipfile.ZipFile(file, "w", allowZip64=False) as archive:
            digests = {name: add(archive, name, each) for name, each in members.items()}
            about = {"format": 1, "phyblock": version("phyblock"), "files": digests}
            add(archive, ABOUT, [json.dumps(about)])
        file.seek(0)
        packed = iter(partial(file.read, _MB), b"")
        if out is None:
            return files.OutFolder(folder).write({BUNDLE_FILE: packed})[0]
        files.write_named(out, packed)
        return out


def add(archive: zipfile.ZipFile, name: str, lines: Iterable[str]) -> str:
    """Write a member; return its SHA-256. Raises StoreError if it is too large to be read back."""
    info, digest = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), hashlib.sha256()
    info.compress_type, info.create_system = zipfile.ZIP_DEFLATED, 3
    left = MEMBERS[name]
    with archive.open(info, "w") as member:
        for line in lines:
            data = line.encode("utf-8", "replace")
            left -= len(data)
            if left < 0:
                raise StoreError(Problem(name, f"is larger than {MEMBERS[name] // _MB:,} MB"))
            digest.update(data)
            member.write(data)
    return digest.hexdigest()


@contextmanager
def opened_bundle(path: Path, data: Sequence[Path] = ()) -> Iterator[Verified]:
    """Unpack a bundle, score its replies again, and compare its records with the result.

    `data` are folders to look for its data in, besides the bundled sets. Raises StoreError if it is
    not a bundle, was changed, or is scored differently, and DataError if its data are not found.
    Errors, also those of the body, name files as if the bundle were a folder.
    """
    with tempfile.TemporaryDirectory(prefix="phyblock-") as scratch:
        folder = Path(scratch, path.name)
        folder.mkdir()
        try:
            made_by = unpack(path, folder)
            here = _localized(folder, read_manifest(folder), data)
            (folder / MANIFEST).write_text(dump_yaml(here.fields()), encoding="utf-8")
            judged, again = rescored(folder)
            counted = ("items", "scenes", "scenes_by_level")
            differ = [name for name in counted if getattr(here, name) != getattr(judged, name)]
            if differ or not here.models:
                raise _differs(folder / MANIFEST, ", ".join(differ) or "models", made_by)
            count, seen = 0, set[str]()
            with (folder / RECORDS).open("rb") as stored:
                for count, (was, record) in enumerate(zip_longest(stored, again), 1):
                    where = f"{folder / RECORDS}:{count}"
                    now = "" if record is None else next(record_lines([record]))
                    if record is None or was != now.encode() or record.sample in seen:
                        raise _differs(where, "", made_by)
                    seen.add(record.sample)
            expected = design_of(here, str(path)).all_samples
            physics = ", ".join(kind.title for kind in simulating(here.suite))
            fell = [f"{physics}: what fell and where it came to rest."] if physics else []
            yield Verified(made_by, here, folder, count, expected, (*fell, *_NEVER_VERIFIED))
        except InputError as error:
            shown = [
                replace(p, where=p.where.replace(str(folder), str(path))) for p in error.problems
            ]
            raise type(error)(shown) from error


def _differs(where: object, field: str, made_by: str) -> StoreError:
    message = "does not verify: rescored records differ"
    hint = f"{_HINT}; it was made by phyblock {made_by}"
    return StoreError(Problem(str(where), message, field, hint=hint))


def _localized(folder: Path, manifest: Manifest, data: Sequence[Path]) -> Manifest:
    """Return the manifest of the run in `folder` with the paths of its data on this machine.

    Takes the first of `data` and the bundled sets that has the data. Raises DataError, StoreError.
    """
    suite = design_of(manifest, str(folder / MANIFEST)).suite
    for part, noun in (("dataset", "data set"), ("questions", "questions")):
        if (held := getattr(manifest, part)) is None:
            continue
        name = held.name if part == "dataset" else held.root
        ours = [path for path in files.bundled("benchmarks", "data").iterdir() if path.name == name]
        for path in filter(Path.is_dir, (*data, *ours)):
            moved = held.model_copy(update={"root": str(path)})
            here = manifest.model_copy(update={part: moved})
            with suppress(DataError, SpecError):
                dataset = recorded_dataset(folder, here)
                if part == "questions":
                    reopen_tracks(folder, here, suite, dataset)
                manifest = here
                break
        else:
            message = f"needs the {noun} {name}, which a bundle does not hold"
            allowed = f"{name}, version {held.version}, layout {held.format}"
            hint = "name the folder where it is with --data"
            raise DataError(Problem(str(folder), message, f"data.{part}", "", allowed, hint))
    return manifest


def portable(record: Record) -> Record:
    """Return a record without messages of servers and without local paths of models."""
    fields = record.fields()
    if fields.get("error") is not None:
        fields["error"]["message"] = ""
    for reply in (fields.get("reply"), *(turn.get("reply") for turn in fields.get("turns", ()))):
        if reply is not None and "provider_model" in reply:
            reply["provider_model"] = without_paths(reply["provider_model"])
    return type(record).model_validate(fields)


def unpack(path: Path, folder: Path) -> str:
    """Unpack a bundle; return the version that made it. Raises StoreError if it is broken."""
    try:
        with files.open_regular(path) as file:
            if file.seek(0, io.SEEK_END) > _LARGEST_BYTES:
                raise ValueError(f"is larger than {_LARGEST_BYTES // _MB} MB")
            with zipfile.ZipFile(file) as archive:
                infos = archive.infolist()
                if sorted(info.filename for info in infos) != sorted(MEMBERS):
                    raise ValueError("has members with other names")
                for info in infos:
                    is_plain = info.compress_type in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
                    if info.file_size > MEMBERS[info.filename] or not is_plain:
                        raise ValueError(f"{info.filename} is too large, or its packing unknown")
                    with archive.open(info) as packed, (folder / info.filename).open("xb") as out:
                        shutil.copyfileobj(packed, out)
        about = files.load_json(files.read_bytes(folder / ABOUT))
        digests = {name: files.digest_of_file(folder / name) for name in (MANIFEST, RECORDS)}
        if not isinstance(about, dict) or (about.get("format"), about.get("files")) != (1, digests):
            raise ValueError(f"the digests in {ABOUT} do not match the other members")
        return str(about.get("phyblock"))
    except FileNotFoundError as error:
        raise StoreError(Problem(str(path), "is not there")) from error
    except _BROKEN as error:
        message, allowed = f"is not a bundle, or is damaged: {reason_of(error)}", ", ".join(MEMBERS)
        raise StoreError(Problem(str(path), message, allowed=allowed, hint=_HINT)) from error
