"""Read files and JSON within bounds, so that no input hangs, exhausts memory or ends the process.

The limits are far above what any honest file needs. Whoever reads says what was wrong: OSError is
the disk's word, ValueError a content that is refused, with a text that can be shown as it is.
"""

from __future__ import annotations

import json
import math
import os
import stat
from pathlib import Path
from typing import Any, BinaryIO, NoReturn

__all__ = [
    "LARGEST_FILE_BYTES",
    "LONGEST_INTEGER",
    "NotRegularError",
    "RepeatedFieldError",
    "load_json",
    "open_regular",
    "read_bytes",
    "read_text",
]

LARGEST_FILE_BYTES = 64 * 1024 * 1024
"""Default limit of a file that is read whole [bytes]."""

_DEEPEST = 64
LONGEST_INTEGER = 300
"""Digits of an integer; what is longer fits no float, and int() takes quadratic time on it."""
_LONGEST_SHOWN_INTEGER = 4300
"""Digits that Python turns into an integer and back."""


class NotRegularError(ValueError):
    """A pipe, a device, a socket: what an ordinary open would wait for, or read without end."""


def open_regular(path: Path) -> BinaryIO:
    """A regular file, opened for reading where it is too large to be read whole.

    Raises ValueError for what is no regular file (a pipe would block, a device has no end), OSError
    where it cannot be opened.
    """
    # A pipe without a writer would block an ordinary open.
    number = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    mode = os.fstat(number).st_mode
    if stat.S_ISREG(mode):
        return os.fdopen(number, "rb")
    os.close(number)
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(21, "Is a directory", str(path))
    raise NotRegularError("is not a regular file")


def read_bytes(path: Path, most_bytes: int = LARGEST_FILE_BYTES) -> bytes:
    """The content of a regular file.

    Raises ValueError for what is no regular file (a pipe would block, a device has no end) or is
    larger than `most_bytes`, OSError where the file cannot be opened or read.
    """
    with open_regular(path) as file:
        data = file.read(most_bytes + 1)
    if len(data) > most_bytes:
        raise ValueError(f"is larger than {most_bytes / 1024**2:g} MB")
    return data


def read_text(path: Path, most_bytes: int = LARGEST_FILE_BYTES) -> str:
    """The content of a regular UTF-8 file, a byte order mark left out; see `read_bytes`."""
    data = read_bytes(path, most_bytes)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(f"is not UTF-8: {error.reason} at byte {error.start}") from None


class RepeatedFieldError(ValueError):
    """A JSON object holds a field twice; `field` names it."""

    def __init__(self, field: str) -> None:
        self.field = field
        super().__init__(f"holds the field {field[:80]!r} twice in one object")


def load_json(data: bytes | str, *, finite: bool = True, unique: bool = False) -> Any:
    """Decode JSON whose nesting, integers and floats are bounded.

    Raises ValueError (a JSONDecodeError for broken syntax) for NaN, Infinity, a float outside the
    range of doubles, an integer of more than 300 digits, or nesting of more than 64 levels. With
    `finite=False` numbers outside that range pass, up to 4,300 digits, for a reader that says which
    field they stand in. With `unique` a field that stands twice in one object is refused too
    (RepeatedFieldError).
    """
    try:
        value = json.loads(
            data,
            parse_int=_integer if finite else _any_integer,
            parse_float=_float if finite else None,
            parse_constant=_no_constant if finite else None,
            object_pairs_hook=_unique if unique else None,
        )
    except RecursionError:
        raise ValueError(f"is nested more than {_DEEPEST} levels deep") from None
    _check_depth(value)
    return value


def _check_depth(content: object) -> None:
    level: list[object] = [content]
    for _ in range(_DEEPEST + 1):
        below: list[object] = []
        for value in level:
            if isinstance(value, dict):
                below += value.values()
            elif isinstance(value, list):
                below += value
        level = [value for value in below if isinstance(value, (dict, list))]
        if not level:
            return
    raise ValueError(f"is nested more than {_DEEPEST} levels deep")


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    fields: dict[str, Any] = {}
    for field, value in pairs:
        if field in fields:
            raise RepeatedFieldError(field)
        fields[field] = value
    return fields


def _integer(digits: str, longest: int = LONGEST_INTEGER) -> int:
    if len(digits) > longest:
        raise ValueError(f"holds a number of {len(digits):,} digits")
    return int(digits)


def _any_integer(digits: str) -> int:
    return _integer(digits, _LONGEST_SHOWN_INTEGER)


def _float(digits: str) -> float:
    value = float(digits)
    if not math.isfinite(value):
        raise ValueError(f"holds {digits[:20]}, which is outside the range of numbers")
    return value


def _no_constant(name: str) -> NoReturn:
    raise ValueError(f"holds {name}, which is no JSON")
