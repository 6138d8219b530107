"""The door to PyBullet: loaded late, quietly, one in-process client for each user."""

from __future__ import annotations

import contextlib
import functools
import importlib.metadata
import os
from collections.abc import Iterator
from types import ModuleType
from typing import cast

from phyblock.errors import SimulationError

__all__ = ["client", "load", "version"]


@functools.cache
def version() -> str:
    """Version of the installed PyBullet, without importing it."""
    return importlib.metadata.version("pybullet")


@functools.cache
def load() -> ModuleType:
    """The `pybullet` module; its C code's build banner is kept off standard error."""
    with _quiet_stderr():
        import pybullet
    return cast(ModuleType, pybullet)


@contextlib.contextmanager
def client() -> Iterator[tuple[ModuleType, int]]:
    """The module and the id of a fresh DIRECT client, closed on leaving.

    Raises SimulationError when PyBullet has no client left to give.
    """
    bullet = load()
    number = bullet.connect(bullet.DIRECT)
    if number < 0:
        raise SimulationError("PyBullet gave no client: too many are open in this process")
    try:
        yield bullet, number
    finally:
        bullet.disconnect(number)


@contextlib.contextmanager
def _quiet_stderr() -> Iterator[None]:
    """Send what C code writes to file descriptor 2 to the null device."""
    kept = os.dup(2)
    null = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(null)
