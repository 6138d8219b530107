"""The digest of all that tables, figures and the page of a run are made from."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Sequence
from pathlib import Path

from phyblock.files import NotRegularError, open_regular
from phyblock.records.files import PROMPTS, RECORDS, STOPPED
from phyblock.records.manifest import MANIFEST, read_manifest
from phyblock.resources import cache_dir
from phyblock.run.code import code_digest, digest_of, state_of
from phyblock.tables.design import read_design
from phyblock.tracks.kind import kinds

__all__ = ["digest_of_file", "inputs_digest"]

_VARIABLES = "PHYBLOCK_"
_CHUNK_BYTES = 2**20


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
    data = [state_of(Path(root)) for root in roots]
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
    return digest_of([code, list(tables), held, roots, data, place])


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
