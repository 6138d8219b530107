"""JSON Schemas of suites, models files, and the lines of runs and data, made from their models:
`python -m tests.documents [FOLDER]` writes benchmarks/schemas again.
"""

import json
import sys
from pathlib import Path
from typing import Any

from pydantic import BaseModel, TypeAdapter

ROOT = Path(__file__).parents[1]
SCHEMAS = ROOT / "benchmarks" / "schemas"
DRAFT = "https://json-schema.org/draft/2020-12/schema"


def write_schemas(folder: Path) -> None:
    """Write every schema; for a process that has imported none of the models."""
    # The docstring below a field describes it. It is read here alone: to read the source of every
    # model takes a tenth of a short command.
    BaseModel.model_config["use_attribute_docstrings"] = True
    from phyblock.config.models import ModelsFile
    from phyblock.config.suite import suite_model
    from phyblock.data.questions import StoredQuestion
    from phyblock.data.scenes import StoredScene
    from phyblock.records.files import Manifest, known_records
    from phyblock.records.record import BatchLine, Call, Prompt

    documents: dict[str, tuple[str, TypeAdapter[Any]]] = {
        "suite": ("suite", TypeAdapter(suite_model())),
        "models": ("models", TypeAdapter(ModelsFile)),
        "record": ("record", known_records()),
        "call": ("call", TypeAdapter(Call)),
        "prompt": ("prompt", TypeAdapter(Prompt)),
        "batch": ("batch", TypeAdapter(BatchLine)),
        "manifest": ("run.yaml", TypeAdapter(Manifest)),
        "scene": ("scene", TypeAdapter(StoredScene)),
        "question": ("question", TypeAdapter(StoredQuestion)),
    }
    for name, (title, adapter) in documents.items():
        made = {"$schema": DRAFT, **plain(adapter.json_schema()), "title": f"phyblock {title}"}
        text = json.dumps(made, indent=2, ensure_ascii=False) + "\n"
        (folder / f"{name}.schema.json").write_text(text, encoding="utf-8")


def plain(node: Any) -> Any:
    """Return a schema without the titles that pydantic makes out of names, each text on a line."""
    if isinstance(node, list):
        return [plain(item) for item in node]
    if not isinstance(node, dict):
        return node
    if isinstance(text := node.get("description"), str):
        node = {**node, "description": " ".join(text.split())}
    named = {key: plain(value) for key, value in node.items()}
    return {key: value for key, value in named.items() if key != "title" or isinstance(value, dict)}


if __name__ == "__main__":
    write_schemas(Path(sys.argv[1]) if len(sys.argv) > 1 else SCHEMAS)
