"""What every stored line is: a frozen model that keeps also what it does not know.

Fields keep the order in which they are declared, and only those that were given are written, so
that a line that was read is written again byte for byte, whichever version wrote it.
"""

from __future__ import annotations

import json
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

__all__ = ["LARGEST_WHOLE", "Amount", "Line", "Whole", "encodable"]

LARGEST_WHOLE = 2**53


def _finite(value: Any) -> Any:
    """A value that no model declares, which JSON must be able to hold."""
    json.dumps(value, allow_nan=False)
    return value


class Line(BaseModel):
    """A JSON object that is written and read again, or a part of one."""

    model_config = ConfigDict(
        frozen=True, extra="allow", allow_inf_nan=False, use_attribute_docstrings=True
    )
    __pydantic_extra__: dict[str, Annotated[Any, AfterValidator(_finite)]] = Field(init=False)

    def as_given(self) -> dict[str, Any]:
        """What was given, as it is, in the order in which it is written."""
        return {name: value for name, value in self if name in self.model_fields_set}

    def fields(self) -> dict[str, Any]:
        """The line as it is written: plain values, nothing that was not given."""
        return self.model_dump(exclude_unset=True)


Whole = Annotated[int, Field(ge=-LARGEST_WHOLE, le=LARGEST_WHOLE)]
"""An integer that tables can hold and add up."""

Amount = Annotated[float, Field(allow_inf_nan=False)]
"""A finite number."""


def encodable(text: str) -> str:
    """Text that UTF-8 can hold: lone surrogates, which a broken reply may have, become "?"."""
    return text.encode("utf-8", "replace").decode("utf-8")
