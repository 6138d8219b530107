"""The laws of every command, and what is looked at to see whether one was broken.

1. The exit code is 0, 1, 2 or 130, there is never a traceback, and code 2 says what is wrong.
2. No file outside the run folder and the cache changes, and none of the user's in the run folder.
3. What was answered is never lost, and never asked twice (`tests/fuzz/ledger.py` has the asking).
"""

from __future__ import annotations

import hashlib
import os
import stat
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.fuzz.deeds import Deed
from tests.fuzz.worker import Ended

__all__ = ["CODES", "Broken", "Fingerprint", "Tree", "broken_laws", "ending_broken", "take_tree"]

CODES = (0, 1, 2, 130)
_COMPLAINTS = ("error: ", "Error: ")
_DEVICES = ("/dev/null", "/dev/tty", "/dev/shm")
_LOCAL = ("127.0.0.1", "localhost", "::1")

Fingerprint = tuple[str, str]
"""What stands at a path: its kind, and the digest of a file's content or where a link leads."""
Tree = Mapping[str, Fingerprint]


@dataclass(frozen=True)
class Broken:
    """A law that was broken, and how. `kind` is the same for what has the same cause."""

    law: int
    kind: str
    detail: str

    @property
    def name(self) -> str:
        """Law and kind."""
        return f"law {self.law}: {self.kind}"


def take_tree(root: Path) -> dict[str, Fingerprint]:
    """Everything below a folder by relative path; links are not followed."""
    return {str(Path(entry.path).relative_to(root)): _look(entry) for entry in _walk(root)}


def ending_broken(ended: Ended) -> Iterator[Broken]:
    """Return the first law that the end of a command breaks, in words."""
    told = ended.out + ended.err
    if ended.code is None:
        yield Broken(1, "it hangs", ended.err[-2000:])
    elif "Traceback (most recent call last)" in told:
        last = ended.err.strip().splitlines() or ["?"]
        where = [line.strip() for line in last if line.lstrip().startswith('File "')]
        yield Broken(1, f"traceback of {last[-1][:60]} at {where[-1:]}", ended.err[-3000:])
    elif ended.code not in CODES:
        yield Broken(1, f"exit code {ended.code}", ended.err[-2000:])
    elif ended.code == 2 and not any(word in ended.err for word in _COMPLAINTS):
        yield Broken(1, "exit code 2 without a message", ended.err[-2000:])


def broken_laws(
    ended: Ended,
    root: Path,
    before: Tree,
    after: Tree,
    may_write: Sequence[str],
    lasting: Sequence[str],
) -> list[Broken]:
    """Every law that a command broke in the folder `root`.

    `may_write` are the paths in it that the command is to write in, and `lasting` those of the
    user's files that stand there all the same.
    """
    found = list(ending_broken(ended))
    for path in sorted(before.keys() | after.keys()):
        same = before.get(path) == after.get(path)
        if not same and (path in lasting or not _lies_in(path, may_write)):
            change = "changed" if path in after and path in before else "made"
            change = change if path in after else "deleted"
            found.append(Broken(2, f"a file was {change}", path))
    places = [os.path.realpath(root / place) for place in may_write]
    found += [broken for deed in ended.deeds for broken in _judge(deed, places)]
    return found


def _judge(deed: Deed, places: Sequence[str]) -> Iterator[Broken]:
    if deed.event == "socket.connect":
        if not any(name in deed.about for name in _LOCAL):
            yield Broken(2, "a connection", deed.about)
    elif deed.event == "os.mkdir" and any(_lies_in(place, [deed.about]) for place in places):
        return  # that a folder above is there is found out by trying to make it
    elif not _lies_in(deed.about, [*places, *_DEVICES]):
        yield Broken(2, f"{deed.event} elsewhere", deed.about)


def _lies_in(path: str, places: Sequence[str]) -> bool:
    return any(
        place == "." or path == place or path.startswith(place.rstrip("/") + "/")
        for place in places
    )


def _walk(folder: Path) -> Iterator[os.DirEntry[str]]:
    with os.scandir(folder) as entries:
        for entry in entries:
            yield entry
            if entry.is_dir(follow_symlinks=False):
                yield from _walk(Path(entry.path))


def _look(entry: os.DirEntry[str]) -> Fingerprint:
    mode = entry.stat(follow_symlinks=False).st_mode
    if stat.S_ISLNK(mode):
        return "link", os.readlink(entry.path)
    if not stat.S_ISREG(mode):
        return "folder" if stat.S_ISDIR(mode) else "other", ""
    with open(entry.path, "rb") as file:
        return "file", hashlib.md5(file.read()).hexdigest()
