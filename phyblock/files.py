"""Write files so that nobody ever sees half of one, and say clearly when the disk refuses."""

from __future__ import annotations

import contextlib
import errno
import os
import stat
from collections.abc import Iterable, Iterator
from pathlib import Path
from uuid import uuid4

from phyblock.errors import Problem, StoreError

__all__ = [
    "append_whole",
    "atomic_write",
    "check_free",
    "make_folder",
    "sync_folder",
    "write_named",
    "writing",
]

_CANNOT_SYNC = (errno.EINVAL, errno.ENOTSUP)
"""What file systems say that know no sync of a folder."""


@contextlib.contextmanager
def writing(path: Path, hint: str = "") -> Iterator[None]:
    """Turn what the disk refuses while `path` is written into a StoreError that names it.

    `path` is the file, or the folder where many files are written; `hint` says what to do.
    """
    try:
        yield
    except (OSError, UnicodeEncodeError) as error:
        # A name that the file system cannot spell is an encoding error, no OSError.
        said = getattr(error, "strerror", None) or str(error) or type(error).__name__
        raise StoreError(Problem(str(path), f"cannot be written: {said}", hint=hint)) from error


def check_free(paths: Iterable[Path], hint: str) -> None:
    """Raise StoreError naming all of `paths` where something is, a link that leads nowhere too."""
    taken = [path for path in paths if os.path.lexists(path)]
    if taken:
        raise StoreError([Problem(str(path), "is already there", hint=hint) for path in taken])


def make_folder(path: Path, hint: str = "") -> None:
    """Make a folder and those above it where they are not there; StoreError if it cannot be."""
    with writing(path, hint):
        path.mkdir(parents=True, exist_ok=True)


def atomic_write(path: Path, data: bytes | str, *, sync: bool = False) -> None:
    """Write a whole file, or leave what was there and nothing beside it.

    Text is written as UTF-8, with question marks for halves of characters. The permissions are
    those of any new file. Where `path` is a link, the link is replaced and its target stays as it
    is. With `sync` it survives the death of the machine. Raises OSError where the disk refuses: see
    `writing`.
    """
    # A name of its own: two processes may write the same file at the same time.
    partial = path.with_name(f".{uuid4().hex}.part")
    try:
        with partial.open("xb") as file:
            file.write(data.encode("utf-8", "replace") if isinstance(data, str) else data)
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
    """Wait until the names in a folder are on disk; raises OSError where the disk refuses."""
    number = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(number)
    except OSError as error:
        if error.errno not in _CANNOT_SYNC:
            raise
    finally:
        os.close(number)


def append_whole(number: int, data: bytes, *, sync: bool = False) -> None:
    """Append to the file that is open for appending as `number`: all of the data, or nothing.

    With `sync` it is on disk at the end. Raises OSError where the disk refuses: see `writing`.
    """
    # Asked before anything is written: a size that is not known must never be cut back to.
    size = os.fstat(number).st_size
    try:
        left = memoryview(data)
        while left:
            left = left[os.write(number, left) :]
        if sync:
            os.fsync(number)
    except OSError:
        # Where even this fails, what is left is an unfinished line at the end.
        with contextlib.suppress(OSError):
            os.ftruncate(number, size)
        raise


def write_named(path: Path, data: bytes | str) -> None:
    """Write the very file that a person named, in place of what is there, and folders above it.

    A link is followed, as they made it. Raises StoreError where the disk refuses, and for what is
    there and no regular file: to replace a device would take it from the whole machine.
    """
    with writing(path):
        target = Path(os.path.realpath(path))
        if target.exists() and not stat.S_ISREG(target.stat().st_mode):
            what = "a folder" if target.is_dir() else "no regular file"
            raise StoreError(Problem(str(path), f"cannot be written: it is {what}"))
        target.parent.mkdir(parents=True, exist_ok=True)
        atomic_write(target, data)
