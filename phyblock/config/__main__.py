"""`python -m phyblock.config [FOLDER]`: rewrite the JSON Schemas from the models.

What stands below a field of a model describes it. It is looked up here alone: to read the source of
every model takes a tenth of a short command.
"""

from __future__ import annotations

import ast
import inspect
import json
import sys
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from phyblock.config.models import ModelsFile
from phyblock.config.suite import suite_model
from phyblock.config.validation import models_in


def make_schemas() -> dict[str, str]:
    """Return the text of each schema by the name of its file."""
    models: dict[str, type[BaseModel]] = {"suite": suite_model(), "models": ModelsFile}
    texts = {}
    for name, model in models.items():
        draft = "https://json-schema.org/draft/2020-12/schema"
        schema = {
            "$schema": draft,
            **_plain(_described(model.model_json_schema(), model)),
            "title": f"phyblock {name}",
        }
        texts[f"{name}.schema.json"] = json.dumps(schema, indent=2, ensure_ascii=False) + "\n"
    return texts


def write_schemas(folder: Path) -> list[Path]:
    """Write both schemas into `folder`; return the files."""
    texts = make_schemas()
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    return [folder / name for name in texts]


def field_docs(kind: type[BaseModel]) -> dict[str, str]:
    """Return the docstring below each field of a model, in one line."""
    docs: dict[str, str] = {}
    for parent in reversed([one for one in kind.__mro__ if issubclass(one, BaseModel)]):
        try:
            (tree,) = ast.parse(textwrap.dedent(inspect.getsource(parent))).body
        except OSError:
            continue  # A model that is composed stands in no file.
        assert isinstance(tree, ast.ClassDef)
        for field, below in zip(tree.body, tree.body[1:], strict=False):
            if isinstance(field, ast.AnnAssign) and isinstance(below, ast.Expr):
                assert isinstance(field.target, ast.Name)
                docs[field.target.id] = " ".join(ast.literal_eval(below.value).split())
    return docs


def with_parts(kinds: Sequence[type[BaseModel]]) -> list[type[BaseModel]]:
    """Return models with those that their fields are made of."""
    listed, waiting = [], list(kinds)
    while waiting:
        kind = waiting.pop(0)
        if kind not in listed:
            listed.append(kind)
            fields = kind.model_fields.values()
            waiting += [one for field in fields for one in models_in(field.annotation)]
    return listed


def _described(schema: dict[str, Any], model: type[BaseModel]) -> dict[str, Any]:
    """Return a schema with the docstrings of fields that have no description."""
    kinds = {kind.__name__: kind for kind in with_parts([model])}
    for name, part in {**schema.get("$defs", {}), model.__name__: schema}.items():
        kind, properties = kinds.get(name, BaseModel), part.get("properties", {})
        docs = field_docs(kind)
        for field, known in kind.model_fields.items():
            key = known.alias or field
            # What a section says of itself is not said again.
            own = known.annotation.__doc__ if isinstance(known.annotation, type) else None
            if key in properties and docs.get(field, own) != own:
                told = {"description": docs[field], **properties[key]}
                properties[key] = dict(sorted(told.items()))
    return schema


def _plain(node: Any) -> Any:
    """Return a schema without the titles that pydantic makes out of names, each text on a line."""
    if isinstance(node, list):
        return [_plain(item) for item in node]
    if not isinstance(node, dict):
        return node
    if isinstance(text := node.get("description"), str):
        node = {**node, "description": " ".join(text.split())}
    return {
        key: _plain(value)
        for key, value in node.items()
        if not (key == "title" and isinstance(value, str))
    }


if __name__ == "__main__":
    beside = Path(__file__).parents[2] / "benchmarks" / "schemas"
    for written in write_schemas(Path(sys.argv[1]) if len(sys.argv) > 1 else beside):
        sys.stdout.write(f"{written}\n")
