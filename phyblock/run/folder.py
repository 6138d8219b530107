"""What a run folder may hold: where a run may begin or go on, and what in it may be rewritten."""

from __future__ import annotations

import contextlib
import fcntl
import os
import re
from collections.abc import Iterator
from pathlib import Path

from phyblock.errors import Problem, StoreError
from phyblock.files import LIST, OutFolder, writing
from phyblock.records.files import BATCHES, PROMPTS, RECORDS, TURNS
from phyblock.records.manifest import MANIFEST

LOCK = ".lock"
_OWN = (MANIFEST, RECORDS, TURNS, PROMPTS, BATCHES, "batches", LOCK, LIST)
_BEGUN = re.compile(rf"{re.escape(LOCK)}|{re.escape(LIST)}|\.[0-9a-f]{{32}}\.part")
"""What a run that was killed before it had a manifest leaves behind."""
_HINT = "choose another folder with --out"


def run_folder(path: Path) -> OutFolder:
    """A run's folder, to write into what can be made again from its records."""
    return OutFolder(path)


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the lock of a run folder, which one process writes; StoreError where another does."""
    with (folder / LOCK).open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            hint = "wait for it to end, or choose another folder with --out"
            message = "is being written by another phyblock run"
            raise StoreError(Problem(str(folder), message, hint=hint)) from error
        yield


def check_place(folder: Path) -> None:
    """Raise StoreError unless `folder` is new, empty or a run's; nothing is written.

    A folder without our manifest that holds anything is somebody's: a run makes names of its own
    in it. What a run grows must be files of the folder itself, no links to others.
    """
    with writing(folder, _HINT):
        try:
            os.lstat(folder)
        except FileNotFoundError:
            return
        names = {entry.name for entry in os.scandir(folder)}
    strangers = sorted(name for name in names if not _BEGUN.fullmatch(name))
    if MANIFEST not in names and strangers:
        found = ", ".join(strangers[:3]) + (", ..." if len(strangers) > 3 else "")
        message = f"is not empty and holds no run (no {MANIFEST})"
        hint = "name a new or an empty folder with --out"
        raise StoreError(Problem(str(folder), message, found=found, hint=hint))
    links = [folder / name for name in _OWN if (folder / name).is_symlink()]
    if links:
        message = "is a link, and a run writes nowhere but in its own folder"
        raise StoreError([Problem(str(path), message, hint=_HINT) for path in links])
