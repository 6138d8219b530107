"""JSON Schemas of the lines of runs and data, made from their models.

    python -m tests.documents      write benchmarks/schemas again

The documentation makes its tables of fields from them; a test compares them with the models.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from phyblock.config.__main__ import field_docs, with_parts
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
    known = {kind.__name__: kind for kind in with_parts(kinds)}
    for name, part in {**schema.get("$defs", {}), schema.get("title", ""): schema}.items():
        if name in known:
            for field, described in part["properties"].items():
                described.pop("title", None)
                described["description"] = field_docs(known[name])[field]
    draft = "https://json-schema.org/draft/2020-12/schema"
    return {"$schema": draft, **schema, "title": f"phyblock {title}"}


if __name__ == "__main__":
    for written, text in make_documents().items():
        (ROOT / written).write_text(text, encoding="utf-8")
        print(written)
