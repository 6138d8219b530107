"""The names of all physics engines and renderers, and which of them are used.

`PHYBLOCK_PHYSICS` and `PHYBLOCK_RENDERER` choose by name; processes that are started inherit the
choice. Either may also be `module:factory`, for an implementation that is not part of phyblock.
Nothing is imported before it is chosen.
"""

from __future__ import annotations

import functools
import importlib
import os
from collections.abc import Mapping

from phyblock.errors import InputError, PhyblockError, Problem
from phyblock.sim.engine import PhysicsEngine
from phyblock.sim.renderer import Renderer

__all__ = [
    "DEFAULT_ENGINE",
    "ENGINES",
    "RENDERERS",
    "other_simulators",
    "physics_engine",
    "renderer",
]

DEFAULT_ENGINE = "pybullet"
_DEFAULT_RENDERER = "raster"

ENGINES: Mapping[str, str] = {"pybullet": "phyblock.sim.bullet.physics:BulletEngine"}
"""Where the factory of each physics engine is."""
RENDERERS: Mapping[str, str] = {
    "raster": "phyblock.sim.raster.renderer:NumpyRenderer",
}
"""Where the factory of each renderer is."""


def physics_engine() -> PhysicsEngine:
    """The engine that `PHYBLOCK_PHYSICS` names, or PyBullet; one object for a whole process.

    Raises InputError for a name that is not known.
    """
    variable = "PHYBLOCK_PHYSICS"
    word = os.environ.get(variable, DEFAULT_ENGINE)
    made = _make(variable, word, ENGINES.get(word, word), ", ".join(ENGINES))
    if not isinstance(made, PhysicsEngine):
        raise InputError(Problem(variable, "names no physics engine", found=word))
    return made


def renderer() -> Renderer:
    """The renderer that `PHYBLOCK_RENDERER` names, or our own; one object too.

    Raises InputError for a name that is not known, SimulationError for one that does not work
    here.
    """
    variable = "PHYBLOCK_RENDERER"
    word = os.environ.get(variable, _DEFAULT_RENDERER)
    made = _make(variable, word, RENDERERS.get(word, word), ", ".join(RENDERERS))
    if not isinstance(made, Renderer):
        raise InputError(Problem(variable, "names no renderer", found=word))
    return made


def other_simulators() -> tuple[str, ...]:
    """What is used instead of PyBullet or of our renderer, with its versions, as words for people.

    Raises as `physics_engine` and `renderer` do.
    """
    used = (
        ("the physics engine", physics_engine(), DEFAULT_ENGINE),
        ("the renderer", renderer(), _DEFAULT_RENDERER),
    )
    return tuple(
        f"{what} {one.name} ({', '.join(' '.join(pair) for pair in one.versions.items())})"
        for what, one, usual in used
        if one.name != usual
    )


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
        said = f"cannot be {doing}: {type(error).__name__}: {error}"
        raise InputError(Problem(variable, said, found=word)) from error
