"""JSON files read without trust: within bounds, and what is wrong is said with its place."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TypeVar

from phyblock.errors import DataError, Problem, reason_of
from phyblock.files import RepeatedFieldError, load_json, read_bytes

__all__ = [
    "gather",
    "lines_of",
    "parse_json",
    "read_json",
    "read_lines",
    "read_text",
    "used_already",
]

_LARGEST_BYTES = 1024**3
_LONGEST_LINE = 2**20
_MOST_OF_ALL = 1000
"""Faults of a data set that are told."""
_SURROGATE = re.compile(r"\\u[dD][89a-fA-F]")
_T = TypeVar("_T")


def read_text(path: Path, allowed: str = "") -> str:
    """The text of `path`; DataError when it cannot be read, is too large or is not UTF-8."""
    try:
        return read_bytes(path, _LARGEST_BYTES).decode("utf-8")
    except OSError as error:
        problem = Problem(str(path), f"cannot be read: {reason_of(error)}", allowed=allowed)
        raise DataError(problem) from error
    except UnicodeDecodeError as error:
        raise DataError(Problem(str(path), f"is not UTF-8 text: {error.reason}")) from error
    except ValueError as error:
        raise DataError(Problem(str(path), str(error), allowed=allowed)) from error


def read_json(path: Path) -> Any:
    """The JSON value in `path`; DataError, with line and column, when there is none."""
    return parse_json(read_text(path), path)


def parse_json(text: str, path: Path, line: int | None = None) -> Any:
    """The JSON value in `text`: all of `path`, or its line number `line`.

    Raises DataError for bad syntax, an object that holds a field twice, a number of hundreds of
    digits, nesting that is too deep, half of a character, or a line of more than a million
    characters. Numbers that are not finite pass: the field they stand in is checked.
    """
    where = str(path) if line is None else f"{path}:{line}"
    if line is not None and len(text) > _LONGEST_LINE:
        found = f"{len(text):,} characters"
        problem = Problem(where, "is too long a line", "", found, f"{_LONGEST_LINE:,} at most")
        raise DataError(problem)
    try:
        value = load_json(text, finite=False, unique=True)
        if _SURROGATE.search(text):
            json.dumps(value, ensure_ascii=False).encode()
    except json.JSONDecodeError as error:
        where += f":{error.colno}" if line is not None else f":{error.lineno}:{error.colno}"
        raise DataError(Problem(where, f"is not valid JSON: {error.msg}")) from error
    except RepeatedFieldError as error:
        raise DataError(Problem(where, "stands twice in one object", error.field)) from error
    except UnicodeEncodeError as error:
        message = "holds half of a character (a lone surrogate)"
        raise DataError(Problem(where, message)) from error
    except ValueError as error:
        raise DataError(Problem(where, str(error))) from error
    return value


def lines_of(path: Path, allowed: str) -> list[str]:
    """The lines of a file; DataError, with what is allowed, when it cannot be read."""
    return _lines(read_text(path, allowed))


def _lines(text: str) -> list[str]:
    # Not splitlines(): a JSON string may hold U+2028 and other line ends of Unicode.
    return text.removesuffix("\n").split("\n") if text else []


def read_lines(
    path: Path, text: str, noun: str, read: Callable[[Any, str], _T], name: Callable[[_T], str]
) -> list[_T]:
    """Every line of `text`, which is that of a file, as `read` makes it of its JSON value and its
    place.

    Raises DataError with everything that is wrong: what `read` raises, a name that stands twice, a
    file of no `noun`.
    """
    lines = _lines(text)
    first_line: dict[str, int] = {}
    values: list[_T] = []
    problems: list[Problem] = []
    for number, line in enumerate(lines, 1):
        where = f"{path}:{number}"
        try:
            one = read(parse_json(line, path, number), where)
        except DataError as error:
            gather(problems, error.problems, path)
            continue
        first = first_line.setdefault(name(one), number)
        if first != number:
            gather(problems, [used_already(where, f"by line {first}", name(one))], path)
        values.append(one)
    if not lines:
        problems.append(Problem(str(path), f"holds no {noun}s", allowed=f"one {noun} a line"))
    if problems:
        raise DataError(problems)
    return values


def used_already(where: str, first: str, name: str) -> Problem:
    """An id whose `first` use was before: by a line, or at a place."""
    return Problem(where, f"is used {first} already", "id", repr(name))


def gather(problems: list[Problem], more: Iterable[Problem], where: object) -> None:
    """Add problems to those of a whole data set; DataError when they become too many to go on."""
    problems += more
    if len(problems) > _MOST_OF_ALL:
        note = f"has more than {_MOST_OF_ALL:,} faults; only the first were looked for"
        raise DataError([Problem(str(where), note), *problems])
