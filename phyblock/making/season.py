"""Seasons: a set that nobody can choose or know in advance, and that anyone can make again.

A maker publishes the digests of a secret and of the code, then waits for a value that nobody
controls, such as that of a beacon. The seed of the set is a digest of the secret and the value.
"""

from __future__ import annotations

import secrets
from pathlib import Path
from typing import Annotated

from pydantic import Field, TypeAdapter

import phyblock
from phyblock.data.base import read_data
from phyblock.data.lookup import find_data_set
from phyblock.data.scenes import SCENES_FILE
from phyblock.errors import DataError, Problem
from phyblock.files import atomic_write, bundled_sets, check_free, make_folder, writing
from phyblock.records.record import Line, decode
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

    @classmethod
    def now(cls, secret: str, arguments: str, public: str) -> Commitment:
        """Return the commitment to a secret with today's code and engine."""
        return cls(
            secret_sha256=hex_digest(secret),
            code_sha256=code_digest(),
            engine=described_engine(),
            arguments=arguments,
            public=public,
        )


def commit(folder: Path, arguments: str, public: str) -> tuple[Path, Path]:
    """Write a new secret and the commitment to it, and return the two files."""
    files = (folder / "secret.txt", folder / "commitment.json")
    check_free(files, "give another --out")
    secret = secrets.token_hex(32)
    commitment = Commitment.now(secret, arguments, public)
    make_folder(folder)
    with writing(folder):
        atomic_write(files[0], f"{secret}\n")
        files[0].chmod(0o600)
        atomic_write(files[1], f"{commitment.as_json()}\n")
    return files


def reveal(commitment: Path, secret: Path, public: str) -> tuple[str, int]:
    """Return the arguments and the seed of a season whose public value is known.

    Raises DataError for a secret, code or engine other than the one committed to.
    """
    where = str(commitment)
    committed = decode(TypeAdapter(Commitment), read_data(commitment), where, Commitment)
    revealed = read_data(secret).decode("ascii", "replace").strip()
    found = Commitment.now(revealed, committed.arguments, committed.public)
    problems = [
        Problem(where, "is not what was committed to", field, getattr(found, field), meant)
        for field, meant in committed
        if getattr(found, field) != meant
    ]
    if problems:
        raise DataError(problems)
    return committed.arguments, int(hex_digest(f"{revealed}\n{public}")[:16], 16)


def code_digest() -> str:
    """Return the digest of the package's own files and the built-in scenes, with their names."""
    root = Path(phyblock.__file__).parent
    files = (path for path in root.rglob("*") if path.suffix in (".py", ".md", ".yaml"))
    named = sorted((path.relative_to(root).as_posix(), path) for path in files)
    named = [(name, path) for name, path in named if not name.startswith("bundled/")]
    named += [(name, find_data_set(name) / SCENES_FILE) for name in bundled_sets(SCENES_FILE)]
    return hex_digest("".join(f"{hex_digest(path.read_bytes())} {name}\n" for name, path in named))
