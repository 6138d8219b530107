"""Documentation out of the models of lines: tables of their fields, and JSON Schemas."""

from __future__ import annotations

import ast
import inspect
import re
import textwrap
import types
import typing
from collections.abc import Mapping, Sequence
from typing import Any, Literal, get_args, get_origin

from pydantic import TypeAdapter

from phyblock.records.line import Line, parts

__all__ = ["field_tables", "json_schema", "put_between"]

_DRAFT = "https://json-schema.org/draft/2020-12/schema"
_BEGIN = "<!-- fields: begin -->"
_END = "<!-- fields: end -->"
_PLAIN: Mapping[object, str] = {
    str: "text",
    int: "integer",
    float: "number",
    bool: "true or false",
    type(None): "null",
    Any: "any",
}


def field_tables(title: str, kinds: Sequence[type[Line]], known: set[type[Line]]) -> str:
    """A section with a table for each model and for the parts in it that are not `known` yet.

    Of a model that extends one that is known, only what it adds or changes is shown.
    """
    lines = [f"## {title}"]
    waiting = list(kinds)
    while waiting:
        kind = waiting.pop(0)
        if kind in known:
            continue
        known.add(kind)
        lines += ["", f"### {_heading(kind)}", "", inspect.cleandoc(kind.__doc__ or "")]
        base = next((parent for parent in kind.__mro__[1:] if parent in known), Line)
        names = [name for name in kind.model_fields if name in inspect.get_annotations(kind)]
        docs = _docs(kind)
        if base is not Line:
            lines[-1] += f" It has the fields of {_name(base)}, and:"
        lines += ["", "| field | type | what |", "|---|---|---|"]
        hints = typing.get_type_hints(kind, include_extras=False)
        for name in names:
            lines.append(f"| `{name}` | {_type(hints[name])} | {docs.get(name, '')} |")
            waiting += parts(hints[name])
    return "\n".join(lines) + "\n"


def put_between(document: str, text: str) -> str:
    """A document with `text` between its markers, in the place of what stood there."""
    before, rest = document.split(_BEGIN)
    _, after = rest.split(_END)
    return f"{before}{_BEGIN}\n\n{text}\n{_END}{after}"


def json_schema(title: str, adapter: TypeAdapter[Any], kinds: Sequence[type[Line]]) -> Any:
    """The JSON Schema (draft 2020-12) of a line, with what `kinds` say of their fields."""
    schema = adapter.json_schema()
    by_name = {kind.__name__: kind for kind in _with_parts(kinds)}
    definitions = schema.get("$defs", {})
    for name, definition in {**definitions, schema.get("title", ""): schema}.items():
        if name in by_name:
            _describe(definition, by_name[name])
    return {"$schema": _DRAFT, **schema, "title": title}


def _describe(schema: dict[str, Any], kind: type[Line]) -> None:
    for parent in reversed(kind.__mro__):
        if issubclass(parent, Line):
            for name, text in _docs(parent).items():
                schema["properties"][name]["description"] = text
    for described in schema["properties"].values():
        described.pop("title", None)


def _with_parts(kinds: Sequence[type[Line]]) -> list[type[Line]]:
    listed: list[type[Line]] = []
    waiting = list(kinds)
    while waiting:
        kind = waiting.pop(0)
        if kind not in listed:
            listed.append(kind)
            hints = typing.get_type_hints(kind)
            for name in kind.model_fields:
                waiting += parts(hints[name])
    return listed


def _docs(kind: type[Line]) -> dict[str, str]:
    """What stands below each field of a model, in one line."""
    (tree,) = ast.parse(textwrap.dedent(inspect.getsource(kind))).body
    assert isinstance(tree, ast.ClassDef)
    docs: dict[str, str] = {}
    for field, below in zip(tree.body, tree.body[1:], strict=False):
        if (
            isinstance(field, ast.AnnAssign)
            and isinstance(field.target, ast.Name)
            and field.target.id in kind.model_fields
            and isinstance(below, ast.Expr)
            and isinstance(below.value, ast.Constant)
        ):
            docs[field.target.id] = " ".join(str(below.value.value).split())
    return docs


def _type(hint: Any) -> str:
    if hint in _PLAIN:
        return _PLAIN[hint]
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is Literal:
        return ", ".join("true" if word is True else f"`{word}`" for word in arguments)
    if origin in (types.UnionType, typing.Union):
        return " or ".join(_type(argument) for argument in arguments)
    if origin is tuple:
        if ... not in arguments:
            return f"list of {_inside(arguments[0])}, {len(arguments)} of them"
        return f"list of {_inside(arguments[0])}"
    if origin is dict:
        return f"object of {_inside(arguments[1])}"
    return _name(hint)


def _inside(hint: Any) -> str:
    text = _type(hint)
    is_choice = hint is not bool and (" or " in text or ", " in text)
    return f"({text})" if is_choice else text


def _name(kind: type) -> str:
    heading = _heading(kind)
    return f"[{heading}](#{heading.lower().replace(' ', '-')})"


def _heading(kind: type) -> str:
    words = re.findall(r"[A-Z][a-z]+", kind.__name__.removeprefix("Stored"))
    return " ".join([words[0], *(word.lower() for word in words[1:])])
