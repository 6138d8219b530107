"""What docs/ and benchmarks/schemas say of lines of runs and data, made from their models.

    python -m tests.documents      write the tables of fields and the JSON Schemas again

Tables stand between markers in pages of docs/; a test compares both with the models.
"""

from __future__ import annotations

import ast
import inspect
import json
import re
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from phyblock.data.questions import StoredQuestion
from phyblock.data.scenes import StoredScene
from phyblock.records.files import known_records, record_types
from phyblock.records.line import Line, parts
from phyblock.records.manifest import Manifest
from phyblock.records.record import BatchLine, Prompt, Record, Stopped, Turn

ROOT = Path(__file__).parents[1]
SCHEMAS = Path("benchmarks", "schemas")
BEGIN, END = "<!-- fields: begin -->", "<!-- fields: end -->"
NAMES = {"string": "text", "boolean": "true or false", "array": "list"}


def pages() -> Mapping[str, Mapping[str, Sequence[type[Line]]]]:
    """By page of docs/ and title, the models whose fields it lists."""
    return {
        "results.md": {
            "A record": (Record,),
            "What the tracks add": record_types(),
            "A turn": (Turn,),
            "A prompt": (Prompt,),
            "A batch": (BatchLine,),
            "What stopped a run": (Stopped,),
            "The manifest": (Manifest,),
        },
        "data-format.md": {"A line of `scenes.jsonl`": (StoredScene,)},
        "vqa.md": {"A line of `questions.jsonl`": (StoredQuestion,)},
    }


def make_documents() -> dict[Path, str]:
    """Return every file with its content as it should be."""
    made: dict[Path, str] = {}
    for name, sections in pages().items():
        path = Path("docs", name)
        known: list[type[Line]] = []
        tables = [_section(title, kinds, known) for title, kinds in sections.items()]
        before, rest = (ROOT / path).read_text(encoding="utf-8").split(BEGIN)
        after = rest.split(END)[1]
        text = "\n".join(tables)
        made[path] = f"{before}{BEGIN}\n\n{text}\n{END}{after}"
    lines: dict[str, tuple[str, TypeAdapter[Any], Sequence[type[Line]]]] = {
        "record": ("record", known_records(), record_types()),
        "turn": ("turn", TypeAdapter(Turn), (Turn,)),
        "prompt": ("prompt", TypeAdapter(Prompt), (Prompt,)),
        "batch": ("batch", TypeAdapter(BatchLine), (BatchLine,)),
        "manifest": ("run.yaml", TypeAdapter(Manifest), (Manifest,)),
        "scene": ("scene", TypeAdapter(StoredScene), (StoredScene,)),
        "question": ("question", TypeAdapter(StoredQuestion), (StoredQuestion,)),
    }
    for name, (title, adapter, kinds) in lines.items():
        text = json.dumps(_schema(title, adapter, kinds), indent=2, ensure_ascii=False) + "\n"
        made[SCHEMAS / f"{name}.schema.json"] = text
    return made


def _schema(title: str, adapter: TypeAdapter[Any], kinds: Sequence[type[Line]]) -> dict[str, Any]:
    schema = adapter.json_schema()
    known = {kind.__name__: kind for kind in _with_parts(kinds)}
    for name, part in {**schema.get("$defs", {}), schema.get("title", ""): schema}.items():
        if name in known:
            for field, described in part["properties"].items():
                described.pop("title", None)
                described["description"] = _docs(known[name])[field]
    draft = "https://json-schema.org/draft/2020-12/schema"
    return {"$schema": draft, **schema, "title": f"phyblock {title}"}


def _with_parts(kinds: Sequence[type[Line]]) -> list[type[Line]]:
    listed, waiting = [], list(kinds)
    while waiting:
        kind = waiting.pop(0)
        if kind not in listed:
            listed.append(kind)
            waiting += [part for f in kind.model_fields.values() for part in parts(f.annotation)]
    return listed


def _docs(kind: type[Line]) -> dict[str, str]:
    """What stands below each field of a model, in one line."""
    docs: dict[str, str] = {}
    for parent in reversed([one for one in kind.__mro__ if issubclass(one, Line)]):
        try:
            (tree,) = ast.parse(textwrap.dedent(inspect.getsource(parent))).body
        except OSError:
            continue  # A track that adds nothing has a model that stands in no file.
        assert isinstance(tree, ast.ClassDef)
        for field, below in zip(tree.body, tree.body[1:], strict=False):
            if isinstance(field, ast.AnnAssign) and isinstance(below, ast.Expr):
                assert isinstance(field.target, ast.Name)
                docs[field.target.id] = " ".join(ast.literal_eval(below.value).split())
    return docs


def _section(title: str, kinds: Sequence[type[Line]], known: list[type[Line]]) -> str:
    """A table for each model and for the parts in it that are not known yet.

    Of a model that extends one that is known, only what it adds or changes is shown.
    """
    lines = [f"## {title}"]
    for kind in _with_parts(kinds):
        if kind in known:
            continue
        known.append(kind)
        lines += ["", f"### {_heading(kind.__name__)}", "", inspect.cleandoc(kind.__doc__ or "")]
        base = next((parent for parent in kind.__mro__[1:] if parent in known), Line)
        if base is not Line:
            lines[-1] += f" It has the fields of {_link(base.__name__)}, and:"
        lines += ["", "| field | type | what |", "|---|---|---|"]
        docs, own = _docs(kind), inspect.get_annotations(kind)
        for name, field in kind.model_json_schema()["properties"].items():
            if name in own:
                lines.append(f"| `{name}` | {_type(field)} | {docs.get(name, '')} |")
    return "\n".join(lines) + "\n"


def _type(schema: Mapping[str, Any]) -> str:
    """The type of a field in words."""
    if "$ref" in schema:
        return _link(schema["$ref"].rpartition("/")[2])
    if "const" in schema or "enum" in schema:
        values = schema.get("enum", [schema.get("const")])
        return ", ".join(f"`{one}`" if isinstance(one, str) else json.dumps(one) for one in values)
    if choices := schema.get("anyOf", schema.get("oneOf")):
        return " or ".join(_type(one) for one in choices)
    if inner := schema.get("items", schema.get("additionalProperties")):
        text = _type(inner) if isinstance(inner, dict) else "any"
        text = f"({text})" if text != "true or false" and re.search(" or |, ", text) else text
        return f"{'list' if schema['type'] == 'array' else 'object'} of {text}"
    if "prefixItems" in schema:
        items = schema["prefixItems"]
        return f"list of {_type(items[0])}, {len(items)} of them"
    return NAMES.get(schema.get("type", "any"), schema.get("type", "any"))


def _link(name: str) -> str:
    heading = _heading(name)
    return f"[{heading}](#{heading.lower().replace(' ', '-')})"


def _heading(name: str) -> str:
    words = re.findall(r"[A-Z][a-z]+", name.removeprefix("Stored"))
    return " ".join([words[0], *(word.lower() for word in words[1:])])


if __name__ == "__main__":
    for written, text in make_documents().items():
        (ROOT / written).write_text(text, encoding="utf-8")
        print(written)
