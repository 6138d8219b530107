"""A line that is written and read again: a frozen model, its numbers, and its reading."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from phyblock.config.validation import problems_of
from phyblock.config.yaml import FieldPath, YamlSource
from phyblock.errors import DataError, InputError, Problem, StoreError
from phyblock.files import load_json

LARGEST_WHOLE = 2**53


def _finite(value: Any) -> Any:
    """Return a value that no model declares, which JSON must be able to hold."""
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
ValueT = TypeVar("ValueT")

Whole = Annotated[int, Field(ge=-LARGEST_WHOLE, le=LARGEST_WHOLE)]
"""An integer that tables can hold and add up."""
Amount = Annotated[float, Field(allow_inf_nan=False)]
"""A finite number."""
Usd = Annotated[float, Field(ge=0, allow_inf_nan=False)]
"""An amount of money [US dollars], which a cost limit can be kept on top of."""


def validated(
    kind: type[LineT], raw: object, source: YamlSource | str, base: FieldPath = ()
) -> LineT:
    """Return decoded data as a line; DataError with everything that is wrong with it.

    The data stands at `base` in a YAML source, or all at one place.
    """
    try:
        return kind.model_validate(raw)
    except ValidationError as error:
        raise DataError(problems_of(error, kind, raw, source, base)) from None


def decode(
    adapter: TypeAdapter[ValueT], data: bytes, where: str, kind: type[BaseModel] = Line
) -> ValueT:
    """Return JSON text as what `adapter` reads, without changing the type of anything.

    Raises DataError with everything that is wrong with it; `kind` is the model of what is read.
    Lone surrogates, which no output could hold, become "?".
    """
    try:
        return adapter.validate_json(data, strict=True)
    except ValidationError:
        pass  # Most lines are valid: only one that is not is decoded again, to find the reason.
    try:
        value = _well_formed(load_json(data.decode("utf-8")))
    except json.JSONDecodeError as error:
        place = f"{error.lineno}:{error.colno}" if b"\n" in data.rstrip() else f"{error.colno}"
        raise DataError(Problem(f"{where}:{place}", f"is not JSON: {error.msg}")) from error
    except ValueError as error:
        message = "is not UTF-8" if isinstance(error, UnicodeDecodeError) else str(error)
        raise DataError(Problem(where, message)) from error
    try:
        return adapter.validate_json(json.dumps(value), strict=True)
    except ValidationError as error:
        raise DataError(problems_of(error, kind, value, where)) from None


def not_a(noun: str, error: InputError, hint: str) -> StoreError:
    """Return the error of a file of runs that holds no `noun`, for what is wrong in it."""
    return StoreError(
        replace(one, message=f"is not a {noun}: {one.message}", hint=hint) for one in error.problems
    )


def encodable(text: str) -> str:
    """Return text that UTF-8 can hold: lone surrogates, as of a broken reply, become "?"."""
    return text.encode("utf-8", "replace").decode("utf-8")


def _well_formed(value: Any) -> Any:
    """Return a decoded value with texts that UTF-8 can hold."""
    if isinstance(value, str):
        return encodable(value)
    if isinstance(value, list):
        return [_well_formed(below) for below in value]
    if isinstance(value, dict):
        return {encodable(name): _well_formed(below) for name, below in value.items()}
    return value
