"""A run folder whose records were all made before: scored again, or taken elsewhere."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from pathlib import Path

from phyblock.config.yaml import dump_yaml
from phyblock.files import atomic_write, writing
from phyblock.records.files import RECORDS
from phyblock.records.manifest import MANIFEST, Manifest
from phyblock.records.record import Record
from phyblock.run.folder import run_folder

__all__ = ["manifest_text", "record_lines", "write_run"]


def write_run(folder: Path, manifest: Manifest, records: Iterable[Record]) -> None:
    """Write manifest and records of a run; raises StoreError where the disk refuses."""
    lines = (line.encode("utf-8", "replace") for line in record_lines(records))
    files: dict[str, str | Iterator[bytes]] = {RECORDS: lines, MANIFEST: manifest_text(manifest)}
    # Where a run is replaced, a kill between the two leaves one that has to be scored again.
    names = (RECORDS, MANIFEST) if (folder / MANIFEST).exists() else (MANIFEST, RECORDS)
    run_folder(folder).claim([])
    for name in names:
        with writing(folder / name):
            atomic_write(folder / name, files[name], sync=True)


def manifest_text(manifest: Manifest) -> str:
    """`run.yaml`."""
    return dump_yaml(manifest.fields())


def record_lines(records: Iterable[Record]) -> Iterator[str]:
    """`records.jsonl`, line by line: the same text for the same records."""
    for record in records:
        yield json.dumps(record.fields(), ensure_ascii=False, separators=(",", ":")) + "\n"
