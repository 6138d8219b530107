"""Digests of the code that computes something from a run."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Iterator, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from phyblock.registry import has_additions
from phyblock.stable import hex_digest

__all__ = ["code_digest", "digest_of", "state_of"]

_LIBRARIES = ("phyblock", "numpy", "pandas", "scipy", "matplotlib", "jinja2", "pydantic", "pillow")
_MOST_FILES = 100_000


def code_digest() -> str | None:
    """Return a digest of the code that judges records, and makes tables, figures and the page.

    None where tracks or measures were added from outside: their code cannot be told.
    """
    if has_additions():
        return None
    package = Path(__file__).parents[1]
    state = state_of(package)
    if state is None:
        return None
    return digest_of([platform.python_version(), *map(_version, _LIBRARIES), str(package), *state])


def digest_of(parts: Sequence[object]) -> str:
    """The SHA-256 [hex] of values that JSON knows."""
    return hex_digest(json.dumps(parts))


def state_of(folder: Path) -> list[tuple[str, int, int]] | None:
    """Name, size and time of change of every file below; None where there are too many."""
    found: list[tuple[str, int, int]] = []
    for entry in _files(folder):
        if len(found) == _MOST_FILES:
            return None
        stat = os.stat(entry)
        found.append((entry, stat.st_size, stat.st_mtime_ns))
    return sorted(found)


def _files(folder: Path) -> Iterator[str]:
    for above, folders, names in os.walk(folder):
        folders[:] = [name for name in folders if name != "__pycache__"]
        yield from (path for name in names if os.path.isfile(path := os.path.join(above, name)))


def _version(library: str) -> str:
    try:
        return version(library)
    except PackageNotFoundError:
        return ""
