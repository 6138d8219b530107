"""JSON Schemas (draft 2020-12) of suites and models files, for editors."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from phyblock.config.models import RECORDED, ModelConfig
from phyblock.config.suite import suite_model
from phyblock.registry import baseline_names, known_tracks, table_names

_DRAFT = "https://json-schema.org/draft/2020-12/schema"
_NAME = r"^[A-Za-z0-9][A-Za-z0-9._:+-]{0,79}$"


def suite_schema() -> dict[str, Any]:
    """The schema of a suite file."""
    schema = suite_model().model_json_schema()
    properties = schema["properties"]
    kinds = known_tracks()
    properties["tracks"]["items"]["enum"] = list(kinds)
    properties["tracks"]["description"] = " ".join(f"{k.name}: {k.about}." for k in kinds.values())
    properties["tables"]["items"]["enum"] = list(table_names())
    names = {"enum": list(baseline_names())}, {"type": "string", "pattern": _NAME}
    for branch in schema["properties"]["models"]["oneOf"]:
        if "items" in branch:
            branch["items"] = {"anyOf": list(names)}
    return _finish(schema, "phyblock suite")


def models_schema() -> dict[str, Any]:
    """The schema of a models file."""
    spec = ModelConfig.model_json_schema()
    definitions = spec.pop("$defs")
    for hidden in ("name", "most_body_bytes"):
        del spec["properties"][hidden]
    spec["oneOf"] = [{"required": ["id"]}, {"required": ["replay"]}]
    one = {"type": "string", "pattern": r"^[A-Za-z0-9_.-]+/\S+$",
           "description": "litellm id with its provider: openai/gpt-4o-2024-08-06."}  # fmt: skip
    schema = {
        "$defs": {**definitions, "ModelConfig": spec},
        "type": ["object", "null"],
        "description": "Models by the name that suites use.",
        "propertyNames": {"pattern": _NAME, "not": {"enum": [*baseline_names(), RECORDED]}},
        "additionalProperties": {"anyOf": [one, {"$ref": "#/$defs/ModelConfig"}]},
    }
    return _finish(schema, "phyblock models")


def write_schemas(folder: Path) -> list[Path]:
    """Write both schemas into `folder`; returns the files."""
    files = []
    for name, schema in (("suite", suite_schema()), ("models", models_schema())):
        path = folder / f"{name}.schema.json"
        path.write_text(render(schema), encoding="utf-8")
        files.append(path)
    return files


def render(schema: dict[str, Any]) -> str:
    """A schema as the committed file holds it."""
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"


def _finish(schema: dict[str, Any], title: str) -> dict[str, Any]:
    """Name the draft and drop the titles that pydantic makes out of field names."""
    bare = _without_titles(schema)
    return {"$schema": _DRAFT, "title": title, **bare}


def _without_titles(node: Any) -> Any:
    if isinstance(node, dict):
        return {
            key: _without_titles(value)
            for key, value in node.items()
            if not (key == "title" and isinstance(value, str))
        }
    return [_without_titles(item) for item in node] if isinstance(node, list) else node
