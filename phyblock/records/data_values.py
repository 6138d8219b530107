"""The single values that lines of data are made of, each with its bounds and its message.

Numbers stay integers or floats as they were given, so that a line is written as it was read.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import Field, GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, core_schema

from phyblock.records.faults import Fault, fault, free_of, worded

__all__ = [
    "NAME_ALLOWED",
    "Angles",
    "Filled",
    "Format",
    "Name",
    "Order",
    "OrderOrGround",
    "Position",
    "Text",
    "Triple",
    "View",
    "is_name",
    "plain",
    "rounded",
    "triple",
]

Triple = tuple[float, float, float]

_NAME = r"^[A-Za-z0-9][A-Za-z0-9._-]{0,99}$"
NAME_ALLOWED = "up to 100 letters, digits, '.', '_' or '-', a letter or digit first"
_NO_TEXT = ("is no text", "a text that is not blank")
_NO_VECTOR = "is not a vector in range"
_NO_NUMBER = "is not an allowed number"
_MOST_ORDER = 9999
_METERS, _DEGREES = (-100, 100), (-36_000, 36_000)
"""Far above any use, and near enough to zero for geometry to be exact."""


@dataclass(frozen=True)
class Filled:
    """A list of one entry at least and `most` at most; entries are looked at after that."""

    most: int

    def __get_pydantic_core_schema__(self, kind: Any, inner: GetCoreSchemaHandler) -> CoreSchema:
        """As pydantic asks for it."""
        return core_schema.no_info_before_validator_function(self._check, inner(kind))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, inner: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """As pydantic asks for it."""
        return {**inner(schema), "minItems": 1, "maxItems": self.most}

    def _check(self, value: object) -> object:
        if not isinstance(value, list | tuple) or not value:
            raise fault(Fault("is not a non-empty list", "a list with at least one entry"))
        if len(value) > self.most:
            raise fault(Fault("are too many", f"at most {self.most}", str(len(value))))
        return value


@dataclass(frozen=True)
class Numbers:
    """As many finite numbers as there are bounds, each within its own."""

    message: str
    allowed: str
    bounds: tuple[tuple[float, float], ...]

    def __get_pydantic_core_schema__(self, kind: Any, inner: GetCoreSchemaHandler) -> CoreSchema:
        """As pydantic asks for it."""
        return core_schema.no_info_plain_validator_function(self._check)

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, inner: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """As pydantic asks for it."""
        n = len(self.bounds)
        items = [{"type": "number", "minimum": a, "maximum": b} for a, b in self.bounds]
        return {"type": "array", "prefixItems": items, "minItems": n, "maxItems": n}

    def _check(self, value: object) -> tuple[float, ...]:
        if isinstance(value, list | tuple) and len(value) == len(self.bounds):
            for number, (low, high) in zip(value, self.bounds, strict=True):
                if not _is_within(number, low, high):
                    break
            else:
                return tuple(value)
        raise fault(Fault(self.message, self.allowed))


def _is_within(value: object, low: float, high: float) -> bool:
    # A union would be made anew for each of many thousand numbers.
    return isinstance(value, (int, float)) and not isinstance(value, bool) and low <= value <= high


Format = Annotated[int, Field(strict=True, ge=1, le=1), worded("is not known", "1")]
"""Version of a line of data; a newer one may mean something else."""
Order = Annotated[
    int,
    Field(strict=True, ge=1, le=_MOST_ORDER),
    worded(_NO_NUMBER, f"an integer of at least 1, at most {_MOST_ORDER}"),
]
"""Number of a block or of a layer."""
OrderOrGround = Annotated[
    int,
    Field(strict=True, ge=0, le=_MOST_ORDER),
    worded(_NO_NUMBER, f"an integer of at least 0, at most {_MOST_ORDER}"),
]
"""Number of a block, 0 for the ground."""
Name = Annotated[str, Field(pattern=_NAME), worded("is not a name", NAME_ALLOWED)]
"""A name that is safe in file names and tables."""
Text = Annotated[
    str, worded(*_NO_TEXT), free_of(lambda text: () if text.strip() else [Fault(*_NO_TEXT)])
]
Position = Annotated[
    Triple, Numbers(_NO_VECTOR, "three finite numbers of -100 to 100 m", (_METERS,) * 3)
]
"""A point [m]."""
Angles = Annotated[
    Triple, Numbers(_NO_VECTOR, "three finite numbers of -36000 to 36000 degrees", (_DEGREES,) * 3)
]
"""Three angles [degrees]."""
View = Annotated[
    tuple[float, float],
    Numbers("is no view", "azimuth, and elevation 1 to 90 [degrees]", (_DEGREES, (1, 90))),
]


def is_name(text: str) -> bool:
    """Whether a text is a `Name`."""
    return re.fullmatch(_NAME, text) is not None


def triple(numbers: Triple) -> Triple:
    """Floats, without -0.0, so that equal scenes have equal digests."""
    x, y, z = numbers
    return float(x) + 0.0, float(y) + 0.0, float(z) + 0.0


def rounded(numbers: Triple) -> Triple:
    """Lengths [m] to a micrometer."""
    x, y, z = (round(number, 6) + 0.0 for number in numbers)
    return x, y, z


def plain(numbers: tuple[float, ...]) -> Any:
    """Whole numbers as integers, which read better in a file."""
    return tuple(int(n) if float(n).is_integer() else n for n in numbers)
