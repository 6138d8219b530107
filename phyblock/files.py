"""Read files within bounds; write them atomically, never over the user's; find bundled files.

Guarantees:

* No input hangs, exhausts memory or ends the process: readers accept only regular files, within
  limits far above what a legitimate file needs. They raise OSError for failures of the disk, and
  ValueError for refused contents, with a text that can be shown to users.
* A kill at any moment leaves the old file or the new one, whole (`atomic_write`).
* In a folder that may hold files of the user, only files that phyblock wrote are overwritten or
  removed, and links are never followed (`OutFolder`).
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import hashlib
import io
import itertools
import json
import math
import os
import stat
import tempfile
import warnings
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from phyblock.errors import DataError, Problem, StoreError, reason_of

if TYPE_CHECKING:
    from PIL.Image import Image


LARGEST_FILE_BYTES = 64 * 1024 * 1024  # Default limit of a file that is read whole [bytes].
LARGEST_PICTURE_BYTES = 32 * 1024 * 1024  # Limit of a picture file [bytes].
LONGEST_INTEGER = 300  # Digits of an integer; a longer one fits no float.
_DEEPEST_JSON = 64

_PICTURE_FORMATS = ("PNG", "JPEG", "GIF", "WEBP")
"""Decoders of other formats start programs (EPS starts Ghostscript) or are seldom maintained."""
_SIDES_PX, _MOST_PIXELS = (8, 10_000), 40_000_000
_SIZES_ALLOWED = "8 to 10,000 pixels a side, 40 million in all"
_DECODED: set[bytes] = set()
"""Digests of picture files that were decoded: each is read several times in a run."""


class NotRegularError(ValueError):
    """The file is a pipe, a device or a socket, which could block or be read without end."""


def open_regular(path: Path) -> io.BufferedReader:
    """Open a regular file for reading. Raises NotRegularError for any other, OSError as `open`."""
    # A pipe without a writer would block an ordinary open.
    number = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    mode = os.fstat(number).st_mode
    if stat.S_ISREG(mode):
        return os.fdopen(number, "rb")
    os.close(number)
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, "Is a directory", str(path))
    raise NotRegularError("is not a regular file")


def read_bytes(path: Path, most_bytes: int = LARGEST_FILE_BYTES) -> bytes:
    """Return the content of a regular file. Raises ValueError for more than `most_bytes`."""
    with open_regular(path) as file:
        data = file.read(most_bytes + 1)
    if len(data) > most_bytes:
        raise ValueError(f"is larger than {most_bytes / 1024**2:g} MB")
    return data


def read_text(path: Path, most_bytes: int = LARGEST_FILE_BYTES) -> str:
    """Return the content of a regular UTF-8 file without its byte order mark; see `read_bytes`."""
    data = read_bytes(path, most_bytes)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(f"is not UTF-8: {error.reason} at byte {error.start}") from None


def read_own_yaml(path: Path) -> Any:
    """Return the content of a YAML file of the package."""
    import yaml

    # The parser in C is ten times as fast, where there is one.
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    return yaml.load(path.read_text(encoding="utf-8"), loader)


def digest_of_file(path: Path) -> str:
    """Return the SHA-256 of a file, "" if there is none. Raises OSError, NotRegularError."""
    try:
        with open_regular(path) as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except FileNotFoundError:
        return ""


def load_json(data: bytes | str) -> Any:
    """Decode JSON whose nesting, integers and floats are bounded.

    Raises ValueError (a JSONDecodeError for broken syntax) for NaN, Infinity, a float outside the
    range of doubles, an integer of more than 300 digits, or nesting of more than 64 levels.
    """

    def integer(digits: str) -> int:
        if len(digits) > LONGEST_INTEGER:
            raise ValueError(f"holds a number of {len(digits):,} digits")
        return int(digits)

    def number(digits: str) -> float:
        value = float(digits)
        if not math.isfinite(value):
            raise ValueError(f"holds {digits[:20]}, which is outside the range of numbers")
        return value

    too_deep = ValueError(f"is nested more than {_DEEPEST_JSON} levels deep")
    try:
        value = json.loads(data, parse_int=integer, parse_float=number, parse_constant=number)
    except RecursionError:
        raise too_deep from None
    level = [value]
    for _ in range(_DEEPEST_JSON + 1):
        level = [
            inner
            for part in level
            if isinstance(part, (dict, list))
            for inner in (part.values() if isinstance(part, dict) else part)
        ]
        if not level:
            return value
    raise too_deep


def read_picture(path: Path) -> bytes:
    """Return the bytes of a picture file. Raises DataError if it cannot be decoded."""
    try:
        data = read_bytes(path, LARGEST_PICTURE_BYTES)
    except (OSError, ValueError) as error:
        raise _no_picture(str(path), error) from error
    digest = hashlib.sha256(data).digest()
    if digest not in _DECODED:
        with open_picture(data, str(path)) as picture:
            try:
                picture.load()
            except Exception as error:
                # Hostile bytes can make the decoder fail in any way.
                raise _no_picture(str(path), error) from error
        _DECODED.add(digest)
    return data


def open_picture(data: bytes, where: str) -> Image:
    """Open the first frame of an encoded picture, which is decoded when its pixels are needed.

    Raises DataError, at `where`, for another format or a bad size.
    """
    from PIL import Image

    try:
        with warnings.catch_warnings():
            # Sizes are checked below.
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            picture = Image.open(io.BytesIO(data), formats=_PICTURE_FORMATS)
    except Exception as error:
        found = f"a file that begins with {data[:12]!r}" if data else "an empty file"
        raise _no_picture(where, error, found) from error
    width, height = picture.size
    (least, most), all_px = _SIDES_PX, width * height
    if not (least <= min(width, height) <= max(width, height) <= most and all_px <= _MOST_PIXELS):
        picture.close()
        found, allowed = f"{width:,} x {height:,} pixels", _SIZES_ALLOWED
        raise DataError(Problem(where, "is a picture of a bad size", "", found, allowed))
    return picture


def _no_picture(where: str, error: Exception, found: str = "") -> DataError:
    message, allowed = f"is not a readable picture: {reason_of(error)}", "PNG, JPEG, GIF or WebP"
    return DataError(Problem(where, message, "", found, allowed))


@contextlib.contextmanager
def writing(path: Path, hint: str = "") -> Iterator[None]:
    """Turn OSErrors of writing a file or folder into a StoreError that names it, with a `hint`."""
    try:
        yield
    except (OSError, UnicodeEncodeError) as error:
        # A name that the file system cannot encode raises UnicodeEncodeError, not OSError.
        message = f"cannot be written: {reason_of(error)}"
        raise StoreError(Problem(str(path), message, hint=hint)) from error


def check_free(paths: Iterable[Path], hint: str) -> None:
    """Raise StoreError naming all of `paths` that exist, broken links included."""
    if taken := [path for path in paths if os.path.lexists(path)]:
        raise StoreError([Problem(str(path), "is already there", hint=hint) for path in taken])


def make_folder(path: Path, hint: str = "") -> None:
    """Create a folder and its parents if they are missing. Raises StoreError if that fails."""
    with writing(path, hint):
        path.mkdir(parents=True, exist_ok=True)


def atomic_write(path: Path, data: bytes | str | Iterable[bytes], *, sync: bool = False) -> None:
    """Write a whole file, or leave the old one and no other file.

    Pieces of data are written as they come, text as UTF-8 with question marks for lone surrogates.
    If `path` is a link, the link is replaced and its target is unchanged. With `sync` the file
    survives a crash of the machine. Raises OSError if the disk fails: see `writing`.
    """
    # A unique name: two processes may write the same file at the same time.
    partial = path.with_name(f".{uuid4().hex}.part")
    try:
        with partial.open("xb") as file:
            if isinstance(data, (bytes, str)):
                data = [data.encode("utf-8", "replace") if isinstance(data, str) else data]
            file.writelines(data)
            if sync:
                file.flush()
                os.fsync(file.fileno())
        partial.replace(path)
        if sync:
            sync_folder(path.parent)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise


def sync_folder(path: Path) -> None:
    """Wait until the names in a folder are on disk; raises OSError if that fails."""
    number = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(number)
    except OSError as error:
        # Some file systems have no sync of a folder.
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):
            raise
    finally:
        os.close(number)


def append_whole(number: int, data: bytes, *, sync: bool = False) -> None:
    """Append all of the data, or nothing, to the file that is open for appending as `number`.

    With `sync` it is on disk at the end. Raises OSError if the disk fails: see `writing`.
    """
    # Read before anything is written: the file must never be cut back to an unknown size.
    size = os.fstat(number).st_size
    try:
        left = memoryview(data)
        while left:
            left = left[os.write(number, left) :]
        if sync:
            os.fsync(number)
    except OSError:
        # If even this fails, an unfinished line is left at the end.
        with contextlib.suppress(OSError):
            os.ftruncate(number, size)
        raise


def write_named(path: Path, data: bytes | Iterable[bytes]) -> None:
    """Write a file that the user named, replacing one of its kind, and create its folders.

    A file is of its kind if it is empty or begins with the same four bytes, as ZIP archives and
    pictures do. Links are followed, since the user made them. Raises StoreError if the disk fails,
    and if anything else is there: to replace a device would take it from the whole machine.
    """
    pieces = iter([data] if isinstance(data, bytes) else data)
    first = next(pieces, b"")
    with writing(path):
        target = Path(os.path.realpath(path))
        target.parent.mkdir(parents=True, exist_ok=True)
        is_free = not os.path.lexists(target)
        if target.is_file():
            with target.open("rb") as file:
                is_free = file.read(4) in (b"", first[:4])
        if not is_free:
            message, hint = "is there, and of another kind", "name another file, or move it away"
            raise StoreError(Problem(str(path), f"cannot be written: it {message}", hint=hint))
        atomic_write(target, itertools.chain([first], pieces))


LIST = ".generated"  # The file that lists what phyblock wrote into a folder.
_HEAD = "# Files that phyblock wrote here and may overwrite; it never touches others."
_LINK = "cannot be written: it is a link, and links are never followed or replaced"
_MOVE = "move it away; phyblock overwrites only its own files"


class OutFolder:
    """A folder that phyblock writes into, which may also hold files of the user.

    `.generated` lists the names that phyblock wrote, one per line, each before its file is written.
    Everything else is the user's and is never overwritten or removed; links are never followed.
    Names are relative paths with slashes; one that ends in a slash is a folder's, to be checked.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    def check(self, names: Iterable[str]) -> None:
        """Raise StoreError if links, or files of others, prevent writing `names`."""
        # Existing files are found first: another process lists a name before it writes the file.
        there = {n: os.path.lexists(self.path / n) and not n.endswith("/") for n in names}
        known = self._known()
        problems: dict[Path, str] = {}
        for name, is_there in there.items():
            path = self.path / name
            if PurePosixPath(name).is_absolute() or ".." in PurePosixPath(name).parts:
                problems[path] = "cannot be written: its name leads out of the folder"
            elif link := next((one for one in self._folders(name) if one.is_symlink()), None):
                problems[link] = _LINK
            elif taken := next((one for one in self._folders(name) if one.is_file()), None):
                problems[taken] = "cannot be written in: it is not a folder"
            elif is_there and path.is_symlink():
                problems[path] = _LINK
            elif is_there and (name not in known or not path.is_file()):
                problems[path] = "cannot be written: phyblock did not make the existing file"
        if problems:
            raise StoreError(
                Problem(str(path), message, hint=_MOVE) for path, message in problems.items()
            )

    def claim(self, names: Iterable[str]) -> None:
        """List `names` as phyblock's and make their folders; raises as `check`."""
        names = list(dict.fromkeys(names))
        self.check(names)
        make_folder(self.path, "choose another folder with --out")
        known = self._known()
        # A crash of the machine may have cut the last line short, so that each begins with a break.
        lines = [] if known else [_HEAD]
        lines += [f"\n{name}" for name in names if name not in known]
        with writing(self.path / LIST), (self.path / LIST).open("ab", buffering=0) as file:
            # In one write, so that lines of two processes never mix.
            append_whole(file.fileno(), "".join(lines).encode("utf-8", "surrogateescape"))
        for folder in {(self.path / name).parent for name in names}:
            make_folder(folder, _MOVE)

    def write(self, files: Mapping[str, bytes | str | Iterable[bytes]]) -> tuple[Path, ...]:
        """Write files by name, each whole or not at all; raises as `check`, or as the disk does."""
        self.claim(files)
        for name, data in files.items():
            with writing(self.path / name):
                atomic_write(self.path / name, data)
        return tuple(self.path / name for name in files)

    def names(self, below: str) -> list[str]:
        """Return phyblock's names that begin with `below`, whether the files are there or not."""
        return sorted(name for name in self._known() if name.startswith(below))

    def remove(self, names: Iterable[str]) -> None:
        """Remove those of `names` that phyblock wrote, and emptied folders. Raises StoreError."""
        known = self._known()
        for name in (name for name in names if name in known):
            path, folders = self.path / name, self._folders(name)
            if path.is_file() and not any(one.is_symlink() for one in (path, *folders)):
                with writing(path):
                    path.unlink(missing_ok=True)
                for folder in folders:
                    # One that is not empty stays.
                    with contextlib.suppress(OSError):
                        folder.rmdir()

    @contextlib.contextmanager
    def making(self, below: str) -> Iterator[Path]:
        """Yield a temporary folder, whose files are moved to the folder `below` at the end.

        If the body fails, its files are removed. Raises as `check`, and OSError if the disk fails.
        """
        self.claim([])
        with tempfile.TemporaryDirectory(".part", ".", self.path) as part:
            yield Path(part)
            made = sorted(Path(part).iterdir())
            self.claim(f"{below}{path.name}" for path in made)
            for path in made:
                path.replace(self.path / below / path.name)

    @contextlib.contextmanager
    def alone(self) -> Iterator[None]:
        """Hold the folder's lock, after waiting for other processes."""
        self.claim([])
        with writing(self.path / LIST):
            file = (self.path / LIST).open("ab")
            fcntl.flock(file, fcntl.LOCK_EX)
        with file:
            yield

    def _folders(self, name: str) -> list[Path]:
        """Return the folders between this one and a file, the innermost first."""
        return [self.path / above for above in PurePosixPath(f"{name}_").parents if above.name]

    def _known(self) -> set[str]:
        path = self.path / LIST
        if path.is_symlink():
            raise StoreError(Problem(str(path), _LINK, hint=_MOVE))
        with writing(path, _MOVE):
            try:
                return set(read_bytes(path).decode("utf-8", "surrogateescape").split("\n"))
            except FileNotFoundError:
                return set()
            except ValueError as error:
                raise StoreError(Problem(str(path), str(error), hint=_MOVE)) from error


def bundled(*parts: str) -> Path:
    """Return the path of a bundled file or folder, in `benchmarks/`, `prompts/` or `models.yaml`.

    They are in the package in an installed wheel, and beside it in a checkout.
    """
    package = Path(__file__).parent
    inside = package / "bundled"
    return (inside if inside.is_dir() else package.parent).joinpath(*parts)


def bundled_sets(file: str) -> list[str]:
    """Return the names of the bundled data sets that hold a file of this name, sorted."""
    return sorted(path.parent.name for path in bundled("benchmarks", "data").glob(f"*/{file}"))


def cache_dir() -> Path:
    """Return the user's cache folder: `$PHYBLOCK_CACHE`, else the platform's place for caches."""
    if named := os.environ.get("PHYBLOCK_CACHE"):
        return Path(named).expanduser()
    return Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "phyblock"


def reply_cache_file() -> Path:
    """Return the reply cache that all runs of this user share."""
    return cache_dir() / "replies.sqlite"
