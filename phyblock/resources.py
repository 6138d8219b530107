"""Where the suites, prompts, data sets and models file that come with the project are."""

from __future__ import annotations

import os
from pathlib import Path

__all__ = ["bundled", "bundled_sets", "cache_dir", "learned_dir", "reply_cache_file"]

_PACKAGE = Path(__file__).parent


def bundled(*parts: str) -> Path:
    """A path inside what comes with the project: `benchmarks/`, `prompts/` or `models.yaml`.

    In an installed wheel they lie in the package, in a checkout beside it.
    """
    inside = _PACKAGE / "bundled"
    return (inside if inside.is_dir() else _PACKAGE.parent).joinpath(*parts)


def bundled_sets(file: str) -> list[str]:
    """Names of the bundled data sets that hold a file of this name, sorted."""
    return sorted(path.parent.name for path in bundled("benchmarks", "data").glob(f"*/{file}"))


def cache_dir() -> Path:
    """The user's cache folder: `$PHYBLOCK_CACHE`, else the platform's place for caches."""
    named = os.environ.get("PHYBLOCK_CACHE")
    if named:
        return Path(named).expanduser()
    return Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "phyblock"


def learned_dir() -> Path:
    """Where plans that floors learned and what floors reach are kept, `DIGEST.json` each: they cost
    time alone.
    """
    return cache_dir() / "goal-blind"


def reply_cache_file() -> Path:
    """The reply cache that all runs of this user share."""
    return cache_dir() / "replies.sqlite"
