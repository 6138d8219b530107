"""Data as packed scripts: a page that was opened from disk may load scripts, but not fetch files.

A script calls `phyblockSite(build, name, packed)`; what is packed is JSON, deflated, in base 64. It
is read as data alone, so that nothing a model said is ever read as code.
"""

from __future__ import annotations

import base64
import zlib
from pathlib import Path
from typing import Any

from phyblock.report.html.pack import Pack, to_json

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
    script = f"phyblockSite('{build}','{name}','{packed}')\n"
    (folder / f"{name}.js").write_text(script, encoding="ascii")
