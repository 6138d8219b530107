"""JSON Schemas of the lines of runs and data, made from their models.

    python -m tests.documents      write benchmarks/schemas again

The documentation makes its tables of fields from them; a test compares them with the models.
"""

from __future__ import annotations

import ast
import inspect
import json
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from phyblock.config.validation import models_in
from phyblock.data.questions import StoredQuestion
from phyblock.data.scenes import StoredScene
from phyblock.records.files import Manifest, known_records, record_types
from phyblock.records.record import BatchLine, Call, Line, Prompt

ROOT = Path(__file__).parents[1]
SCHEMAS = Path("benchmarks", "schemas")


def make_documents() -> dict[Path, str]:
    """Return every file with its content as it should be."""
    made: dict[Path, str] = {}
    lines: dict[str, tuple[str, TypeAdapter[Any], Sequence[type[Line]]]] = {
        "record": ("record", known_records(), record_types()),
        "call": ("call", TypeAdapter(Call), (Call,)),
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
            below = [one for f in kind.model_fields.values() for one in models_in(f.annotation)]
            waiting += [one for one in below if issubclass(one, Line)]
    return listed


def _docs(kind: type[Line]) -> dict[str, str]:
    """Return the docstring below each field of a model, in one line."""
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


if __name__ == "__main__":
    for written, text in make_documents().items():
        (ROOT / written).write_text(text, encoding="utf-8")
        print(written)
