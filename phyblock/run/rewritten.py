"""A run folder whose records were all made before: scored again, or taken elsewhere."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path

import yaml

from phyblock.files import atomic_write, writing
from phyblock.records import MANIFEST, RECORDS, Manifest, Record
from phyblock.run.folder import run_folder

__all__ = ["manifest_text", "records_text", "write_run"]


def write_run(folder: Path, manifest: Manifest, records: Iterable[Record]) -> None:
    """Write manifest and records of a run; raises StoreError where the disk refuses."""
    texts = {MANIFEST: manifest_text(manifest), RECORDS: records_text(records)}
    run_folder(folder).begin()
    with writing(folder):
        for name, text in texts.items():
            atomic_write(folder / name, text)


def manifest_text(manifest: Manifest) -> str:
    """`run.yaml`."""
    return yaml.safe_dump(manifest.fields(), sort_keys=False, allow_unicode=True, width=100)


def records_text(records: Iterable[Record]) -> str:
    """`records.jsonl`: the same text for the same records."""
    lines = (json.dumps(r.fields(), ensure_ascii=False, separators=(",", ":")) for r in records)
    return "".join(line + "\n" for line in lines)
