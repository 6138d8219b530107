"""Reading a run from disk: its manifest, and its records line by line."""

from __future__ import annotations

import json
from collections.abc import Container, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from types import NoneType
from typing import Any, ClassVar

import yaml

from phyblock.errors import Problem, StoreError

__all__ = [
    "MANIFEST",
    "RECORDS",
    "TURNS",
    "Lines",
    "RecordLines",
    "TurnLines",
    "read_manifest",
    "read_records",
    "read_turns",
]

MANIFEST = "run.yaml"
RECORDS = "records.jsonl"
TURNS = "turns.jsonl"
_MANIFEST_HINT = "run.yaml is written by `phyblock run` and never edited: restore it from a copy"

_Fields = Mapping[str, Any]
"""Types of fields by name; a mapping in the place of a type is an object or null."""
_COUNT = (int, NoneType)
_REPLY: _Fields = {
    "text": str,
    "usage": {"prompt_tokens": _COUNT, "completion_tokens": _COUNT},
    "cost_usd": (int, float, NoneType),
    "cached": bool,
}
_RECORD: _Fields = {
    **dict.fromkeys(("sample", "track", "model", "scene", "outcome"), str),
    **{"seed": int, "n_blocks": int, "levels": list, "scores": list},
    **{"reply": _REPLY, "error": {"kind": str}},
}
_TURN: _Fields = {"sample": str, "turn": int, "reply": _REPLY}
_SCORE: _Fields = {"criterion": str, "setting": str, "tp": int, "fp": int, "fn": int}


def read_manifest(folder: Path) -> dict[str, Any]:
    """The run's manifest; StoreError when there is none or it cannot be read."""
    path = folder / MANIFEST
    try:
        manifest = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError) as error:
        allowed = "a folder that phyblock run wrote"
        raise StoreError(Problem(str(folder), f"holds no {MANIFEST}", allowed=allowed)) from error
    except OSError as error:
        raise StoreError(Problem(str(path), f"cannot be read: {error.strerror}")) from error
    except (UnicodeDecodeError, yaml.YAMLError) as error:
        mark = getattr(error, "problem_mark", None)
        where = f"{path}:{mark.line + 1}:{mark.column + 1}" if mark else str(path)
        raise StoreError(Problem(where, "is not YAML", hint=_MANIFEST_HINT)) from error
    if not isinstance(manifest, dict) or "identity" not in manifest:
        problem = Problem(str(path), "is not a run manifest", "identity", "no such key")
        raise StoreError(replace(problem, hint=_MANIFEST_HINT))
    return manifest


class Lines:
    """Every object of a file of JSON lines with where it stands, one at a time, oldest first.

    A last line without its newline counts all the same when it is whole; else, as a kill
    leaves it behind, it ends the iteration: `is_cut` is then set. `lacks_newline` says that the
    last one needs one. `whole_bytes` is the size of the lines passed so far. Any other line
    that is not what the file holds is a StoreError naming file and line.
    """

    file = ""
    noun = ""
    hint = ""
    fields: ClassVar[_Fields] = {}

    def __init__(self, folder: Path) -> None:
        self.path = folder / self.file
        self.is_cut = False
        self.lacks_newline = False
        self.whole_bytes = 0

    def __iter__(self) -> Iterator[tuple[str, dict[str, Any]]]:
        try:
            with self.path.open("rb") as lines:
                for number, line in enumerate(lines, 1):
                    where = f"{self.path}:{number}"
                    self.lacks_newline = not line.endswith(b"\n")
                    if self.lacks_newline and not _is_json(line):
                        self.is_cut = True
                        return
                    found = self._parse(where, line)
                    self.whole_bytes += len(line)
                    yield where, found
        except FileNotFoundError:
            return
        except OSError as error:
            problem = Problem(str(self.path), f"cannot be read: {error.strerror}")
            raise StoreError(problem) from error

    def check(self, found: object) -> str | None:
        """Dotted name of the first field that is missing or of the wrong type, or None."""
        return _first_wrong(found, self.fields)

    def _parse(self, where: str, line: bytes) -> dict[str, Any]:
        is_not = f"is not a {self.noun}"
        try:
            found = json.loads(line)
        except json.JSONDecodeError as error:
            where = f"{where}:{error.colno}"
            raise StoreError(Problem(where, f"{is_not}: {error.msg}", hint=self.hint)) from error
        except UnicodeDecodeError as error:
            raise StoreError(Problem(where, f"{is_not}: not UTF-8", hint=self.hint)) from error
        wrong = self.check(found)
        if wrong is not None:
            message = f"{is_not}: missing or of the wrong type"
            raise StoreError(Problem(where, message, wrong, hint=self.hint))
        return dict(found)


class RecordLines(Lines):
    """The records of a run folder."""

    file = RECORDS
    noun = "record"
    hint = "restore the file from a copy, or remove this line: its sample is then run again"
    fields: ClassVar[_Fields] = _RECORD

    def check(self, found: object) -> str | None:
        """As of any line, and of every score."""
        wrong = super().check(found)
        if wrong is not None:
            return wrong
        assert isinstance(found, dict)
        scores = found["scores"]
        below = ((i, _first_wrong(score, _SCORE)) for i, score in enumerate(scores))
        return next((f"scores[{i}].{n}".rstrip(".") for i, n in below if n is not None), None)


class TurnLines(Lines):
    """The answered turns of a run folder's episodes, finished or not."""

    file = TURNS
    noun = "turn"
    hint = (
        "restore the file from a copy, or remove this line and those of the same sample below it: "
        "these turns are then asked again"
    )
    fields: ClassVar[_Fields] = _TURN


def read_records(folder: Path) -> dict[str, dict[str, Any]]:
    """The newest record of every sample, by sample id, in order of first appearance."""
    return {record["sample"]: record for _, record in RecordLines(folder)}


def read_turns(folder: Path, without: Container[str] = ()) -> dict[str, list[dict[str, Any]]]:
    """The replies of every episode that has begun, by sample id, in the order of its turns.

    Samples `without` are left out. Raises StoreError where a turn is missing.
    """
    found: dict[str, dict[int, dict[str, Any]]] = {}
    for where, line in TurnLines(folder):
        if line["sample"] in without:
            continue
        turns = found.setdefault(line["sample"], {})
        if line["turn"] > len(turns):
            message = f"is turn {line['turn']} of a sample of which {len(turns)} turns are there"
            raise StoreError(Problem(where, message, "turn", hint=TurnLines.hint))
        turns[line["turn"]] = line["reply"]
    return {sample: [turns[n] for n in sorted(turns)] for sample, turns in found.items()}


def _is_json(line: bytes) -> bool:
    try:
        json.loads(line)
    except ValueError:
        return False
    return True


def _first_wrong(found: object, wanted: _Fields) -> str | None:
    """Dotted name of the first field that is not there or of another type, or None."""
    if not isinstance(found, dict):
        return ""
    for name, kind in wanted.items():
        value = found.get(name, ...)
        if isinstance(kind, dict):
            below = None if value is None else _first_wrong(value, kind)
        else:
            below = None if isinstance(value, kind) else ""
        if below is not None:
            return f"{name}.{below}".rstrip(".")
    return None
