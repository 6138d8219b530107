"""What the documentation says of lines of runs and data: made from the models that read them."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from phyblock.records import (
    BatchLine,
    Line,
    Manifest,
    Prompt,
    Record,
    Stopped,
    StoredQuestion,
    StoredScene,
    Turn,
)
from phyblock.records.describe import field_tables, json_schema, put_between
from phyblock.records.known import known_records, record_types

__all__ = ["make_documents", "write_documents"]

_SECTIONS: Mapping[str, Mapping[str, Callable[[], Sequence[type[Line]]]]] = {
    "results.md": {
        "A record": lambda: (Record,),
        "What the tracks add": record_types,
        "A turn": lambda: (Turn,),
        "A prompt": lambda: (Prompt,),
        "A batch": lambda: (BatchLine,),
        "What stopped a run": lambda: (Stopped,),
        "The manifest": lambda: (Manifest,),
    },
    "data-format.md": {"A line of `scenes.jsonl`": lambda: (StoredScene,)},
    "vqa.md": {"A line of `questions.jsonl`": lambda: (StoredQuestion,)},
}
"""By page of docs/ and title, the models whose fields it lists."""
_SCHEMAS = Path("benchmarks") / "schemas"


def make_documents(root: Path) -> dict[Path, str]:
    """Every file with its content as it should be; pages are read from the checkout `root`."""
    made: dict[Path, str] = {}
    for name, sections in _SECTIONS.items():
        path = Path("docs", name)
        known: set[type[Line]] = set()
        tables = [field_tables(title, kinds(), known) for title, kinds in sections.items()]
        made[path] = put_between((root / path).read_text(encoding="utf-8"), "\n".join(tables))
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
        "batch": json_schema("phyblock batch", TypeAdapter(BatchLine), (BatchLine,)),
        "manifest": json_schema("phyblock run.yaml", TypeAdapter(Manifest), (Manifest,)),
        "scene": json_schema("phyblock scene", TypeAdapter(StoredScene), (StoredScene,)),
        "question": json_schema(
            "phyblock question", TypeAdapter(StoredQuestion), (StoredQuestion,)
        ),
    }
