"""What the documentation says of the files of a run: made from the models that read them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from phyblock.records import Line, Manifest, Prompt, Record, Turn
from phyblock.records.describe import field_tables, json_schema, put_between
from phyblock.records.known import known_records, record_types

__all__ = ["make_documents", "write_documents"]

_PAGE = Path("docs") / "results.md"
_SCHEMAS = Path("benchmarks") / "schemas"


def make_documents(root: Path) -> dict[Path, str]:
    """Every file with its content as it should be; the page is read from the checkout `root`."""
    known: set[type[Line]] = set()
    tables = [
        field_tables("A record", (Record,), known),
        field_tables("What the tracks add", record_types(), known),
        field_tables("A turn", (Turn,), known),
        field_tables("A prompt", (Prompt,), known),
        field_tables("The manifest", (Manifest,), known),
    ]
    page = (root / _PAGE).read_text(encoding="utf-8")
    made = {_PAGE: put_between(page, "\n".join(tables))}
    for name, schema in _schemas().items():
        text = json.dumps(schema, indent=2, ensure_ascii=False) + "\n"
        made[_SCHEMAS / f"{name}.schema.json"] = text
    return made


def write_documents(root: Path) -> list[Path]:
    """Write them into the checkout `root`; returns the files."""
    made = make_documents(root)
    for path, text in made.items():
        (root / path).write_text(text, encoding="utf-8")
    return [root / path for path in made]


def _schemas() -> dict[str, Any]:
    return {
        "record": json_schema("phyblock record", known_records(), record_types()),
        "turn": json_schema("phyblock turn", TypeAdapter(Turn), (Turn,)),
        "prompt": json_schema("phyblock prompt", TypeAdapter(Prompt), (Prompt,)),
        "manifest": json_schema("phyblock run.yaml", TypeAdapter(Manifest), (Manifest,)),
    }
