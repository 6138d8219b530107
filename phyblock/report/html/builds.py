"""The folders of scripts beside the page, a build each: replaced and removed, nothing else is.

A build is known by its name and holds scripts that are known by theirs; what else a person put
there stays, and so does its folder.
"""

from __future__ import annotations

import re
from pathlib import Path

__all__ = ["clear", "put_in_place", "remove_build", "remove_others"]

_BUILD = re.compile(r"[0-9a-f]{12}(\.new)?")
_SCRIPT = re.compile(r"(index|(records|scenes|questions|prompts)-\d+)\.js")


def clear(build: Path) -> None:
    """Make an empty folder for a build, whatever one that was killed left there."""
    remove_build(build)
    build.mkdir(exist_ok=True)


def put_in_place(new: Path) -> None:
    """Put a build that is whole where the page looks for it: NAME.new becomes NAME."""
    place = new.with_suffix("")
    clear(place)
    for script in new.iterdir():
        script.replace(place / script.name)
    remove_build(new)


def remove_others(folder: Path, build: str) -> None:
    """Remove all builds but one.

    A page of an earlier build that is still open says that it was written again.
    """
    for old in folder.iterdir():
        if old.name != build and _BUILD.fullmatch(old.name):
            remove_build(old)


def remove_build(build: Path) -> None:
    """Remove the scripts of a build, and its folder unless something else is in it."""
    if build.is_symlink() or not build.is_dir():
        return
    for script in build.iterdir():
        if _SCRIPT.fullmatch(script.name) and (script.is_symlink() or script.is_file()):
            script.unlink()
    if next(build.iterdir(), None) is None:
        build.rmdir()
