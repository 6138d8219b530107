"""A run as one file that others can score again: its manifest, its records and their digests.

A bundle is a ZIP archive of three members, the same bytes for the same run. It holds no prompts, no
pictures, of paths of this machine the last part, no address of a server, and of a failed request
its kind and status alone. Whoever sends one may mean harm: members are known by name, nothing is
written under a name that the archive says, and no member is larger than its bound.
"""

from __future__ import annotations

import contextlib
import io
import re
import shutil
import stat
import struct
import tempfile
import zipfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from itertools import zip_longest
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Annotated, Any

from pydantic import Field, TypeAdapter, ValidationError

from phyblock.errors import DataError, InputError, Problem, SpecError, StoreError, reason_of
from phyblock.files import atomic_write, digest_of_file, open_regular, read_bytes, write_named
from phyblock.parsing.text import READER_VERSION
from phyblock.records.files import RECORDS, read_records
from phyblock.records.line import Line, decode, problems_of
from phyblock.records.manifest import MANIFEST, Manifest, read_manifest
from phyblock.records.record import Record
from phyblock.records.reply import Reply
from phyblock.resources import bundled
from phyblock.results.design import read_design
from phyblock.results.tables import write_tables
from phyblock.run.plan import recorded_dataset
from phyblock.run.rescore import judged_anew, recorded_suite, reopen_tracks
from phyblock.run.store import manifest_text, record_lines, run_folder, write_run
from phyblock.text import some_of
from phyblock.tracks.base import kinds_with_physics

BUNDLE_FILE = "bundle.zip"
"""Its name in the run's folder, unless another place is named."""
ABOUT = "bundle.json"
FELL = "what fell is taken from the records"
"""In words, the part that is not scored again."""
_MB = 1024 * 1024
MEMBERS = {ABOUT: 4 * _MB, MANIFEST: 2 * _MB, RECORDS: 512 * _MB}
"""Members in their order, with their largest sizes [bytes]."""
_LARGEST_BYTES = 512 * _MB
_MOST_PACKED, _FREE_BYTES = 100, 16 * _MB
"""A member above so many bytes may be so many times smaller than what it holds: records of rules,
which all read alike, are 26 times smaller."""
_END = struct.Struct("<4s4H2LH")
"""The record at the end of an archive: number and size of its list of members."""
_OTHERS = (ValueError, NotImplementedError, RuntimeError)
"""Raised by zipfile for what it does not read."""
_IS_NOT = "is no description of a bundle"
_HINT = "ask for the bundle again, or make it again with phyblock bundle"
_SENT = frozenset({"params", "sampling"})
"""Keys of what is sent to a model as it stands, where `/no_think` is a word."""
_PROVIDER = re.compile(r"[\w.-]+/(?=/|~/|[A-Za-z]:[\\/])")
"""A provider before a model that is called by its path."""


class About(Line):
    """`bundle.json`: what everything in a bundle must come out as."""

    format: Annotated[int, Field(ge=1, le=1)] = 1
    """Version of the bundle."""
    run: str
    """Identity of the run."""
    phyblock: str
    """The phyblock that made the bundle."""
    readers: int
    """Version of the readers by which it scores replies."""
    files: dict[str, str]
    """Digests of the other members."""
    tables: dict[str, str]
    """Digests of the tables that the records make, by file name."""


@dataclass(frozen=True)
class Verified:
    """A bundle that was scored again: `folder` is its run, with the data of this machine, while it
    is open; `records` and `tables` are how many came out as the same bytes, `expected` how many
    samples a whole run has. Of the tracks in `physics`, by their titles, what fell is taken from
    the records.
    """

    about: About
    manifest: Manifest
    folder: Path
    records: int
    tables: int
    expected: int
    physics: tuple[str, ...]

    @property
    def is_whole(self) -> bool:
        """True if no sample was left out."""
        return self.records == self.expected


@dataclass(frozen=True)
class Bundled:
    """A bundle that was written; `verified` is None where it could not be scored again here, and
    `lacking` says why.
    """

    path: Path
    size_bytes: int
    verified: Verified | None
    lacking: str = ""


def bundle_run(folder: Path, out: Path | None = None, data: Sequence[Path] = ()) -> Bundled:
    """Write a bundle of the run in `folder`, the same bytes for the same run.

    Before it is kept it is verified as `opened_bundle` does, where its data are at hand; `data` are
    folders to look for them in, beside where the run found them. Raises StoreError for a folder
    that is no run, a run whose scores do not come out again, or a file that cannot be written.
    """
    manifest = read_manifest(folder)
    held = (manifest.dataset, manifest.questions)
    known = [Path(one.root) for one in held if one is not None and one.root]
    with tempfile.TemporaryDirectory(prefix="phyblock-") as scratch:
        made, draft = Path(scratch, "run"), Path(scratch, BUNDLE_FILE)
        write_run(made, portable_manifest(manifest), map(portable, read_records(folder, manifest)))
        about = About(
            format=1,
            run=manifest.identity,
            phyblock=version("phyblock"),
            readers=READER_VERSION,
            files={name: digest_of_file(made / name) for name in (MANIFEST, RECORDS)},
            tables=_tables(made),
        )
        files = {name: (made / name).read_bytes() for name in (MANIFEST, RECORDS)}
        packed = pack({**files, ABOUT: about.as_json().encode()})
        atomic_write(draft, packed)
        verified, lacking = None, ""
        try:
            with opened_bundle(draft, [*data, *known], name=str(folder)) as verified:
                pass
        except DataError as error:
            lacking = str(error.problems[0])
    path = out or run_folder(folder).write({BUNDLE_FILE: packed})[0]
    if out is not None:
        write_named(out, packed)
    return Bundled(path, len(packed), verified, lacking)


@contextlib.contextmanager
def opened_bundle(path: Path, data: Sequence[Path] = (), name: str = "") -> Iterator[Verified]:
    """Unpack a bundle, score its replies again, and hold records and tables against what it says.

    `data` are folders in which its data may be, beside the sets that come with phyblock; `name` is
    what messages call it. Raises StoreError for what is no bundle, was changed, or scores otherwise
    than it says, and DataError where its data are not at hand.
    """
    where = name or str(path)
    with tempfile.TemporaryDirectory(prefix="phyblock-") as scratch:
        folder, again = Path(scratch, "run"), Path(scratch, "again")
        folder.mkdir()
        with named(folder, where):
            unpack(path, folder)
            manifest = read_manifest(folder)
            about = _read_about(path, folder, manifest)
            here = _localized(folder, manifest, data, where)
            (folder / MANIFEST).write_text(manifest_text(here), encoding="utf-8")
            judged, records = judged_anew(folder)
        lines = (line.encode() for line in record_lines(records))
        with (folder / RECORDS).open("rb") as stored:
            pairs = enumerate(zip_longest(stored, lines), 1)
            wrong = [str(number) for number, (was, now) in pairs if was != now]
        if wrong:
            found = f"{len(wrong):,} records, at lines {some_of(wrong)} of {RECORDS}"
            raise _otherwise(where, about, "records", found)
        for field in ("items", "scenes", "scenes_by_level"):
            if getattr(manifest, field) != getattr(judged, field):
                raise _otherwise(where, about, field)
        write_run(again, manifest, ())
        shutil.copyfile(folder / RECORDS, again / RECORDS)
        tables = _tables(again)
        if names := sorted(dict(tables.items() ^ about.tables.items())):
            raise _otherwise(where, about, "tables", some_of(names))
        expected = read_design(manifest.fields(), where).all_samples
        physics = tuple(kind.title for kind in kinds_with_physics(manifest.suite))
        yield Verified(about, manifest, folder, len(records), len(tables), expected, physics)


def _otherwise(where: str, about: About, what: str, found: str = "") -> StoreError:
    hint = "score the run again with phyblock score, and bundle what that makes"
    if about.readers != READER_VERSION:
        hint = (
            f"replies were read by readers {about.readers}, here are {READER_VERSION}: take the "
            f"phyblock that made it ({about.phyblock}), or score the run again"
        )
    message = "does not verify: scored again, they come out otherwise"
    return StoreError(Problem(where, message, what, found, hint=hint))


@contextlib.contextmanager
def named(folder: Path, where: str) -> Iterator[None]:
    """Let problems name `where` in the place of `folder`, which nobody has seen."""
    place = str(folder)
    try:
        yield
    except InputError as error:
        raise type(error)(
            replace(
                one,
                where=one.where.replace(place, where),
                message=one.message.replace(place, where),
            )
            for one in error.problems
        ) from error


def _tables(folder: Path) -> dict[str, str]:
    """Write the tables of a run into its folder; their digests by their file names."""
    return {path.name: digest_of_file(path) for path in sorted(write_tables(folder).files)}


def _read_about(path: Path, folder: Path, manifest: Manifest) -> About:
    where = f"{path}: {ABOUT}"
    try:
        about: About = decode(TypeAdapter(About), read_bytes(folder / ABOUT, MEMBERS[ABOUT]))
    except ValidationError as error:
        raise StoreError(problems_of(error, where, About, _IS_NOT, _HINT)) from error
    except ValueError as error:
        raise StoreError(Problem(where, f"{_IS_NOT}: {error}", hint=_HINT)) from error
    if not manifest.models:
        raise StoreError(Problem(f"{path}: {MANIFEST}", "names no model", "models", hint=_HINT))
    found = {f"files.{name}": digest_of_file(folder / name) for name in (MANIFEST, RECORDS)}
    found["run"] = manifest.identity
    said = {**{f"files.{name}": digest for name, digest in about.files.items()}, "run": about.run}
    message = "is not what the bundle says it is: it was changed after it was made"
    if differ := [name for name in found if found[name] != said.get(name)]:
        raise StoreError(
            Problem(str(path), message, name, found[name], said.get(name, ""), _HINT)
            for name in differ
        )
    return about


def _localized(folder: Path, manifest: Manifest, data: Sequence[Path], where: str) -> Manifest:
    """The manifest of the run in `folder` with the places of its data on this machine.

    The first of the folders `data`, or of the sets that come with phyblock, that holds what was
    asked is taken. Raises DataError that names what is missing, StoreError for no plan.
    """
    levels = read_design(manifest.fields(), where).suite.levels
    suite = recorded_suite(folder, manifest)
    for part in ("dataset", "questions"):
        held = getattr(manifest, part)
        if held is None:
            continue
        name = held.name if part == "dataset" else held.root
        is_plain = PurePosixPath(name).name == name and name not in ("", ".", "..")
        own = [bundled("benchmarks", "data", name)] if is_plain else []
        for path in filter(Path.is_dir, (*data, *own)):
            moved = held.model_copy(update={"root": str(path)})
            here = manifest.model_copy(update={part: moved})
            try:
                dataset = recorded_dataset(folder, here, levels, None)
                if part == "questions":
                    for track in reopen_tracks(folder, here, suite, dataset).values():
                        track.close()
            except (DataError, SpecError):
                continue
            manifest = here
            break
        else:
            noun = "questions" if part == "questions" else "data set"
            looked = ", ".join(map(str, data)) or "the sets that come with phyblock"
            message = f"needs the {noun} {name}, which a bundle does not hold"
            allowed = f"{name}, version {held.version}, layout {held.format}"
            hint = "name the folder where it is with --data"
            found = f"not in {looked}"
            raise DataError(Problem(where, message, f"data.{part}", found, allowed, hint))
    return manifest


def portable_manifest(manifest: Manifest) -> Manifest:
    """Return the manifest with the last part of every path, and without addresses of servers.

    What is sent to models stays as it is, and so does the identity, made of what the run was.
    """
    fields = _without_paths(manifest.fields())
    for model in fields.get("models", ()):
        model.pop("served_at", None)
    for part in ("dataset", "questions"):
        held = getattr(manifest, part)
        if held is not None and held.root:
            fields[part]["root"] = Path(held.root).resolve().name
    return Manifest.model_validate(fields)


def _without_paths(value: Any) -> Any:
    if isinstance(value, str):
        return model_name(value)
    if isinstance(value, Mapping):
        return {key: one if key in _SENT else _without_paths(one) for key, one in value.items()}
    return [*map(_without_paths, value)] if isinstance(value, list | tuple) else value


def model_name(text: str) -> str:
    """Return a name, of a path its last part: `hosted_vllm//srv/Qwen` is `hosted_vllm/Qwen`."""
    provider = match[0] if (match := _PROVIDER.match(text)) else ""
    rest = text[len(provider) :]
    is_posix = rest.startswith("~/") or (rest.startswith("/") and rest.count("/") > 1)
    if "\n" in rest or not (is_posix or PureWindowsPath(rest).is_absolute()):
        return text
    return provider + (PurePosixPath(rest) if is_posix else PureWindowsPath(rest)).name


def portable(record: Record) -> Record:
    """Return a record without what a server of this machine said, with plain names of models."""

    def plain(reply: Reply) -> Reply:
        return reply.model_copy(update={"provider_model": model_name(reply.provider_model)})

    changed: dict[str, Any] = {}
    if record.error is not None:
        changed["error"] = record.error.model_copy(update={"message": ""})
    if record.reply is not None:
        changed["reply"] = plain(record.reply)
    if record.asked_turns:
        turns = record.asked_turns
        changed["turns"] = tuple(t.model_copy(update={"reply": plain(t.reply)}) for t in turns)
    return record.model_copy(update=changed)


def pack(contents: Mapping[str, bytes]) -> bytes:
    """Return an archive of all `MEMBERS`; the bytes depend on the contents and zlib alone.

    Raises StoreError for a member that is too large to be read again.
    """
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", allowZip64=False) as archive:
        for name, most in MEMBERS.items():
            if len(contents[name]) > most:
                raise StoreError(Problem(name, f"is larger than {most // _MB:,} MB"))
            info = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
            info.compress_type, info.create_system = zipfile.ZIP_DEFLATED, 3
            info.external_attr = (stat.S_IFREG | 0o644) << 16
            archive.writestr(info, contents[name], compresslevel=9)
    return file.getvalue()


def unpack(path: Path, folder: Path) -> None:
    """Write the members of the bundle at `path` into `folder`; StoreError for what is none."""
    try:
        with open_regular(path) as file:
            size = file.seek(0, io.SEEK_END)
            file.seek(max(0, size - _END.size))
            tail = file.read()
            # Bound what the archive says of its list of members, before anything reads that list.
            listed, list_bytes = _END.unpack(tail)[4:6] if len(tail) == _END.size else (0, 0)
            if listed != len(MEMBERS) or list_bytes > 2**16 or size > _LARGEST_BYTES:
                raise ValueError("is cut short, too large or no archive of three members")
            with zipfile.ZipFile(file) as archive:
                infos = archive.infolist()
                if sorted(info.filename for info in infos) != sorted(MEMBERS):
                    raise ValueError("has members of other names")
                for info in infos:
                    _check_member(info)
                    with archive.open(info) as packed, (folder / info.filename).open("xb") as out:
                        shutil.copyfileobj(packed, out)
    except FileNotFoundError as error:
        raise StoreError(Problem(str(path), "is not there")) from error
    except (zipfile.BadZipFile, zlib.error, struct.error, EOFError, OSError, *_OTHERS) as error:
        message, allowed = f"is no bundle, or is damaged: {reason_of(error)}", ", ".join(MEMBERS)
        raise StoreError(Problem(str(path), message, allowed=allowed, hint=_HINT)) from error


def _check_member(info: zipfile.ZipInfo) -> None:
    """Raise ValueError for a member that would harm or fill this machine."""
    mode, name = info.external_attr >> 16, info.filename
    is_dense = info.file_size > _MOST_PACKED * max(info.compress_size, 1)
    if stat.S_IFMT(mode) not in (0, stat.S_IFREG):
        raise ValueError(f"{name} is a link or the like")
    if info.flag_bits & 1 or info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise ValueError(f"{name} is packed in a way that is not taken")
    if info.file_size > MEMBERS[name] or (is_dense and info.file_size > _FREE_BYTES):
        raise ValueError(f"{name} would unpack to far more than it may hold")
