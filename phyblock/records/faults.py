"""What is wrong with a line of data, all of it at once: each fault with place, found and allowed.

Types say what a single value may be. Where pydantic's own words would not help, `worded` gives the
message; relations between values are functions that find faults, made validators by `free_of`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import islice
from typing import Any, TypeVar

from pydantic import AfterValidator, ValidationError, ValidationInfo, WrapValidator
from pydantic_core import PydanticCustomError

from phyblock.errors import DataError, Problem
from phyblock.records.decode import dotted, shown
from phyblock.records.line import Line, parts

__all__ = ["Fault", "fault", "fits", "free_of", "refuse", "validated", "worded"]

_MOST_FAULTS = 100
"""Faults of one line that are told."""
_OBJECT = ("is not an object", "an object")
_WORDS: Mapping[str, tuple[str, str]] = {
    "dict_type": _OBJECT,
    "extra_forbidden": ("is not known", ""),
    "literal_error": ("is not known", ""),
    "missing": ("is missing", ""),
    "model_type": _OBJECT,
    "string_type": ("is no text", "a text"),
    "bool_type": ("is neither true nor false", "true or false"),
}
_FAULTS = "faults"
_LineT = TypeVar("_LineT", bound=Line)
_T = TypeVar("_T")


@dataclass(frozen=True)
class Fault:
    """One thing that is wrong; `at` is its place inside the value that was checked.

    `found` is shown as it is; None shows the value that was checked.
    """

    message: str
    allowed: str = ""
    found: str | None = None
    at: tuple[str | int, ...] = ()


def fault(*faults: Fault) -> PydanticCustomError:
    """What a validator raises to say these faults."""
    return PydanticCustomError(_FAULTS, "is not sound", {_FAULTS: faults})


def worded(message: str, allowed: str) -> WrapValidator:
    """A type's own message for whatever is wrong with a value."""

    def check(value: Any, inner: Callable[[Any], Any]) -> Any:
        try:
            return inner(value)
        except ValidationError:
            raise fault(Fault(message, allowed)) from None

    return WrapValidator(check)


def free_of(*finders: Callable[[Any], Iterable[Fault]]) -> AfterValidator:
    """A check that these find nothing in a value, whose parts are sound."""

    def check(value: _T) -> _T:
        if faults := [each for find in finders for each in find(value)]:
            raise fault(*faults)
        return value

    return AfterValidator(check)


def fits(find: Callable[[Any, ValidationInfo], Iterable[Fault]]) -> AfterValidator:
    """A check that `find` finds nothing, given the fields before this one and the context."""

    def check(value: _T, info: ValidationInfo) -> _T:
        if faults := tuple(find(value, info)):
            raise fault(*faults)
        return value

    return AfterValidator(check)


def validated(kind: type[_LineT], raw: object, where: str, context: object = None) -> _LineT:
    """A decoded JSON value as a line; DataError with everything that is wrong with it.

    `context` is what validators hold the line against.
    """
    try:
        return kind.model_validate(raw, context=context)
    except ValidationError as error:
        raise DataError(islice(_problems(error, kind, where), _MOST_FAULTS)) from None


def refuse(faults: Iterable[Fault], where: str) -> None:
    """DataError with these faults of a line, if there are any."""
    every = (Problem(where, f.message, dotted(f.at), f.found or "", f.allowed) for f in faults)
    if problems := tuple(islice(every, _MOST_FAULTS)):
        raise DataError(problems)


def _problems(error: ValidationError, kind: type[Line], where: str) -> Iterator[Problem]:
    for one in error.errors(include_url=False):
        for each in _faults(one, kind):
            field = dotted((*one["loc"], *each.at))
            found = shown(one["input"]) if each.found is None else each.found
            yield Problem(where, each.message, field, found, each.allowed)


def _faults(error: Any, kind: type[Line]) -> tuple[Fault, ...]:
    what, context = error["type"], error.get("ctx") or {}
    if what == _FAULTS:
        faults: tuple[Fault, ...] = context[_FAULTS]
        return faults
    message, allowed = _WORDS.get(what, (error["msg"], ""))
    found = None
    if what == "missing":
        allowed = f"a field {error['loc'][-1]!r}"
        found = shown(sorted(error["input"]))
    elif what == "extra_forbidden":
        allowed, found = ", ".join(_model_at(kind, error["loc"]).model_fields), ""
    elif what == "literal_error":
        allowed = context["expected"].replace("'", "").replace(" or ", ", ")
    return (Fault(message, allowed, found),)


def _model_at(kind: type[Line], place: Iterable[str | int]) -> type[Line]:
    """The model of the part of a line that holds this place."""
    for name in place:
        if name in kind.model_fields:
            kind = next(iter(parts(kind.model_fields[str(name)].annotation)), kind)
    return kind
