"""The digest of all that tables, figures and the page of a run are made from."""

from __future__ import annotations

import hashlib
import json
import os
import platform
from collections.abc import Iterator, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from phyblock.bounded import NotRegularError, open_regular
from phyblock.records import MANIFEST, PROMPTS, RECORDS, STOPPED, read_manifest
from phyblock.registry import has_additions
from phyblock.resources import cache_dir
from phyblock.tables.design import read_design
from phyblock.tracks.kind import kinds

__all__ = ["code_digest", "digest_of_file", "inputs_digest"]

_LIBRARIES = ("phyblock", "numpy", "pandas", "scipy", "matplotlib", "jinja2", "pydantic", "pillow")
_VARIABLES = "PHYBLOCK_"
_CHUNK_BYTES = 2**20
_MOST_FILES = 100_000


def code_digest() -> str | None:
    """What stands for the code that makes tables, figures and the page.

    None where tracks or measures were added from outside: their code cannot be told.
    """
    if has_additions():
        return None
    package = Path(__file__).parents[1]
    state = _state(package)
    if state is None:
        return None
    return _digest([platform.python_version(), *map(_version, _LIBRARIES), str(package), *state])


def inputs_digest(folder: Path, tables: Sequence[str] | None) -> str | None:
    """What stands for all that `tables`, the figures and the page of a run are made from; None
    is the tables that the suite in `run.yaml` asks for.

    That is the code, what the run holds, its name, the data that it was made on and where pictures
    are kept. None where it cannot be told. Raises StoreError for a folder that is no run.
    """
    code = code_digest()
    manifest = read_manifest(folder)
    roots = [manifest.dataset.root] if manifest.dataset else []
    roots += [root for kind in kinds().values() if (root := kind.own_root(manifest))]
    data = [_state(Path(root)) for root in roots]
    if code is None or None in data:
        return None
    try:
        held = [digest_of_file(folder / name) for name in (MANIFEST, RECORDS, PROMPTS, STOPPED)]
    except (OSError, NotRegularError):
        return None
    variables = sorted(f"{k}={v}" for k, v in os.environ.items() if k.startswith(_VARIABLES))
    place = [folder.name, str(cache_dir()), *variables]
    if tables is None:
        tables = read_design(manifest.fields(), str(folder / MANIFEST)).suite.tables
    return _digest([code, list(tables), held, roots, data, place])


def digest_of_file(path: Path) -> str:
    """Its SHA-256; empty where there is no such file. Raises OSError, or NotRegularError."""
    digest = hashlib.sha256()
    try:
        with open_regular(path) as file:
            while chunk := file.read(_CHUNK_BYTES):
                digest.update(chunk)
    except FileNotFoundError:
        return ""
    return digest.hexdigest()


def _digest(parts: Sequence[object]) -> str:
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


def _state(folder: Path) -> list[tuple[str, int, int]] | None:
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
