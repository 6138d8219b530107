"""Reading a run from disk: its manifest, and its records line by line."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

from phyblock.errors import Problem, StoreError

__all__ = ["MANIFEST", "RECORDS", "RecordLines", "read_manifest", "read_records"]

MANIFEST = "run.yaml"
RECORDS = "records.jsonl"
_HINT = "restore the file from a copy, or remove this line: its sample is then run again"


def read_manifest(folder: Path) -> dict[str, Any]:
    """The run's manifest; StoreError when there is none or it cannot be read."""
    path = folder / MANIFEST
    try:
        manifest = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError) as error:
        allowed = "a folder that phyblock run wrote"
        raise StoreError(Problem(str(folder), f"holds no {MANIFEST}", allowed=allowed)) from error
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise StoreError(Problem(str(path), f"cannot be read: {error}")) from error
    if not isinstance(manifest, dict) or "identity" not in manifest:
        raise StoreError(Problem(str(path), "is not a run manifest", "identity", "no such key"))
    return manifest


class RecordLines:
    """Every record of a folder with where it stands, one at a time, oldest first.

    An unfinished last line, which a kill leaves behind, ends the iteration: `is_cut` is then set.
    `whole_bytes` is the size of the lines passed so far. Any other line that is not a record is a
    StoreError naming file and line.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / RECORDS
        self.is_cut = False
        self.whole_bytes = 0

    def __iter__(self) -> Iterator[tuple[str, dict[str, Any]]]:
        try:
            with self.path.open("rb") as lines:
                for number, line in enumerate(lines, 1):
                    if not line.endswith(b"\n"):
                        self.is_cut = True
                        return
                    self.whole_bytes += len(line)
                    where = f"{self.path}:{number}"
                    yield where, _parse(where, line)
        except FileNotFoundError:
            return
        except OSError as error:
            problem = Problem(str(self.path), f"cannot be read: {error.strerror}")
            raise StoreError(problem) from error


def read_records(folder: Path) -> dict[str, dict[str, Any]]:
    """The newest record of every sample, by sample id, in order of first appearance."""
    return {record["sample"]: record for _, record in RecordLines(folder)}


def _parse(where: str, line: bytes) -> dict[str, Any]:
    try:
        record = json.loads(line)
    except ValueError as error:
        raise StoreError(Problem(where, f"is not a record: {error}", hint=_HINT)) from error
    if not isinstance(record, dict) or not isinstance(record.get("sample"), str):
        raise StoreError(Problem(where, "is not a record", "sample", hint=_HINT))
    return record
