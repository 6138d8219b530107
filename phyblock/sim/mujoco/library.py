"""The door to MuJoCo: loaded late, and silent."""

from __future__ import annotations

import functools
import importlib.metadata
from types import ModuleType
from typing import cast

__all__ = ["load", "version"]


@functools.cache
def version() -> str:
    """Version of the installed MuJoCo, without importing it; some builds are not in two parts."""
    try:
        return importlib.metadata.version("mujoco-core")
    except importlib.metadata.PackageNotFoundError:
        return importlib.metadata.version("mujoco")


@functools.cache
def load() -> ModuleType:
    """The `mujoco` module; what it warns of is looked up after each step, not in a log file."""
    import mujoco

    mujoco.set_mju_user_warning(_ignore)
    return cast(ModuleType, mujoco)


def _ignore(_message: str) -> None:
    """Keep MuJoCo from writing MUJOCO_LOG.TXT into the working folder."""
