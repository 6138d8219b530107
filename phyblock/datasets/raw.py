"""JSON files and raw JSON values, read without trust: what is wrong is collected and said."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, cast

from phyblock.bounded import RepeatedFieldError, load_json, read_bytes
from phyblock.errors import DataError, Problem, said

__all__ = ["MISSING", "RawReader", "gather", "is_name", "parse_json", "read_json", "read_text"]

_LARGEST_BYTES = 1024**3
_LONGEST_LINE = 2**20
_MOST_OF_ALL, _MOST_OF_ONE = 1000, 100
"""Faults of a data set, and of one scene or question, that are told."""
_MOST_NUMBER = 9999
"""Of a block or a layer: far above any use."""
_MOST_POSITION_M = 100.0
_MOST_ANGLE_DEG = 36_000.0
_SURROGATE = re.compile(r"\\u[dD][89a-fA-F]")

MISSING: Any = object()
"""Stands for a value that was complained about already; every check lets it pass in silence."""

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}")
_SHOWN = 80


class RawReader:
    """Reads one raw object and collects what is wrong with it.

    The methods return a usable value or None; call `raise_if_broken` before trusting any.
    """

    def __init__(self, where: str) -> None:
        self.where = where
        self.problems: list[Problem] = []

    def complain(
        self, field: str, message: str, found: object = MISSING, allowed: str = ""
    ) -> None:
        """Note one problem; raises DataError when there are too many to go on."""
        shown = "" if found is MISSING else _show(found)
        self.problems.append(Problem(self.where, message, field, shown, allowed))
        if len(self.problems) >= _MOST_OF_ONE:
            raise DataError(self.problems)

    def raise_if_broken(self) -> None:
        """Raise DataError with everything that was noted, if anything was."""
        if self.problems:
            raise DataError(self.problems)

    def mapping(self, value: object, field: str = "") -> Any:
        """An object, or MISSING after a complaint."""
        if isinstance(value, Mapping):
            return value
        self._complain_unless_missing(field, "is not an object", value, "an object")
        return MISSING

    def get(self, raw: Any, field: str, prefix: str = "") -> Any:
        """`raw[field]`, or MISSING after a complaint; `raw` comes from `mapping`."""
        if raw is MISSING:
            return MISSING
        if field not in raw:
            self.complain(prefix + field, "is missing", sorted(raw), f"a field {field!r}")
        return raw.get(field, MISSING)

    def integer(self, value: object, field: str, low: int, high: int | None = None) -> int | None:
        """An integer in low..high; without `high` one that is exact in every arithmetic."""
        most = _MOST_NUMBER if high is None else high
        is_whole = isinstance(value, int) and not isinstance(value, bool)
        if is_whole and low <= cast(int, value) <= most:
            return cast(int, value)
        is_large = is_whole and cast(int, value) > most
        bounded = is_large or high is not None
        allowed = f"an integer {low} to {most}" if bounded else f"an integer of at least {low}"
        self._complain_unless_missing(field, "is not an allowed number", value, allowed)
        return None

    def choice(self, value: object, field: str, allowed: Sequence[str]) -> str | None:
        """One of the allowed words."""
        if isinstance(value, str) and value in allowed:
            return value
        self._complain_unless_missing(field, "is not known", value, ", ".join(allowed))
        return None

    def name(self, value: object, field: str) -> str:
        """A name that is safe in file names and tables; "" after a complaint."""
        if isinstance(value, str) and is_name(value):
            return value
        allowed = "up to 100 letters, digits, '.', '_' or '-', a letter or digit first"
        self._complain_unless_missing(field, "is not a name", value, allowed)
        return ""

    def position(self, value: object, field: str) -> tuple[float, float, float] | None:
        """Three numbers of meters, near enough to the origin for geometry to be exact."""
        allowed = f"three numbers of -{_MOST_POSITION_M:g} to {_MOST_POSITION_M:g} m"
        return self._vector(value, field, _MOST_POSITION_M, allowed)

    def angles(self, value: object, field: str) -> tuple[float, float, float] | None:
        """Three numbers of degrees, a hundred turns at most."""
        allowed = f"three numbers of -{_MOST_ANGLE_DEG:g} to {_MOST_ANGLE_DEG:g} degrees"
        return self._vector(value, field, _MOST_ANGLE_DEG, allowed)

    def _vector(
        self, value: object, field: str, most: float, allowed: str
    ) -> tuple[float, float, float] | None:
        numbers = map(_finite, value) if isinstance(value, list) and len(value) == 3 else ()
        found = tuple(number for number in numbers if number is not None)
        if len(found) != 3:
            self._complain_unless_missing(field, "is not a vector", value, "three finite numbers")
            return None
        if max(map(abs, found)) > most:
            self.complain(field, "is out of range", value, allowed)
            return None
        return found

    def items(self, value: object, field: str, most: int | None = None) -> list[Any]:
        """A non-empty list of `most` entries at most; [] after a complaint."""
        if isinstance(value, list) and most is not None and len(value) > most:
            self.complain(field, "are too many", len(value), f"at most {most}")
            return []
        if isinstance(value, list) and value:
            return value
        allowed = "a list with at least one entry"
        self._complain_unless_missing(field, "is not a non-empty list", value, allowed)
        return []

    def _complain_unless_missing(
        self, field: str, message: str, found: object, allowed: str
    ) -> None:
        if found is not MISSING:
            self.complain(field, message, found, allowed)


def is_name(text: str) -> bool:
    """Whether a text is safe in file names and tables."""
    return _NAME.fullmatch(text) is not None


def read_text(path: Path, allowed: str = "") -> str:
    """The text of `path`; DataError when it cannot be read, is too large or is not UTF-8."""
    try:
        return read_bytes(path, _LARGEST_BYTES).decode("utf-8")
    except OSError as error:
        problem = Problem(str(path), f"cannot be read: {said(error)}", allowed=allowed)
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


def gather(problems: list[Problem], more: Iterable[Problem], where: object) -> None:
    """Add problems to those of a whole data set; DataError when they become too many to go on."""
    problems += more
    if len(problems) > _MOST_OF_ALL:
        note = f"has more than {_MOST_OF_ALL:,} faults; only the first were looked for"
        raise DataError([Problem(str(where), note), *problems])


def _finite(value: object) -> float | None:
    if not isinstance(value, int | float) or isinstance(value, bool):
        return None
    try:
        # Adding zero turns -0.0 into 0.0, so that equal scenes have equal digests.
        number = float(value) + 0.0
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def _show(value: object) -> str:
    text = ""
    for piece in json.JSONEncoder(default=str).iterencode(value):
        text += piece
        if len(text) > _SHOWN:
            return text[: _SHOWN - 1] + "…"
    return text
