"""JSON files and raw JSON values, read without trust: what is wrong is collected and said."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, cast

from phyblock.errors import DataError, Problem

__all__ = ["MISSING", "RawReader", "parse_json", "read_json", "read_text"]

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
        """Note one problem."""
        shown = "" if found is MISSING else _show(found)
        self.problems.append(Problem(self.where, message, field, shown, allowed))

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
        """An integer in low..high."""
        fits = isinstance(value, int) and not isinstance(value, bool) and value >= low
        if fits and (high is None or cast(int, value) <= high):
            return cast(int, value)
        allowed = f"an integer of at least {low}" if high is None else f"an integer {low} to {high}"
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
        if isinstance(value, str) and _NAME.fullmatch(value):
            return value
        allowed = "up to 100 letters, digits, '.', '_' or '-', a letter or digit first"
        self._complain_unless_missing(field, "is not a name", value, allowed)
        return ""

    def vector(self, value: object, field: str) -> tuple[float, float, float] | None:
        """Three finite numbers."""
        if isinstance(value, list) and len(value) == 3:
            x, y, z = map(_finite, value)
            if x is not None and y is not None and z is not None:
                return (x, y, z)
        self._complain_unless_missing(field, "is not a vector", value, "three finite numbers")
        return None

    def items(self, value: object, field: str) -> list[Any]:
        """A non-empty list."""
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


def read_text(path: Path, allowed: str = "") -> str:
    """The text of `path`; DataError when it cannot be read or is not UTF-8."""
    try:
        return path.read_bytes().decode("utf-8")
    except OSError as error:
        problem = Problem(str(path), f"cannot be read: {error.strerror}", allowed=allowed)
        raise DataError(problem) from error
    except UnicodeDecodeError as error:
        raise DataError(Problem(str(path), f"is not UTF-8 text: {error.reason}")) from error


def read_json(path: Path) -> Any:
    """The JSON value in `path`; DataError, with line and column, when there is none."""
    return parse_json(read_text(path), path)


def parse_json(text: str, path: Path, line: int | None = None) -> Any:
    """The JSON value in `text`: all of `path`, or its line number `line`.

    Raises DataError for bad syntax, an object that holds a field twice, a number of thousands of
    digits, or nesting that is too deep.
    """
    where = str(path) if line is None else f"{path}:{line}"
    try:
        return json.loads(text, object_pairs_hook=_unique)
    except json.JSONDecodeError as error:
        where += f":{error.colno}" if line is not None else f":{error.lineno}:{error.colno}"
        raise DataError(Problem(where, f"is not valid JSON: {error.msg}")) from error
    except _RepeatedFieldError as error:
        raise DataError(Problem(where, "stands twice in one object", error.field)) from error
    except ValueError as error:
        raise DataError(Problem(where, "holds a number of too many digits")) from error
    except RecursionError as error:
        raise DataError(Problem(where, "is nested too deeply")) from error


class _RepeatedFieldError(ValueError):
    def __init__(self, field: str) -> None:
        self.field = field
        super().__init__(field)


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    raw: dict[str, Any] = {}
    for field, value in pairs:
        if field in raw:
            raise _RepeatedFieldError(field)
        raw[field] = value
    return raw


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
    text = json.dumps(value, default=str)
    return text if len(text) <= _SHOWN else text[: _SHOWN - 1] + "…"
