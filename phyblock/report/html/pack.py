"""Data as scripts: a page that was opened from disk may load scripts, but not fetch files.

A script calls `phyblockTake(build, name, text)` with its data as JSON text. Text it stays until
the page parses it, so nothing that a model said is ever read as code.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path

__all__ = ["Pack", "to_json", "write_script", "write_taken"]

_CHUNK_CHARACTERS = 300_000


class Pack:
    """Entries of one kind in numbered scripts, written as they fill.

    `starts` holds the number of the first entry of every script. `write` puts JSON text into the
    script of a folder, name and build; a script has about `most` characters of it.
    """

    def __init__(
        self,
        folder: Path,
        kind: str,
        build: str,
        write: Callable[[Path, str, str, str], None] | None = None,
        most: int = _CHUNK_CHARACTERS,
    ) -> None:
        self.starts: list[int] = []
        self._write, self._most = write or write_taken, most
        self._folder = folder
        self._kind = kind
        self._build = build
        self._entries: list[str] = []
        self._size = 0
        self._count = 0

    def add(self, entry: object) -> int:
        """Append an entry and say its number; raises OSError where the disk refuses."""
        text = to_json(entry)
        if self._entries and self._size + len(text) > self._most:
            self._flush()
        self._entries.append(text)
        self._size += len(text)
        self._count += 1
        return self._count - 1

    def close(self) -> None:
        """Write what is left."""
        if self._entries:
            self._flush()

    def _flush(self) -> None:
        name = f"{self._kind}-{len(self.starts)}"
        self._write(self._folder, name, self._build, f"[{','.join(self._entries)}]")
        self.starts.append(self._count - len(self._entries))
        self._entries, self._size = [], 0


def write_script(folder: Path, name: str, build: str, data: Mapping[str, object]) -> None:
    """Write one object as the script `<name>.js`; raises OSError where the disk refuses."""
    write_taken(folder, name, build, to_json(data))


def to_json(data: object) -> str:
    """Data as a script has them; ValueError for a number that JSON has not."""
    # ASCII: a page from disk has no header that tells an encoding, and lone surrogates survive.
    return json.dumps(data, ensure_ascii=True, separators=(",", ":"), allow_nan=False)


def write_taken(folder: Path, name: str, build: str, text: str) -> None:
    """Write the script `<name>.js` that hands `text`, in ASCII, to the page; OSError as above."""
    quoted = text.replace("\\", "\\\\").replace("'", "\\'")
    script = f"phyblockTake('{build}','{name}','{quoted}')\n"
    (folder / f"{name}.js").write_text(script, encoding="ascii")
