"""What a run folder may hold: where a run may begin or go on, and what in it may be rewritten."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path

from phyblock.errors import Problem, StoreError
from phyblock.files import writing
from phyblock.folders import LIST, OutFolder
from phyblock.records import BATCHES, MANIFEST, PROMPTS, RECORDS, TURNS

__all__ = ["LOCK", "check_place", "run_folder"]

LOCK = ".lock"
_OWN = (MANIFEST, RECORDS, TURNS, PROMPTS, BATCHES, "batches", LOCK, LIST)
_BEGUN = re.compile(rf"{re.escape(LOCK)}|{re.escape(LIST)}|\.[0-9a-f]{{32}}\.part")
"""What a run that was killed before it had a manifest leaves behind."""
_PAGE, _REBUILT = "report.html", ("tables", "figures", "export")
"""Where runs kept what can be made again before `.generated` named it."""
_BUILDS = "report"
_BUILD = re.compile(r"[0-9a-f]{12}(\.new)?")
_SCRIPT = re.compile(r"(index|(records|scenes|questions|prompts)-\d+)\.js")
"""What the page loads, as it was kept then: a folder of nothing but scripts of these names."""
_HINT = "choose another folder with --out"


def run_folder(path: Path) -> OutFolder:
    """A run's folder, to write into what can be made again from its records."""
    return OutFolder(path, lambda: _made_before(path))


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


def _made_before(folder: Path) -> Iterator[str]:
    """Names in a run of a version that kept no list: these places were its own."""
    if not (folder / MANIFEST).is_file():
        return
    if (folder / _PAGE).is_file():
        yield _PAGE
    for place in _REBUILT:
        for above, _, names in os.walk(folder / place):
            yield from ((Path(above) / name).relative_to(folder).as_posix() for name in names)
    for build in (folder / _BUILDS).glob("*"):
        names = [path.name for path in build.iterdir()] if _is_folder(build) else []
        if _BUILD.fullmatch(build.name) and all(map(_SCRIPT.fullmatch, names)):
            yield from (f"{_BUILDS}/{build.name}/{name}" for name in names)


def _is_folder(path: Path) -> bool:
    return path.is_dir() and not path.is_symlink()
