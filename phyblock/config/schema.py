"""JSON Schemas (draft 2020-12) of suites and models files, for editors."""

from __future__ import annotations

import inspect
import json
from pathlib import Path
from typing import Any

from phyblock.config.models import RECORDED, ModelConfig
from phyblock.config.suite import suite_model
from phyblock.registry import baseline_names, known_tracks

_NAME = r"^[A-Za-z0-9][A-Za-z0-9._:+-]{0,79}$"


def suite_schema() -> dict[str, Any]:
    """Return the schema of a suite file."""
    schema = suite_model().model_json_schema()
    properties, kinds = schema["properties"], known_tracks()
    properties["tracks"]["items"]["enum"] = list(kinds)
    said = (f"{kind.name}: {inspect.getdoc(kind)}" for kind in kinds.values())
    properties["tracks"]["description"] = " ".join(said)
    names = [{"enum": list(baseline_names())}, {"type": "string", "pattern": _NAME}]
    listed = next(branch for branch in properties["models"]["oneOf"] if "items" in branch)
    listed["items"] = {"anyOf": names}
    return _finished(schema, "phyblock suite")


def models_schema() -> dict[str, Any]:
    """Return the schema of a models file."""
    entry = ModelConfig.model_json_schema()
    for name, field in ModelConfig.model_fields.items():
        if field.exclude:
            del entry["properties"][name]
    entry["oneOf"] = [{"required": ["id"]}, {"required": ["replay"]}]
    schema = {
        "$defs": {**entry.pop("$defs"), "ModelConfig": entry},
        "type": ["object", "null"],
        "description": "Models by the name that suites use.",
        "propertyNames": {"pattern": _NAME, "not": {"enum": [*baseline_names(), RECORDED]}},
        "additionalProperties": {
            "anyOf": [entry["properties"]["id"], {"$ref": "#/$defs/ModelConfig"}]
        },
    }
    return _finished(schema, "phyblock models")


def write_schemas(folder: Path) -> list[Path]:
    """Write both schemas into `folder`; return the files."""
    files = []
    for name, schema in (("suite", suite_schema()), ("models", models_schema())):
        files.append(folder / f"{name}.schema.json")
        files[-1].write_text(render(schema), encoding="utf-8")
    return files


def render(schema: dict[str, Any]) -> str:
    """Return a schema as the committed file holds it."""
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"


def _finished(schema: dict[str, Any], title: str) -> dict[str, Any]:
    """Name the draft, and drop the titles that pydantic makes out of field names."""

    def plain(node: Any) -> Any:
        if isinstance(node, list):
            return [plain(item) for item in node]
        if not isinstance(node, dict):
            return node
        if isinstance(text := node.get("description"), str):
            node = {**node, "description": " ".join(text.split())}
        return {
            key: plain(value)
            for key, value in node.items()
            if not (key == "title" and isinstance(value, str))
        }

    draft = "https://json-schema.org/draft/2020-12/schema"
    return {"$schema": draft, "title": title, **plain(schema)}
