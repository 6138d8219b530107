"""Paths as people write them: relative to a file, with ~ and $VARIABLES."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from pathlib import Path

from phyblock.errors import Problem

__all__ = ["expand", "is_utf8", "sort_problems"]

_VARIABLE = re.compile(r"\$(?:(\w+)|\{(\w+)\})")
_LONGEST_PATH, _LONGEST_NAME = 4095, 255
"""Limits of Linux [bytes]."""

_PLACE = re.compile(r":(\d+):(\d+)$")


def expand(text: str, base: Path) -> Path:
    """The absolute path that `text` means, seen from the folder `base`.

    Raises ValueError, with a message for the user, for a variable that is not set, a home
    folder that is not known, or what cannot be the name of a file or be written down in a run.
    """

    def value_of(match: re.Match[str]) -> str:
        name = match[1] or match[2]
        if name not in os.environ:
            raise ValueError(f"the environment variable {name} is not set")
        return os.environ[name]

    try:
        path = Path(_VARIABLE.sub(value_of, text)).expanduser()
    except RuntimeError as error:
        raise ValueError("the home folder that ~ stands for is not known") from error
    # What was written must be UTF-8; the folder that it is seen from is named as it is.
    _check_path(str(path))
    whole = os.path.normpath(base.absolute() / path)
    _check_length(os.fsencode(whole))
    return Path(whole)


def _check_path(text: str) -> None:
    """Raise ValueError, with a message for the user, for what cannot be a path of UTF-8 names."""
    if not is_utf8(text):
        raise ValueError("holds a name that is not UTF-8")
    data = text.encode()
    if b"\0" in data:
        raise ValueError("holds a NUL character")
    _check_length(data)


def _check_length(data: bytes) -> None:
    if len(data) > _LONGEST_PATH or any(len(part) > _LONGEST_NAME for part in data.split(b"/")):
        raise ValueError("is longer than a path can be")


def is_utf8(text: str) -> bool:
    """Whether a text from the command line or a file name can be written down as UTF-8."""
    return not any("\ud800" <= character <= "\udfff" for character in text)


def sort_problems(problems: Iterable[Problem]) -> list[Problem]:
    """Problems in the order in which they stand in the file, those of the command line last."""

    def rank(problem: Problem) -> tuple[int, int, int]:
        place = None if problem.where.startswith("--") else _PLACE.search(problem.where)
        return (0, int(place[1]), int(place[2])) if place else (1, 0, 0)

    return sorted(problems, key=rank)
