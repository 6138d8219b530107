"""The JSON that a reply can be asked to be: an object whose last key holds the answer."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

REASONING = "reasoning"  # Key before that of the answer, under which a model may think first.
_MOST_OBJECTS = 128  # Objects that are tried, from the end: a plan with poses has one a step.
_DECODER = json.JSONDecoder(strict=False)
MeaningT = TypeVar("MeaningT")


@dataclass(frozen=True)
class AnswerForm(Generic[MeaningT]):
    """A form of answers, in keywords of JSON schema that all providers know.

    `key` holds the answer, `value` is the schema of what stands there, `meaning` reads it and
    returns None for what is no answer. `example_value` shows the form with letters in the place of
    an answer, so that it is none itself.
    """

    key: str
    value: Mapping[str, Any]
    meaning: Callable[[Any], MeaningT | None]
    example_value: str
    reasons: bool = True

    @property
    def schema(self) -> dict[str, Any]:
        """The JSON schema of the whole object."""
        first = {REASONING: {"type": "string"}} if self.reasons else {}
        properties = {**first, self.key: dict(self.value)}
        return {
            "type": "object",
            "properties": properties,
            "required": list(properties),
            "additionalProperties": False,
        }

    @property
    def response_format(self) -> dict[str, Any]:
        """The field `response_format` of the OpenAI chat protocol."""
        asked = {"name": self.key, "schema": self.schema, "strict": True}
        return {"type": "json_schema", "json_schema": asked}

    @property
    def example(self) -> str:
        """The form as prompts show it."""
        first = f'"{REASONING}": "...", ' if self.reasons else ""
        return f'{{{first}"{self.key}": {self.example_value}}}'

    def write(self, value: Any, reasoning: str = "") -> str:
        """Return the reply that gives a value in the form."""
        first = {REASONING: reasoning} if self.reasons else {}
        return json.dumps({**first, self.key: value}, ensure_ascii=False)

    def read(self, answer: str) -> MeaningT | None:
        """Return the answer of the last JSON object that holds one, wherever it stands, or None."""
        starts = [brace.start() for brace in re.finditer(r"\{", answer)]
        for start in reversed(starts[-_MOST_OBJECTS:]):
            try:
                found, _ = _DECODER.raw_decode(answer, start)
            except (ValueError, RecursionError):
                continue
            meaning = self.meaning(found[self.key]) if self.key in found else None
            if meaning is not None:
                return meaning
        return None


def whole_number(value: object) -> int | None:
    """Return a JSON value that is a whole number of at most six digits, also as text, or None."""
    if isinstance(value, str) and re.fullmatch(r"\s{0,9}-?[0-9]{1,6}\s{0,9}", value):
        return int(value)
    if isinstance(value, bool) or not isinstance(value, int):
        return None
    return value if abs(value) < 10**6 else None
