"""A line that is written and read again: a frozen model, its numbers, and what is wrong with it.

Types say what a single value may be; relations between values are functions that find faults, made
validators by `checked`. `validated` takes a decoded value, `decode` a line of a file; `problems_of`
puts into words what pydantic found.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import islice
from typing import Annotated, Any, NamedTuple, TypeVar, get_args

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    TypeAdapter,
    ValidationError,
    WrapValidator,
)
from pydantic_core import PydanticCustomError

from phyblock.errors import DataError, Problem
from phyblock.files import load_json

LARGEST_WHOLE = 2**53
_LONGEST_SHOWN = 60
_MOST_FAULTS = 100
"""Faults of one line that are reported."""
_FAULTS = "faults"
_OBJECT = ("is not an object", "an object")
_LIST = ("is not a list", "a list")
_WORDS: Mapping[str, tuple[str, str]] = {
    "dict_type": _OBJECT,
    "model_type": _OBJECT,
    "list_type": _LIST,
    "tuple_type": _LIST,
    "too_short": ("is not a non-empty list", "a list with at least one entry"),
    "string_type": ("is no text", "a text"),
    "bool_type": ("is neither true nor false", "true or false"),
}
_ENCODER = json.JSONEncoder(ensure_ascii=False, default=lambda value: type(value).__name__)


def _finite(value: Any) -> Any:
    """A value that no model declares, which JSON must be able to hold."""
    json.dumps(value, allow_nan=False)
    return value


class Line(BaseModel):
    """A JSON object that is written and read again, or a part of one.

    Fields keep the order in which they are declared, and only those that were given are written,
    with fields that are not known, so that a line that was read is written again as it was.
    """

    # Building is deferred because most commands read one kind of line, if any.
    model_config = ConfigDict(frozen=True, extra="allow", allow_inf_nan=False, defer_build=True)
    __pydantic_extra__: dict[str, Annotated[Any, AfterValidator(_finite)]] = Field(init=False)

    def as_given(self) -> dict[str, Any]:
        """Return what was given, as it is, in the order in which it is written."""
        return {name: value for name, value in self if name in self.model_fields_set}

    def fields(self) -> dict[str, Any]:
        """Return the line as it is written: plain values, nothing that was not given."""
        return self.model_dump(exclude_unset=True)

    def as_json(self) -> str:
        """Return the line as JSON, without a newline at its end."""
        return json.dumps(self.fields(), allow_nan=False)


LineT = TypeVar("LineT", bound=Line)

Whole = Annotated[int, Field(ge=-LARGEST_WHOLE, le=LARGEST_WHOLE)]
"""An integer that tables can hold and add up."""
Amount = Annotated[float, Field(allow_inf_nan=False)]
"""A finite number."""
Usd = Annotated[float, Field(ge=0, allow_inf_nan=False)]
"""An amount of money [US dollars], which a cost limit can be kept on top of."""


class Fault(NamedTuple):
    """One thing that is wrong; `at` is its place inside the value that was checked.

    `found` is shown as it is; None shows the value that was checked.
    """

    message: str
    allowed: str = ""
    found: str | None = None
    at: tuple[str | int, ...] = ()


def fault(*faults: Fault) -> PydanticCustomError:
    """Return what a validator raises to report these faults."""
    return PydanticCustomError(_FAULTS, "is not sound", {_FAULTS: faults})


def checked(*finders: Callable[[Any], Iterable[Fault]]) -> AfterValidator:
    """Return a check that these find nothing in a value, whose parts are sound."""

    def check(value: Any) -> Any:
        if faults := [each for find in finders for each in find(value)]:
            raise fault(*faults)
        return value

    return AfterValidator(check)


def worded(message: str, allowed: str) -> WrapValidator:
    """Return a type's own message for whatever is wrong with a value."""

    def check(value: Any, inner: Callable[[Any], Any]) -> Any:
        try:
            return inner(value)
        except ValidationError:
            raise fault(Fault(message, allowed)) from None

    return WrapValidator(check)


def validated(kind: type[LineT], raw: object, where: str) -> LineT:
    """Return a decoded JSON value as a line; DataError with everything that is wrong with it."""
    try:
        return kind.model_validate(raw)
    except ValidationError as error:
        raise DataError(islice(problems_of(error, where, kind), _MOST_FAULTS)) from None


def refuse(faults: Iterable[Fault], where: str) -> None:
    """Raise DataError with these faults of a line, if there are any."""
    every = (Problem(where, f.message, dotted(f.at), f.found or "", f.allowed) for f in faults)
    if problems := tuple(islice(every, _MOST_FAULTS)):
        raise DataError(problems)


def decode(adapter: TypeAdapter[Any], line: bytes) -> Any:
    """Read a line by its model, in bounds and without changing the type of anything.

    Raises ValueError with what was wrong with it: a JSONDecodeError for broken syntax, pydantic's
    ValidationError for fields, any other with a text that can be shown. Lone surrogates, which no
    output could hold, become "?".
    """
    try:
        return adapter.validate_json(line, strict=True)
    except ValidationError:
        # Most lines are sound: only one that is not is decoded again, to find the reason.
        value = load_json(line.decode("utf-8"))
    return adapter.validate_json(json.dumps(_well_formed(value)), strict=True)


def problems_of(
    error: ValidationError,
    where: str,
    kind: type[BaseModel] = Line,
    is_not: str = "",
    hint: str = "",
    skip: int = 0,
) -> Iterator[Problem]:
    """Yield what pydantic found, in our words.

    `kind` is the model that was read; `is_not` begins each message ("is not a record");
    the first `skip` parts of places are left out, which name a choice of models.
    """
    for one in error.errors(include_url=False):
        what, context, place = one["type"], one.get("ctx") or {}, one["loc"][skip:]
        faults: Iterable[Fault] = ()
        if what == "too_short" and one["input"]:
            continue  # There are entries, and what is wrong with each of them is reported.
        if what == _FAULTS:
            faults = context[_FAULTS]
        elif what == "missing":
            held = one["input"]
            found = shown(sorted(held)) if isinstance(held, dict) else None
            faults = (Fault("is missing", f"a field {place[-1]!r}", found),)
        elif what == "extra_forbidden":
            faults = (Fault("is not known", ", ".join(_model_at(kind, place).model_fields), ""),)
        elif what == "literal_error":
            allowed = context["expected"].replace("'", "").replace(" or ", ", ")
            faults = (Fault("is not known", allowed),)
        elif what in ("union_tag_invalid", "union_tag_not_found"):
            found, allowed = context.get("tag", ""), context.get("expected_tags", "a text")
            at = (context["discriminator"].strip("'"),)
            faults = (Fault("is not known" if found else "is missing", allowed, found, at),)
        elif what == "too_long":
            n, most = context["actual_length"], context["max_length"]
            faults = (Fault("are too many", f"at most {most}", str(n)),)
        elif what in _WORDS:
            faults = (Fault(*_WORDS[what]),)
        else:
            allowed = one["msg"].removeprefix("Input should be ").removeprefix("Value error, ")
            faults = (Fault("is of the wrong type or out of range", allowed),)
        for each in faults:
            found = shown(one["input"]) if each.found is None else each.found
            message = f"{is_not}: {each.message}" if is_not else each.message
            field = dotted((*place, *each.at))
            yield Problem(where, message, field, found, each.allowed, hint)


def dotted(place: Sequence[int | str]) -> str:
    """Return a place as people write it: `blocks[1].depend`; its empty parts are choices."""
    text = ""
    for part in place:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if part else ""
    return text.lstrip(".")


def shown(value: object) -> str:
    """Return a value as JSON as far as it is shown, whatever it is."""
    text = ""
    try:
        for part in _ENCODER.iterencode(value):
            text += part
            if len(text) > _LONGEST_SHOWN:
                break
    except (TypeError, ValueError, RecursionError):
        text += "..." if text else type(value).__name__
    text = encodable(text)
    return text if len(text) <= _LONGEST_SHOWN else text[: _LONGEST_SHOWN - 3] + "..."


def encodable(text: str) -> str:
    """Return text that UTF-8 can hold: lone surrogates, as of a broken reply, become "?"."""
    return text.encode("utf-8", "replace").decode("utf-8")


def parts(hint: Any) -> list[type[Line]]:
    """Return the models that a type is made of."""
    if isinstance(hint, type) and issubclass(hint, Line):
        return [hint]
    return [part for argument in get_args(hint) for part in parts(argument)]


def _model_at(kind: type[BaseModel], place: Iterable[str | int]) -> type[BaseModel]:
    """The model of the part of a line that holds this place."""
    for name in place:
        if name in kind.model_fields:
            kind = next(iter(parts(kind.model_fields[str(name)].annotation)), kind)
    return kind


def _well_formed(value: Any) -> Any:
    """A decoded value whose texts UTF-8 can hold."""
    if isinstance(value, str):
        return encodable(value)
    if isinstance(value, list):
        return [_well_formed(below) for below in value]
    if isinstance(value, dict):
        return {encodable(name): _well_formed(below) for name, below in value.items()}
    return value
