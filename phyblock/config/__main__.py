"""`python -m phyblock.config [FOLDER]`: rewrite the JSON Schemas from the models."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from phyblock.config.models import ModelsFile
from phyblock.config.suite import suite_model


def make_schemas() -> dict[str, str]:
    """Return the text of each schema by the name of its file."""
    models: dict[str, type[BaseModel]] = {"suite": suite_model(), "models": ModelsFile}
    texts = {}
    for name, model in models.items():
        draft = "https://json-schema.org/draft/2020-12/schema"
        schema = {
            "$schema": draft,
            **_plain(model.model_json_schema()),
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
