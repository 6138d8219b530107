"""What every stored line is: a frozen model that keeps also what it does not know.

Fields keep the order in which they are declared, and only those that were given are written, so
that a line that was read is written again byte for byte, whichever version wrote it.
"""

from __future__ import annotations

import json
from typing import Annotated, Any, get_args

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

__all__ = ["LARGEST_WHOLE", "Amount", "Line", "Usd", "Whole", "encodable", "parts"]

LARGEST_WHOLE = 2**53


def _finite(value: Any) -> Any:
    """A value that no model declares, which JSON must be able to hold."""
    json.dumps(value, allow_nan=False)
    return value


class Line(BaseModel):
    """A JSON object that is written and read again, or a part of one."""

    # Building is deferred because most commands read one kind of line, if any.
    model_config = ConfigDict(frozen=True, extra="allow", allow_inf_nan=False, defer_build=True)
    __pydantic_extra__: dict[str, Annotated[Any, AfterValidator(_finite)]] = Field(init=False)

    def as_given(self) -> dict[str, Any]:
        """What was given, as it is, in the order in which it is written."""
        return {name: value for name, value in self if name in self.model_fields_set}

    def fields(self) -> dict[str, Any]:
        """The line as it is written: plain values, nothing that was not given."""
        return self.model_dump(exclude_unset=True)

    def as_json(self) -> str:
        """The line as JSON, no newline at its end."""
        return json.dumps(self.fields(), allow_nan=False)


Whole = Annotated[int, Field(ge=-LARGEST_WHOLE, le=LARGEST_WHOLE)]
"""An integer that tables can hold and add up."""

Amount = Annotated[float, Field(allow_inf_nan=False)]
"""A finite number."""

Usd = Annotated[float, Field(ge=0, allow_inf_nan=False)]
"""An amount of money [US dollars], which a cost limit can be kept on top of."""


def encodable(text: str) -> str:
    """Text that UTF-8 can hold: lone surrogates, which a broken reply may have, become "?"."""
    return text.encode("utf-8", "replace").decode("utf-8")


def parts(hint: Any) -> list[type[Line]]:
    """The models that a type is made of."""
    if isinstance(hint, type) and issubclass(hint, Line):
        return [hint]
    return [part for argument in get_args(hint) for part in parts(argument)]
