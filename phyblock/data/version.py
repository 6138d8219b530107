"""The version of a data set: a whole number in a file of its own, beside the scenes."""

from __future__ import annotations

from pathlib import Path

from phyblock.errors import DataError, Problem, reason_of
from phyblock.files import read_text

__all__ = ["UNNUMBERED", "VERSION_FILE", "read_version"]

VERSION_FILE = "VERSION"
UNNUMBERED = 1
"""What sets count as that have no such file: ours had none in their first version."""
_MOST_DIGITS = 6


def read_version(folder: Path) -> int:
    """The version of the data set in a folder; DataError when the file holds no version."""
    path = folder / VERSION_FILE
    try:
        text = read_text(path).strip()
    except FileNotFoundError:
        return UNNUMBERED
    except (OSError, ValueError) as error:
        raise DataError(Problem(str(path), f"cannot be read: {reason_of(error)}")) from error
    if not (text.isascii() and text.isdigit() and len(text) <= _MOST_DIGITS and int(text)):
        allowed = "a whole number from 1"
        raise DataError(Problem(str(path), "holds no version", "", repr(text[:20]), allowed))
    return int(text)
