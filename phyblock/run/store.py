"""Writing a run: `run.yaml`, written first and never changed, and `records.jsonl`.

A record counts only when it is appended and synced, so a kill at any moment loses nothing that was
written; a line that a kill cut short is dropped when the run is opened again. A later record of a
sample replaces an earlier one.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import threading
from collections.abc import Iterable, Mapping
from io import FileIO
from pathlib import Path
from typing import IO, Any

import yaml

from phyblock.errors import Problem, StoreError
from phyblock.files import atomic_write
from phyblock.run.reading import MANIFEST, RECORDS, RecordLines, read_manifest

__all__ = ["RunStore", "holds_run"]

_LOCK = ".lock"
_NOT_IDENTITY = (
    "suite.description",
    "suite.limits",
    "suite.tables",
    "suite.dataset",
    "dataset.root",
)
"""Parts of a manifest that may change while the run stays the same, or that others repeat."""


class RunStore:
    """A run folder opened for writing; one process at a time."""

    def __init__(self, folder: Path, manifest: Mapping[str, Any]) -> None:
        """Open `folder` for the run that `manifest` describes, creating it when it is new.

        Raises StoreError when the folder cannot be written, holds records of another run (its
        identity differs), or is being written by another process.
        """
        self.folder = folder
        self._writing = threading.Lock()
        self._lock: IO[str] | None = None
        self._file: FileIO | None = None
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._lock = (folder / _LOCK).open("w")
            self._acquire()
            self._claim(manifest)
            # Unbuffered: a write that failed must not be tried again behind our back.
            self._file = FileIO(folder / RECORDS, "a")
            self._drop_cut_line()
        except OSError as error:
            self.close()
            hint = "choose another folder with --out"
            problem = Problem(str(folder), f"cannot be written: {error.strerror}", hint=hint)
            raise StoreError(problem) from error
        except StoreError:
            self.close()
            raise

    def __enter__(self) -> RunStore:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def append(self, records: Iterable[Mapping[str, Any]]) -> None:
        """Write records, a line each, and wait until they are on disk.

        Raises StoreError when the disk refuses; what was written before stays whole.
        """
        data = b"".join(_line(record) for record in records)
        with self._writing:
            self._append(data)

    def _append(self, data: bytes) -> None:
        assert self._file is not None, "the store is closed"
        size = self._file.seek(0, os.SEEK_END)
        try:
            written = 0
            while written < len(data):
                written += self._file.write(data[written:])
            os.fsync(self._file.fileno())
        except OSError as error:
            # Where even this fails, what is left is an unfinished line: the next start drops it.
            with contextlib.suppress(OSError):
                self._file.truncate(size)
            hint = "free some space and give the same command again: it goes on from here"
            path = self.folder / RECORDS
            problem = Problem(str(path), f"cannot be written: {error.strerror}", hint=hint)
            raise StoreError(problem) from error

    def close(self) -> None:
        """Release the files and the lock, once what is being written is written."""
        with self._writing:
            for handle in (self._file, self._lock):
                if handle is not None:
                    handle.close()
            self._file = self._lock = None

    def _acquire(self) -> None:
        assert self._lock is not None
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            hint = "wait for it to end, or choose another folder with --out"
            message = "is being written by another phyblock run"
            raise StoreError(Problem(str(self.folder), message, hint=hint)) from error

    def _claim(self, manifest: Mapping[str, Any]) -> None:
        if holds_run(self.folder, manifest):
            return
        path = self.folder / MANIFEST
        text = yaml.safe_dump(dict(manifest), sort_keys=False, allow_unicode=True, width=100)
        atomic_write(path, text)

    def _drop_cut_line(self) -> None:
        lines = RecordLines(self.folder)
        for _ in lines:
            pass
        assert self._file is not None
        if lines.is_cut:
            os.truncate(lines.path, lines.whole_bytes)
        elif lines.lacks_newline:
            self._file.write(b"\n")


def holds_run(folder: Path, manifest: Mapping[str, Any]) -> bool:
    """Whether `folder` holds the run that `manifest` describes; reads alone.

    Raises StoreError when it holds records of another run. A manifest without records is no run
    yet: one that failed at once leaves it behind, and nothing would be lost with it.
    """
    found = read_manifest(folder) if (folder / MANIFEST).exists() else None
    if found is not None and found["identity"] == manifest["identity"]:
        return True
    if next(iter(RecordLines(folder)), None) is None:
        return False
    changed = f"records, and no {MANIFEST}"
    if found is not None:
        names = _changed(found, manifest)
        changed = f"different: {', '.join(names) or 'how pictures are drawn'}"
    hint = "choose another folder with --out"
    raise StoreError(Problem(str(folder), "holds another run", found=changed, hint=hint))


def _line(record: Mapping[str, Any]) -> bytes:
    text = json.dumps(record, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return text.encode("utf-8", "replace") + b"\n"


def _changed(found: Mapping[str, Any], wanted: Mapping[str, Any]) -> list[str]:
    """Dotted names of the parts in which two manifests differ and that make them two runs."""
    names: list[str] = []
    for part in ("suite", "models", "dataset", "prompt", "limit"):
        old, new = found.get(part), wanted.get(part)
        if isinstance(old, dict) and isinstance(new, dict):
            keys = [key for key in new if f"{part}.{key}" not in _NOT_IDENTITY]
            names += [f"{part}.{key}" for key in keys if old.get(key) != new[key]]
        elif old != new:
            names.append(part)
    # Other scenes of the same data have another digest, too.
    chosen = {"suite.levels", "limit"} & set(names)
    return [name for name in names if not (chosen and name == "dataset.sha256")]
