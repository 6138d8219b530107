"""What floors reach, kept in the cache folder: runs of the same scenes need the same values.

Working them out takes half a second and more, most of it before anything can be asked.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import TypeAdapter

from phyblock.config.suite import Suite
from phyblock.data import Dataset
from phyblock.files import atomic_write, read_bytes
from phyblock.records import Manifest
from phyblock.resources import learned_dir
from phyblock.run.code import code_digest, digest_of
from phyblock.run.floor_orders import floor_orders, shows_seeds
from phyblock.tracks import AnyTrack

if TYPE_CHECKING:
    from phyblock.run.floors import FloorValues

__all__ = ["kept_floors"]

_IDLE_IN_SUITE = {"name", "description", "models", "seeds", "limits", "limit", "tables"}
"""Fields that decide no value, where any other does; seeds do where each shows candidates in
another order, and a limit stands in the manifest.
"""
_IDLE_IN_MANIFEST: Mapping[str, bool | set[str]] = {
    **dict.fromkeys(("identity", "created", "suite", "models", "floors", "versions"), True),
    "dataset": {"root"},
    "questions": {"root"},
}
"""The same of a manifest, in parts where only those decide nothing; the suite is digested by
itself, versions with the code.
"""
_VALUES = TypeAdapter(dict[str, dict[str, dict[str, float]]])


def kept_floors(
    manifest: Manifest,
    suite: Suite,
    reopened: Callable[[str, Suite], AnyTrack],
    dataset: Dataset,
) -> FloorValues:
    """What `floor_values` gives, from the cache folder where the same was worked out before.

    `dataset` is the whole one, which floors learn from. A folder that cannot be read or written, or
    a file that is not whole, costs only the time; so do tracks and measures from outside.
    """
    key = _key(manifest, suite, dataset)
    path = learned_dir() / f"{key}.json"
    if key is not None and (kept := _read(path)) is not None:
        return kept
    # Values are worked out in frames of pandas, which a run else does without until it ends.
    from phyblock.run.floors import floor_values

    values = floor_values(manifest, suite, reopened)
    if key is not None:
        with contextlib.suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            atomic_write(path, _VALUES.dump_json(values).decode())
    return values


def _key(manifest: Manifest, suite: Suite, dataset: Dataset) -> str | None:
    """Digest of all that decides the values; None where that cannot be told."""
    code = code_digest()
    if code is None:
        return None
    orders = [
        (one.candidates.order, copies, list(one.seeds) if shows_seeds(one) else [])
        for one, copies in floor_orders(suite)
    ]
    asked = manifest.model_dump(mode="json", exclude=_IDLE_IN_MANIFEST)
    asks = suite.model_dump(mode="json", exclude=_IDLE_IN_SUITE)
    return digest_of(["floors", code, dataset.sha256, asked, asks, orders])


def _read(path: Path) -> FloorValues | None:
    """The values in a file; None where there is none that holds some."""
    try:
        return _VALUES.validate_json(read_bytes(path))
    except (OSError, ValueError):
        return None
