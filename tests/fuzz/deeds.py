"""Files that this process touches and hosts that it connects to, by Python's audit events."""

from __future__ import annotations

import os
import sys
from typing import Any, NamedTuple

__all__ = ["Deed", "watch_deeds"]

_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
_PATHS = {
    "os.remove": 1,
    "os.rmdir": 1,
    "os.mkdir": 1,
    "os.rename": 2,
    "os.symlink": 2,
    "os.link": 2,
    "os.truncate": 1,
    "os.chmod": 1,
    "os.chown": 1,
    "shutil.rmtree": 1,
    "sqlite3.connect": 1,
}
"""Events that change files, and how many of their first arguments are paths."""


class Deed(NamedTuple):
    """An audit event, and the path (its links followed) or the address that it is about."""

    event: str
    about: str


def watch_deeds() -> list[Deed]:
    """A list that gets every change to a file and every connection from now on, for good.

    SQLite opens its files by itself; the event that names the database stands for them all.
    """
    deeds: list[Deed] = []

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        if event == "open":
            path, _, flags = arguments
            if flags & _WRITING and not isinstance(path, int):
                deeds.append(Deed(event, os.path.realpath(os.fsdecode(path))))
        elif event == "socket.connect":
            deeds.append(Deed(event, repr(arguments[1])))
        elif event in _PATHS:
            paths = [path for path in arguments[: _PATHS[event]] if not isinstance(path, int)]
            deeds.extend(Deed(event, _entry(os.fsdecode(path))) for path in paths)

    sys.addaudithook(hook)
    return deeds


def _entry(path: str) -> str:
    """The entry that a path names, even where that is a link."""
    folder, name = os.path.split(path.rstrip("/"))
    return os.path.join(os.path.realpath(folder or "."), name)
