"""Data as packed scripts: a page that was opened from disk may load scripts, but not fetch files.

A script calls `phyblockSite(build, name, packed)`; what is packed is JSON, deflated, in base 64. It
is read as data alone, so that nothing a model said is ever read as code.
"""

from __future__ import annotations

import base64
import json
import zlib
from pathlib import Path
from typing import Any

__all__ = ["Chunks", "write_chunk"]

_CHARACTERS = 400_000
_LEVEL = 9


class Chunks:
    """Entries of one kind in numbered scripts, written as they fill; `starts` holds the number of
    the first entry of each.
    """

    def __init__(self, folder: Path, kind: str, build: str) -> None:
        self.starts: list[int] = []
        self._folder, self._kind, self._build = folder, kind, build
        self._entries: list[str] = []
        self._size = self._count = 0

    def add(self, entry: object) -> int:
        """Append an entry and say its number; raises OSError where the disk refuses."""
        text = _json(entry)
        if self._entries and self._size + len(text) > _CHARACTERS:
            self.close()
        self._entries.append(text)
        self._size += len(text)
        self._count += 1
        return self._count - 1

    def close(self) -> None:
        """Write what is left."""
        if self._entries:
            name = f"{self._kind}-{len(self.starts)}"
            _write(self._folder, name, self._build, f"[{','.join(self._entries)}]")
            self.starts.append(self._count - len(self._entries))
            self._entries, self._size = [], 0


def write_chunk(folder: Path, name: str, build: str, data: Any) -> None:
    """Write one value as the script `<name>.js`; raises OSError where the disk refuses."""
    _write(folder, name, build, _json(data))


def _json(data: object) -> str:
    # ASCII: lone surrogates survive.
    return json.dumps(data, ensure_ascii=True, separators=(",", ":"), allow_nan=False)


def _write(folder: Path, name: str, build: str, text: str) -> None:
    packed = base64.b64encode(zlib.compress(text.encode("ascii"), _LEVEL)).decode("ascii")
    script = f"phyblockSite('{build}','{name}','{packed}')\n"
    (folder / f"{name}.js").write_text(script, encoding="ascii")
