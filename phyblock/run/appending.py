"""A file of JSON lines that is only ever appended to."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterable, Mapping
from io import FileIO
from pathlib import Path
from typing import Any

from phyblock.files import append_whole, sync_folder, writing

__all__ = ["AppendFile"]

_HINT = "free some space and give the same command again: it goes on from here"


class AppendFile:
    """Lines that are on disk when `append` returns; safe to call from several threads.

    The file is made with the first line.
    """

    def __init__(self, path: Path, *, sync: bool = True) -> None:
        """Without `sync` lines survive the death of the process, not that of the machine."""
        self._path = path
        self._sync = sync
        self._writing = threading.Lock()
        self._file: FileIO | None = None

    def append(self, lines: Iterable[Mapping[str, Any]]) -> None:
        """Write objects, a line each, and wait until they are on disk.

        Raises StoreError when the disk refuses; what was written before stays whole.
        """
        data = b"".join(_line(line) for line in lines)
        with self._writing:
            self._append(data)

    def end_line(self) -> None:
        """Write the newline that the last line lacks."""
        with FileIO(self._path, "a") as file:
            file.write(b"\n")

    def close(self) -> None:
        """Close the file, once what is being written is written."""
        with self._writing:
            if self._file is not None:
                self._file.close()
                self._file = None

    def _append(self, data: bytes) -> None:
        with writing(self._path, _HINT):
            if self._file is None:
                # Unbuffered: a write that failed must not be tried again behind our back.
                self._file = FileIO(self._path, "a")
                if self._sync:
                    sync_folder(self._path.parent)
            append_whole(self._file.fileno(), data, sync=self._sync)


def _line(line: Mapping[str, Any]) -> bytes:
    text = json.dumps(line, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return text.encode("utf-8", "replace") + b"\n"
