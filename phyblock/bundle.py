"""A run as one file that others can score again: its manifest, its records and their digests.

A bundle is a ZIP archive of three members, the same bytes for the same run. It holds no prompts, no
pictures, of paths of this machine the last part, no address of a server, and of a failed request
its kind and status alone. It is written as a stream, without a copy under a name. Whoever sends one
may mean harm: members are known by name, nothing is written under a name that the archive says, and
no member is larger than its bound.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import re
import shutil
import stat
import struct
import tempfile
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from functools import partial
from importlib.metadata import version
from itertools import zip_longest
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import IO, Annotated, Any

from pydantic import Field, TypeAdapter, ValidationError

from phyblock.errors import DataError, InputError, Problem, SpecError, StoreError, reason_of
from phyblock.files import OutFolder, digest_of_file, open_regular, read_bytes, write_named
from phyblock.parsing.text import READER_VERSION
from phyblock.records.files import RECORDS, read_records
from phyblock.records.line import Line, decode, problems_of
from phyblock.records.manifest import MANIFEST, Manifest, read_manifest
from phyblock.records.record import Record, Reply, SentPrompt
from phyblock.resources import bundled
from phyblock.results.load import design_of
from phyblock.run.judge import about_prompt
from phyblock.run.plan import recorded_dataset
from phyblock.run.rescore import judged_anew, recorded_suite, reopen_tracks
from phyblock.run.store import manifest_text, prompt_of, record_lines
from phyblock.stable import hex_digest
from phyblock.text import some_of
from phyblock.tracks import AnyTrack, EpisodeTrack, Item, kind_of
from phyblock.tracks.base import kinds_with_physics

BUNDLE_FILE = "bundle.zip"
"""Its name in the run's folder, unless another place is named."""
ABOUT = "bundle.json"
_MB = 1024 * 1024
MEMBERS = {MANIFEST: 2 * _MB, RECORDS: 512 * _MB, ABOUT: 4 * _MB}
"""Members in their order, with their largest sizes [bytes]."""
_CHUNK_BYTES = _MB
_SHOWN = ("prompt", "pictures", "examples")
"""Parts of a track's identity that say what models were shown."""
_EARLIEST = datetime(2025, 1, 1, tzinfo=UTC)
_CLOCKS = timedelta(days=1)
"""Times of records lie after the one, and in the future by no more than clocks differ."""
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


@dataclass(frozen=True)
class Verified:
    """A bundle that was scored again: `folder` is its run, with the data of this machine, while it
    is open; `records` came out as the same bytes, `expected` is how many samples a whole run has.
    `unverified` are sentences on what was taken as the bundle says it.
    """

    about: About
    manifest: Manifest
    folder: Path
    records: int
    expected: int
    unverified: tuple[str, ...]

    @property
    def is_whole(self) -> bool:
        """True if no sample was left out."""
        return self.records == self.expected


def bundle_run(folder: Path, out: Path | None = None) -> Path:
    """Write a bundle of the run in `folder`, the same bytes for the same run, and return its path.

    Raises StoreError for a folder that is no run, or a file that cannot be written.
    """
    manifest = read_manifest(folder)
    text = manifest_text(portable_manifest(manifest)).encode()
    digest = hashlib.sha256()

    def records() -> Iterator[bytes]:
        for line in record_lines(map(portable, read_records(folder, manifest))):
            data = line.encode("utf-8", "replace")
            digest.update(data)
            yield data

    def about() -> Iterator[bytes]:
        digests = {MANIFEST: hex_digest(text), RECORDS: digest.hexdigest()}
        run, made_by = manifest.identity, version("phyblock")
        told = About(format=1, run=run, phyblock=made_by, readers=READER_VERSION, files=digests)
        yield told.as_json().encode()

    # A file without a name: a kill leaves nothing behind.
    with tempfile.TemporaryFile() as file:
        pack(file, {MANIFEST: [text], RECORDS: records(), ABOUT: about()})
        file.seek(0)
        packed = iter(partial(file.read, _CHUNK_BYTES), b"")
        if out is None:
            return OutFolder(folder).write({BUNDLE_FILE: packed})[0]
        write_named(out, packed)
        return out


@contextlib.contextmanager
def opened_bundle(path: Path, data: Sequence[Path] = ()) -> Iterator[Verified]:
    """Unpack a bundle, score its replies and render its prompts again, and hold its records against
    what comes out.

    `data` are folders in which its data may be, beside the sets that come with phyblock. Raises
    StoreError for what is no bundle, was changed, or comes out otherwise than it says, and
    DataError where its data are not at hand.
    """
    where = str(path)
    with tempfile.TemporaryDirectory(prefix="phyblock-") as scratch:
        folder = Path(scratch, "run")
        folder.mkdir()
        with named(folder, where):
            unpack(path, folder)
            manifest = read_manifest(folder)
            about = _read_about(path, folder, manifest)
            here = _localized(folder, manifest, data, where)
            (folder / MANIFEST).write_text(manifest_text(here), encoding="utf-8")
            judged, again = judged_anew(folder)
            prompts = AskedPrompts(folder, here, is_ours=about.phyblock == version("phyblock"))
            wrong: dict[str, list[str]] = {"records": [], "prompts": [], "time": []}
            count, seen = 0, set[str]()
            with (folder / RECORDS).open("rb") as stored:
                for count, (was, record) in enumerate(zip_longest(stored, again), 1):
                    now = b"" if record is None else next(record_lines([record])).encode()
                    if record is None or was != now or record.sample in seen:
                        wrong["records"].append(str(count))
                        continue
                    seen.add(record.sample)
                    if not prompts.made(record):
                        wrong["prompts"].append(str(count))
                    if not _is_time(record.time):
                        wrong["time"].append(str(count))
        for what, lines in wrong.items():
            if lines:
                found = f"{len(lines):,} records, at lines {some_of(lines)} of {RECORDS}"
                raise _otherwise(where, about, what, found)
        for name in ("items", "scenes", "scenes_by_level"):
            if getattr(manifest, name) != getattr(judged, name):
                raise _otherwise(where, about, name)
        if prompts.differ or not _is_time(manifest.created):
            raise _otherwise(where, about, ", ".join(prompts.differ) or "created")
        expected = design_of(manifest, where).all_samples
        physics = ", ".join(kind.title for kind in kinds_with_physics(manifest.suite))
        fell = (f"{physics}: what fell, which is taken from the records.",) if physics else ()
        unverified = (*prompts.unverified, *fell, *_NEVER_SHOWN)
        yield Verified(about, manifest, folder, count, expected, unverified)


_NEVER_SHOWN = (
    "That the models gave these replies, when, how fast and at what cost: no bundle can show it.",
)


def _is_time(text: str) -> bool:
    """True if a time can be that of a run; "" is none."""
    try:
        return not text or _EARLIEST < datetime.fromisoformat(text) < datetime.now(UTC) + _CLOCKS
    except (TypeError, ValueError):
        return False


class AskedPrompts:
    """The prompts of a run, rendered again from its data and the templates at hand.

    `differ` names what the manifest says of prompts and pictures that is not so. What cannot be
    told stands in `unverified`: templates of the run's author, the prompts of later turns, and the
    bytes of pictures, whose recipes alone are held against the data.
    """

    def __init__(self, folder: Path, manifest: Manifest, *, is_ours: bool) -> None:
        self.differ: list[str] = []
        self._tracks: dict[tuple[str, str], AnyTrack] = {}
        self._items: dict[tuple[str, str], Item] = {}
        self._unknown: set[tuple[str, str]] = set()
        self._known: dict[tuple[object, ...], tuple[object, ...]] = {}
        told: dict[str, None] = {}
        suite = recorded_suite(folder, manifest)
        dataset = recorded_dataset(folder, manifest, suite.levels, None)
        for variant in dict.fromkeys(one.shown for one in suite.vary.variants):
            stored = manifest.variants.get(variant.key, manifest.tracks)
            for name in suite.tracks:
                title, was = kind_of(name).title, stored.get(name, {})
                if was.get("prompt") is None:
                    continue
                one = suite.at(variant).model_copy(update={"tracks": (name,)})
                try:
                    (track,) = reopen_tracks(folder, manifest, one, dataset, with_prompts=True)
                    now = track.identity()
                except InputError as error:
                    told[f"{title}: the prompts, since {error.problems[0]}"] = None
                    self._unknown.add((variant.key, name))
                    continue
                track.close()
                changed = [key for key in _SHOWN if was.get(key) != now.get(key)]
                is_default = _name_of(was["prompt"]) == _name_of(now["prompt"])
                if changed and not (is_default and is_ours):
                    told[f"{title}: the prompts, of a template that is not at hand."] = None
                    self._unknown.add((variant.key, name))
                    continue
                self.differ += [f"tracks.{name}.{key}" for key in changed]
                if isinstance(track, EpisodeTrack):
                    told[f"{title}: the prompts after the first of an episode."] = None
                self._tracks[variant.key, name] = track
                self._items |= {(name, item.key): item for item in track.items}
        if self._tracks:
            told["The bytes of pictures: their recipes are those of the data."] = None
        self.unverified = tuple(told)

    def made(self, record: Record) -> bool:
        """True if the prompt of a record is what its item is asked by, as far as can be told."""
        turns = record.asked_turns
        prompt = turns[0].prompt if turns else record.prompt
        at = (record.way.shown.key, record.track)
        if prompt is None or at in self._unknown:
            return True
        track = self._tracks.get(at)
        if track is None:
            return False
        item = self._items[record.track, record.item]
        shown = track.shown(item, record.seed)
        key = (*at, record.item, shown is item or record.seed)
        if key not in self._known:
            request, _ = next(iter(track.outlines(shown)))
            self._known[key] = _sent(
                about_prompt(request, track.prompt_name, prompt_of(request.messages).sha256)
            )
        return self._known[key] == _sent(prompt)


def _name_of(prompt: object) -> object:
    """The name of a prompt, of what a manifest says of it."""
    return prompt.get("name") if isinstance(prompt, Mapping) else prompt


def _sent(prompt: SentPrompt) -> tuple[object, ...]:
    """All that is known of a prompt without its pictures' bytes."""
    labels = tuple(image.label for image in prompt.images)
    return prompt.template, prompt.version, prompt.messages, prompt.examples, labels


def _otherwise(where: str, about: About, what: str, found: str = "") -> StoreError:
    hint = "score the run again with phyblock score, and bundle what that makes"
    if about.readers != READER_VERSION:
        hint = (
            f"replies were read by readers {about.readers}, here are {READER_VERSION}: take the "
            f"phyblock that made it ({about.phyblock}), or score the run again"
        )
    message = "does not verify: made again, they come out otherwise"
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
                dataset = recorded_dataset(folder, here, suite.levels, None)
                if part == "questions":
                    for track in reopen_tracks(folder, here, suite, dataset):
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


def pack(file: IO[bytes], contents: Mapping[str, Iterable[bytes]]) -> None:
    """Write an archive of all `MEMBERS`, whose bytes depend on the contents and zlib alone.

    The pieces of a member are taken as they come. Raises StoreError for one that is too large to
    be read again.
    """
    with zipfile.ZipFile(file, "w", allowZip64=False) as archive:
        for name, most in MEMBERS.items():
            info = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
            info.compress_type, info.create_system = zipfile.ZIP_DEFLATED, 3
            info.external_attr = (stat.S_IFREG | 0o644) << 16
            left = most
            with archive.open(info, "w") as member:
                for piece in contents[name]:
                    left -= len(piece)
                    if left < 0:
                        raise StoreError(Problem(name, f"is larger than {most // _MB:,} MB"))
                    member.write(piece)


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
