"""Seasons: a set that nobody can choose or know in advance, and that anyone can make again.

A maker publishes the digests of a secret and of the code, then waits for a value that nobody
controls, such as that of a beacon. The seed of the set is a digest of the secret and the value.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field

import phyblock
from phyblock.data.lookup import find_data_set
from phyblock.data.scenes import SCENES_FILE
from phyblock.errors import DataError, Problem
from phyblock.files import bundled_sets
from phyblock.records.record import Line
from phyblock.sim.engine import described_engine
from phyblock.text import hex_digest

_Digest = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]


class Commitment(Line, extra="forbid"):
    """Everything that is fixed before a season; to be published."""

    secret_sha256: _Digest
    code_sha256: _Digest
    engine: str
    arguments: str
    """Arguments of `phyblock scenes generate`, except seed and folder."""
    public: str
    """The later public value to use, in words."""


def code_digest() -> str:
    """Return the digest of the package's own files and the built-in scenes, with their names."""
    root = Path(phyblock.__file__).parent
    files = (path for path in root.rglob("*") if path.suffix in (".py", ".md", ".yaml"))
    named = sorted((path.relative_to(root).as_posix(), path) for path in files)
    named = [(name, path) for name, path in named if not name.startswith("bundled/")]
    named += [(name, find_data_set(name) / SCENES_FILE) for name in bundled_sets(SCENES_FILE)]
    return hex_digest("".join(f"{hex_digest(path.read_bytes())} {name}\n" for name, path in named))


def season_seed(commitment: Commitment, secret: str, public: str, where: str) -> int:
    """Return the seed of a season. Raises DataError for another secret, code or engine."""
    meant = (
        ("secret_sha256", commitment.secret_sha256, hex_digest(secret)),
        ("code_sha256", commitment.code_sha256, code_digest()),
        ("engine", commitment.engine, described_engine()),
    )
    problems = [
        Problem(where, "is not what was committed to", field, found, committed)
        for field, committed, found in meant
        if found != committed
    ]
    if problems:
        raise DataError(problems)
    return int(hex_digest(f"{secret}\n{public}")[:16], 16)
