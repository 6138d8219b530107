"""The JSON that a reply can be asked to be, and the exact reading of it.

A form is an object whose last key holds the answer, behind a key `reasoning` where a model may
think first. Only what stands under the key of the answer is read, and only where it can mean one
thing: a number with a fraction, a key that stands twice or an object that is cut off is a named
problem, never a shorter answer. A reply without such an object is not judged here.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Generic, Literal, NoReturn, TypeVar

from phyblock.parsing.json_values import LONGEST_NUMBER, Fields, objects
from phyblock.parsing.text_forms import answer_of

__all__ = ["EXACT_RULE", "KEY_RULE", "AnswerForm", "FormProblem", "FormReading"]

FormProblem = Literal["broken_json", "wrong_json", "several_json"]
"""Why the JSON of a reply holds no answer: it is not whole, something else stands under the key, or
several objects differ.
"""

EXACT_RULE = "json_schema"
"""The reply is the JSON that was asked for, and nothing else."""
KEY_RULE = "json_key"
"""The answer stands under its key, beside other keys or text, or written a little otherwise."""

REASONING = "reasoning"
_FENCED = re.compile(r"```(?:json[5c]?)?[ \t]*\n(?P<held>.*)\n[ \t]*```", re.DOTALL | re.IGNORECASE)

MeaningT = TypeVar("MeaningT")


@dataclass(frozen=True)
class FormReading(Generic[MeaningT]):
    """What the JSON of a reply says: an answer and the rule that it was read by, or a problem."""

    answer: MeaningT | None
    rule: str | None = None
    problem: FormProblem | None = None


@dataclass(frozen=True)
class AnswerForm(Generic[MeaningT]):
    """A form of answers.

    `key` holds the answer, `value` is the JSON schema of what stands there, `meaning` says what
    that is, None for what is no answer. `example` shows the form with letters in the place of an
    answer, so that it is none itself. With `reasons` the key `reasoning` comes first. Schemas use
    no more than `type`, `enum`, `items`, `properties`, `required` and `additionalProperties`, which
    all providers know.
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
        """The reply that gives a value in the form."""
        first = {REASONING: reasoning} if self.reasons else {}
        return json.dumps({**first, self.key: value}, ensure_ascii=False)

    def read(self, text: str) -> FormReading[MeaningT] | None:
        """What the JSON of a reply says; None where it holds none with the key of the answer."""
        answer = answer_of(text)
        for reply in (text, answer or ""):
            for is_bare, held in _held(reply.strip()):
                if (whole := _decoded(held)) is not None:
                    return self._of_whole(whole[0], is_bare=is_bare)
        if text.lstrip().startswith("{") and not (answer or "").lstrip().startswith("{"):
            # What looks like the end of thoughts stands in it, and it is not whole.
            return FormReading(None, None, "broken_json")
        return self._within(answer or "")

    def _of_whole(self, value: Any, *, is_bare: bool) -> FormReading[MeaningT] | None:
        if not self._has_key(value):
            return None if _is_plain(value) else FormReading(None, None, "wrong_json")
        found = self._answer(value)
        if found is None:
            return FormReading(None, None, "wrong_json")
        return FormReading(found, EXACT_RULE if is_bare and self._follows(value) else KEY_RULE)

    def _within(self, answer: str) -> FormReading[MeaningT] | None:
        """The reading of the objects in a text."""
        pieces = list(objects(answer)) if "{" in answer else []
        keyed = [(end, value) for _, end, value in pieces if self._has_key(value)]
        rest, at = "", keyed[-1][0] if keyed else 0
        for start, end, _ in (piece for piece in pieces if piece[0] >= at):
            rest, at = rest + answer[at:start], end
        # A key that opens an object which is not among them.
        begun = rf"[{{,]\s*[\"'](?:{self.key}|{REASONING})[\"']\s*:"
        if re.search(begun, rest + answer[at:]):
            return FormReading(None, None, "broken_json")
        if not keyed:
            return None
        read = [self._answer(value) for _, value in keyed]
        if read[-1] is None:
            return FormReading(None, None, "wrong_json")
        if any(one not in (None, read[-1]) for one in read):
            return FormReading(None, None, "several_json")
        return FormReading(read[-1], KEY_RULE)

    def _has_key(self, value: Any) -> bool:
        return isinstance(value, Fields) and any(key == self.key for key, _ in value)

    def _answer(self, fields: Fields) -> MeaningT | None:
        under = [value for key, value in fields if key == self.key]
        return self.meaning(under[0]) if len(under) == 1 else None

    def _follows(self, fields: Fields) -> bool:
        """Whether an object, of which the answer could be read, follows the schema."""
        found = dict(fields)
        has_all = len(found) == len(fields) and set(found) == set(self.schema["properties"])
        return (
            has_all
            and isinstance(found.get(REASONING, ""), str)
            and _follows(found[self.key], self.value)
        )


def _held(reply: str) -> Iterator[tuple[bool, str]]:
    """A reply as it is, and what it holds where it is one block of code."""
    yield True, reply
    if fenced := _FENCED.fullmatch(reply):
        yield False, fenced["held"]


def _decoded(text: str) -> tuple[Any] | None:
    """The JSON value that a text is, in a tuple; None where it is none."""
    if text[:1] not in ("{", "[", '"', "-") and not text[:1].isdigit():
        return None
    try:
        return (json.loads(text, object_pairs_hook=Fields, parse_constant=_refuse),)
    except (ValueError, RecursionError):
        return None


def _refuse(name: str) -> NoReturn:
    raise ValueError(f"{name} is no JSON")


def _is_plain(value: Any) -> bool:
    """Whether a value holds nothing but texts and block numbers, under keys that differ."""
    if isinstance(value, Fields):
        keys = [key for key, _ in value]
        return len(set(keys)) == len(keys) and all(_is_plain(item) for _, item in value)
    if isinstance(value, list):
        return all(_is_plain(item) for item in value)
    return isinstance(value, str) or _is_number(value)


def _is_number(value: Any) -> bool:
    return type(value) is int and len(str(abs(value))) <= LONGEST_NUMBER


def _follows(value: Any, schema: Mapping[str, Any]) -> bool:
    """Whether a value follows a schema of lists, objects, single choices and numbers."""
    if schema["type"] == "array":
        return isinstance(value, list) and all(_follows(item, schema["items"]) for item in value)
    if schema["type"] == "object":
        found = dict(value) if isinstance(value, Fields) else {}
        parts = schema["properties"]
        return set(found) == set(parts) and all(_follows(found[key], parts[key]) for key in parts)
    if "enum" in schema:
        return any(type(value) is type(choice) and value == choice for choice in schema["enum"])
    return type(value) in (int, float)
