"""Data as packed scripts: a page that was opened from disk may load scripts, but not fetch files.

A script hands its text to the page as those of a run's report do; here the text is JSON, deflated,
in base 64.
"""

from __future__ import annotations

import base64
import zlib
from pathlib import Path
from typing import Any

from phyblock.report.html.pack import Pack, to_json, write_taken

__all__ = ["chunks", "write_chunk"]

_CHARACTERS = 400_000
_LEVEL = 9


def chunks(folder: Path, kind: str, build: str) -> Pack:
    """Entries of one kind in numbered packed scripts."""
    return Pack(folder, kind, build, _write, _CHARACTERS)


def write_chunk(folder: Path, name: str, build: str, data: Any) -> None:
    """Write one value as the script `<name>.js`; raises OSError where the disk refuses."""
    _write(folder, name, build, to_json(data))


def _write(folder: Path, name: str, build: str, text: str) -> None:
    packed = base64.b64encode(zlib.compress(text.encode("ascii"), _LEVEL)).decode("ascii")
    write_taken(folder, name, build, packed)
