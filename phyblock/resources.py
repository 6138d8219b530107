"""The suites, prompts, data sets and models file that come with the project; caches; extras."""

from __future__ import annotations

import importlib
import os
from pathlib import Path

from phyblock.errors import Problem, SpecError

_PACKAGE = Path(__file__).parent


def bundled(*parts: str) -> Path:
    """Return a path inside what comes with the project: `benchmarks/`, `prompts/` or `models.yaml`.

    In an installed wheel they lie in the package, in a checkout beside it.
    """
    inside = _PACKAGE / "bundled"
    return (inside if inside.is_dir() else _PACKAGE.parent).joinpath(*parts)


def bundled_sets(file: str) -> list[str]:
    """Return the names of the bundled data sets that hold a file of this name, sorted."""
    return sorted(path.parent.name for path in bundled("benchmarks", "data").glob(f"*/{file}"))


def cache_dir() -> Path:
    """Return the user's cache folder: `$PHYBLOCK_CACHE`, else the platform's place for caches."""
    named = os.environ.get("PHYBLOCK_CACHE")
    if named:
        return Path(named).expanduser()
    return Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "phyblock"


def reply_cache_file() -> Path:
    """Return the reply cache that all runs of this user share."""
    return cache_dir() / "replies.sqlite"


def needs(package: str, extra: str, form: str) -> None:
    """Raise SpecError that names the extra to install where a format's package is not there."""
    try:
        importlib.import_module(package)
    except ImportError as error:
        name, hint = package.partition(".")[0], f"pip install 'phyblock[{extra}]'"
        raise SpecError(Problem(f"--to {form}", f"needs the package {name}", hint=hint)) from error
