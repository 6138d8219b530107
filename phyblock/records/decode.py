"""Decoding one line: fast where it is sound, and with the reason where it is not."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from pydantic import TypeAdapter, ValidationError

from phyblock.errors import Problem
from phyblock.files import load_json
from phyblock.records.line import encodable

__all__ = ["decode", "dotted", "is_cut", "problem_of", "shown"]

_LONGEST_SHOWN = 60
_PLAIN: Mapping[str, str] = {"missing": "missing", "extra_forbidden": "has no such field"}
_ENCODER = json.JSONEncoder(ensure_ascii=False, default=lambda value: type(value).__name__)


def decode(adapter: TypeAdapter[Any], line: bytes) -> Any:
    """Read a line by its model, in bounds and without changing the type of anything.

    Raises ValueError with what was wrong with it: a JSONDecodeError for broken syntax, pydantic's
    ValidationError for fields, any other with a text that can be shown. Lone surrogates, which no
    output could hold, become "?".
    """
    try:
        return adapter.validate_json(line, strict=True)
    except ValidationError:
        value = load_json(line.decode("utf-8"))
    return adapter.validate_json(json.dumps(_clean(value)), strict=True)


def is_cut(line: bytes) -> bool:
    """Whether a line is no JSON, as one that a kill cut short; one out of bounds is whole."""
    try:
        json.loads(line)
    except (json.JSONDecodeError, UnicodeDecodeError):
        return True
    except (ValueError, RecursionError):
        return False
    return False


def problem_of(error: Any, where: str, is_not: str, hint: str) -> Problem:
    """What pydantic found, in our words."""
    field = dotted(error["loc"])
    if error["type"] in _PLAIN:
        return Problem(where, f"{is_not}: {_PLAIN[error['type']]}", field, hint=hint)
    allowed = _ALLOWED.get(error["type"], _expected)(error.get("ctx") or {}, error["msg"])
    found = shown(error["input"])
    message = f"{is_not}: of the wrong type or out of range"
    return Problem(where, message, field, found, allowed, hint)


def dotted(place: Sequence[int | str]) -> str:
    """A place as people write it: `blocks[1].depend`; its empty parts are choices of a model."""
    text = ""
    for part in place:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if part else ""
    return text.lstrip(".")


def shown(value: object) -> str:
    """A value as JSON as far as it is shown, whatever it is."""
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


def _expected(_: Mapping[str, Any], message: str) -> str:
    """What pydantic asks for, without its preamble."""
    return message.removeprefix("Input should be ").removeprefix("Value error, ")


_ALLOWED: Mapping[str, Callable[[Mapping[str, Any], str], str]] = {
    "literal_error": lambda context, _: str(context["expected"]),
    "model_type": lambda *_: "an object",
    "string_pattern_mismatch": lambda context, _: f"a text of the form {context['pattern']}",
}


def _clean(value: Any) -> Any:
    """A decoded value whose texts UTF-8 can hold."""
    if isinstance(value, str):
        return encodable(value)
    if isinstance(value, list):
        return [_clean(below) for below in value]
    if isinstance(value, dict):
        return {encodable(name): _clean(below) for name, below in value.items()}
    return value
