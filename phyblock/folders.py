"""Folders that we write into beside what is the user's: only what we wrote is written again.

The names that we wrote stand in `.generated` in the folder, a line each, written before the file
is. Whatever else is there is the user's: it is never written over, never removed, and a link is
never followed.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path, PurePosixPath
from uuid import uuid4

from phyblock.bounded import read_bytes
from phyblock.errors import Problem, StoreError
from phyblock.files import append_whole, atomic_write, make_folder, writing

__all__ = ["LIST", "OutFolder"]

LIST = ".generated"
"""The file that names what we wrote into a folder."""

_HEAD = "# What phyblock wrote here and may write again; all else is never touched."
_LINK = "cannot be written: it is a link, and links are never followed or replaced"
_HINT = "move it away; phyblock writes over nothing that it did not make"
_ELSEWHERE = "choose another folder with --out"
_CLOSED = "cannot be written in: permission denied"
_OPEN = "let yourself write there, or choose another folder"
_OUTSIDE = "cannot be written: its name leads out of the folder"


class OutFolder:
    """A folder and what in it is ours.

    Names are of files, relative, with slashes; one that ends in a slash is of a folder.
    """

    def __init__(self, path: Path, earlier: Callable[[], Iterable[str]] | None = None) -> None:
        """Take `path`, which need not exist.

        `earlier` finds what is ours in a folder that was written before there was a list.
        """
        self.path = path
        self._earlier = earlier

    def begin(self) -> None:
        """Make the folder and its list, unless they are there."""
        make_folder(self.path, _ELSEWHERE)
        with writing(self.path / LIST):
            self._append([])

    def check(self, names: Iterable[str]) -> None:
        """Raise StoreError naming all that is in the way of writing `names`; nothing is written.

        In the way are files that we never wrote, links, and folders that cannot be written in.
        """
        names = list(names)
        # What is there is looked at first: another process lists a name before it writes the file.
        files = [name for name in names if not name.endswith("/")]
        there = [name for name in files if os.path.lexists(self.path / name)]
        known = self._known()
        problems = {self.path / name: _OUTSIDE for name in names if _is_outside(name)}
        # Itself it may be a link: a person named it.
        if self.path.is_dir() and not os.access(self.path, os.W_OK | os.X_OK):
            problems[self.path] = _CLOSED
        for folder in _folders(names):
            if wrong := _wrong_folder(self.path / folder):
                problems[self.path / folder] = wrong
        for name in there:
            path = self.path / name
            if not any(above in problems for above in path.parents) and (
                wrong := _wrong_file(path, name in known)
            ):
                problems[path] = wrong
        if problems:
            raise StoreError(
                [
                    Problem(str(path), wrong, hint=_OPEN if wrong == _CLOSED else _HINT)
                    for path, wrong in problems.items()
                ]
            )

    def claim(self, names: Iterable[str]) -> None:
        """List `names` as ours and make their folders; raises as `check`."""
        names = list(names)
        self.check(names)
        make_folder(self.path, _ELSEWHERE)
        with writing(self.path / LIST):
            self._append(names)
        for folder in _folders(names):
            make_folder(self.path / folder, _HINT)

    def write(self, files: Mapping[str, bytes | str]) -> tuple[Path, ...]:
        """Write files by name, each whole or not at all; raises as `check`, or as the disk does."""
        self.claim(files)
        paths = []
        for name, data in files.items():
            paths.append(self.path / name)
            with writing(paths[-1]):
                atomic_write(paths[-1], data)
        return tuple(paths)

    def names(self, below: str) -> list[str]:
        """The names of ours that begin with `below`, whether the files are still there or not."""
        return sorted(name for name in self._known() if name.startswith(below))

    def remove(self, names: Iterable[str]) -> None:
        """Remove those of `names` that are ours, and folders that are empty then.

        Nothing else in an output folder is ever removed. Raises StoreError where the disk refuses.
        """
        known = self._known()
        folders: set[str] = set()
        for name in names:
            path, above = self.path / name, _folders([name])
            if name not in known or any((self.path / folder).is_symlink() for folder in above):
                continue
            if path.is_file() and not path.is_symlink():
                with writing(path):
                    path.unlink(missing_ok=True)
                folders |= set(above)
        for folder in sorted(folders, reverse=True):
            with writing(self.path / folder):
                if next((self.path / folder).iterdir(), None) is None:
                    (self.path / folder).rmdir()

    @contextlib.contextmanager
    def making(self, below: str = "") -> Iterator[Path]:
        """A new folder to write any files into; at the end they are moved to `below` in this one.

        `below` is empty or a folder's name with its slash. Where the work fails, nothing is left of
        it. Raises as `write`.
        """
        self.claim([below] if below else [])
        part = self.path / f".{uuid4().hex}.part"
        with writing(self.path / below):
            part.mkdir()
        try:
            yield part
            files = sorted(path for path in part.rglob("*") if path.is_file())
            names = [path.relative_to(part).as_posix() for path in files]
            self.claim(below + name for name in names)
            with writing(self.path / below):
                for file, name in zip(files, names, strict=True):
                    file.replace(self.path / below / name)
        finally:
            shutil.rmtree(part)

    @contextlib.contextmanager
    def alone(self) -> Iterator[None]:
        """Wait until no other process is in here, and keep others out."""
        self.begin()
        with contextlib.ExitStack() as stack:
            with writing(self.path / LIST):
                file = stack.enter_context((self.path / LIST).open("ab"))
                fcntl.flock(file, fcntl.LOCK_EX)
            yield

    def _known(self) -> set[str]:
        """Names that are ours. A list that is still empty is none: its first line comes at once."""
        listed = _read(self.path / LIST)
        if listed:
            return set(listed.decode("utf-8", "surrogateescape").split("\n"))
        return set(self._earlier()) if self._earlier else set()

    def _append(self, names: Iterable[str]) -> None:
        path = self.path / LIST
        listed = _read(path)
        known = self._known()
        files = (name for name in dict.fromkeys(names) if not name.endswith("/"))
        lines = [name for name in files if name not in known]
        if not listed:
            lines = [_HEAD, *sorted(known), *lines]
        if lines:
            # The death of the machine may have cut the last line short.
            start = "\n" if listed and not listed.endswith(b"\n") else ""
            text = start + "".join(f"{line}\n" for line in lines)
            _append(path, text.encode("utf-8", "surrogateescape"))


def _read(path: Path) -> bytes:
    """The content of a list; nothing where there is none."""
    with writing(path):
        if path.is_symlink():
            raise StoreError(Problem(str(path), _LINK, hint=_HINT))
        try:
            return read_bytes(path)
        except FileNotFoundError:
            return b""
        except ValueError as error:
            raise StoreError(Problem(str(path), str(error), hint=_HINT)) from error


def _append(path: Path, data: bytes) -> None:
    """Append whole lines in one piece, so that those of two processes never mix; or nothing."""
    with path.open("ab", buffering=0) as file:
        append_whole(file.fileno(), data)


def _folders(names: Iterable[str]) -> list[str]:
    """The folders that are named or hold what is named, those above before those below."""
    folders: set[str] = set()
    for name in names:
        path = PurePosixPath(f"{name}_" if name.endswith("/") else name)
        folders |= {str(above) for above in path.parents}
    return sorted(folders - {"."})


def _is_outside(name: str) -> bool:
    return PurePosixPath(name).is_absolute() or ".." in PurePosixPath(name).parts


def _wrong_folder(path: Path) -> str:
    """Why a folder cannot be written into; nothing where it can be, or is not there yet."""
    if path.is_symlink():
        return _LINK
    if path.exists() and not path.is_dir():
        return "cannot be written in: it is no folder"
    if path.exists() and not os.access(path, os.W_OK | os.X_OK):
        return _CLOSED
    return ""


def _wrong_file(path: Path, is_ours: bool) -> str:
    if path.is_symlink():
        return _LINK
    if not path.is_file():
        return "cannot be written: it is no file"
    return "" if is_ours else "cannot be written: phyblock did not make what is there"
