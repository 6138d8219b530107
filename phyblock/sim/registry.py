"""The names of all physics engines and renderers, and which of them are used.

`PHYBLOCK_PHYSICS` and `PHYBLOCK_RENDERER` choose by name; processes that are started inherit the
choice. Unless one is chosen, blocks are let go in PyBullet where it is installed, in MuJoCo
elsewhere. Either may also be `module:factory`, for an implementation that is not part of phyblock.
Nothing is imported before it is chosen.
"""

from __future__ import annotations

import functools
import importlib
import os
from collections.abc import Mapping
from importlib.util import find_spec
from typing import NamedTuple

from phyblock.errors import InputError, PhyblockError, Problem
from phyblock.sim.engine import PhysicsEngine
from phyblock.sim.renderer import Renderer

__all__ = [
    "ENGINES",
    "PHYSICS_VARIABLE",
    "REFERENCE_ENGINE",
    "RENDERERS",
    "KnownSimulator",
    "installed",
    "installed_engines",
    "other_simulators",
    "physics_engine",
    "renderer",
    "told_engine",
]

PHYSICS_VARIABLE = "PHYBLOCK_PHYSICS"
REFERENCE_ENGINE = "pybullet"
"""The engine that the built-in data were made with, and what is meant where none is named."""
_RENDERER_VARIABLE = "PHYBLOCK_RENDERER"
_DEFAULT_RENDERER = "raster"


class KnownSimulator(NamedTuple):
    """Where the factory of an engine or renderer is, the module of its library, the
    distribution that brings it, and where that can be had.
    """

    path: str
    library: str
    distribution: str
    hint: str


ENGINES: Mapping[str, KnownSimulator] = {
    REFERENCE_ENGINE: KnownSimulator(
        "phyblock.sim.bullet.physics:BulletEngine",
        "pybullet",
        "pybullet",
        "PyBullet has wheels for Python 3.10 and 3.11 on Linux, x86-64",
    ),
    "mujoco": KnownSimulator(
        "phyblock.sim.mujoco.physics:MujocoEngine",
        "mujoco",
        "mujoco-core",
        "pip install 'phyblock[mujoco]', for Python 3.11 and newer",
    ),
}
"""The physics engines, the one that is taken first where several are installed before others."""
RENDERERS: Mapping[str, KnownSimulator] = {
    _DEFAULT_RENDERER: KnownSimulator(
        "phyblock.sim.raster.renderer:NumpyRenderer", "numpy", "numpy", "pip install numpy"
    ),
}


def installed_engines() -> tuple[str, ...]:
    """Names of the engines that are installed, as `installed` tells."""
    return installed(ENGINES)


def installed(known: Mapping[str, KnownSimulator]) -> tuple[str, ...]:
    """Names of those whose libraries are installed, which are not imported."""
    return tuple(name for name, one in known.items() if find_spec(one.library) is not None)


def physics_engine() -> PhysicsEngine:
    """The engine that `PHYBLOCK_PHYSICS` names, or the first one that is installed; one object for
    a whole process.

    Raises InputError for a name that is not known, and where the engine is not installed.
    """
    usual = next(iter(installed_engines()), REFERENCE_ENGINE)
    word = os.environ.get(PHYSICS_VARIABLE, usual)
    made = _made(PHYSICS_VARIABLE, word, ENGINES)
    if not isinstance(made, PhysicsEngine):
        raise InputError(Problem(PHYSICS_VARIABLE, "names no physics engine", found=word))
    return made


def told_engine() -> str:
    """The engine in use with the versions of its libraries, as records and manifests name it.

    Raises as `physics_engine` does.
    """
    return _described(physics_engine())


def renderer() -> Renderer:
    """The renderer that `PHYBLOCK_RENDERER` names, or our own; one object too.

    Raises InputError for a name that is not known, SimulationError for one that does not work
    here.
    """
    return _renderer(os.environ.get(_RENDERER_VARIABLE, _DEFAULT_RENDERER))


@functools.cache
def _renderer(word: str) -> Renderer:
    """Looked at once: every key of a picture asks for its renderer."""
    made = _made(_RENDERER_VARIABLE, word, RENDERERS)
    if not isinstance(made, Renderer):
        raise InputError(Problem(_RENDERER_VARIABLE, "names no renderer", found=word))
    return made


def _made(variable: str, word: str, known: Mapping[str, KnownSimulator]) -> object:
    """What a word means: one of those that are known, or `module:factory`."""
    named = known.get(word)
    if named is not None and find_spec(named.library) is None:
        raise InputError(Problem(variable, "is not installed", found=word, hint=named.hint))
    return _make(variable, word, word if named is None else named.path, ", ".join(known))


def other_simulators() -> tuple[str, ...]:
    """What is used instead of PyBullet or of our renderer, with its versions, as words for people.

    Raises as `physics_engine` and `renderer` do.
    """
    used = (
        ("the physics engine", physics_engine(), REFERENCE_ENGINE),
        ("the renderer", renderer(), _DEFAULT_RENDERER),
    )
    return tuple(f"{what} {_described(one)}" for what, one, usual in used if one.name != usual)


def _described(simulator: PhysicsEngine | Renderer) -> str:
    name, versions = simulator.name, simulator.versions
    if list(versions) == [name]:
        return f"{name} {versions[name]}"
    return f"{name} ({', '.join(' '.join(pair) for pair in versions.items())})"


@functools.cache
def _make(variable: str, word: str, path: str, names: str) -> object:
    """What the factory at `module:factory` makes, once a process."""
    module, _, factory = path.partition(":")
    if not all(part.isidentifier() for part in (*module.split("."), factory)):
        allowed = f"{names}, or module:factory"
        raise InputError(Problem(variable, "is not known", found=word, allowed=allowed))
    doing = "imported"
    try:
        make = getattr(importlib.import_module(module), factory)
        if not callable(make):
            raise InputError(Problem(variable, "names nothing that can be called", found=word))
        doing = "made"
        return make()
    except PhyblockError:
        raise
    except Exception as error:
        # It may be anybody's code, or no factory at all.
        message = f"cannot be {doing}: {type(error).__name__}: {error}"
        raise InputError(Problem(variable, message, found=word)) from error
