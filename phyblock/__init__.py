"""phyblock: PhyBlock, 3D block assembly for vision-language models, as tasks, scenes and runs.

`tasks(track)` returns the tasks of a track, which score replies. `generate(n)` makes scenes,
`verify(scene)` checks one, `render(scene)` draws one. `load_suite(name)` reads a suite,
`run_suite(suite)` runs it. `load_run(path)` opens a run folder: `.records` is a DataFrame with one
row per sample, `.estimates` has every value with its interval, `.tables` maps names to DataFrames,
`.summary()` and `.compare(other)` return the results.
"""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from phyblock.api import (
        Episode,
        Score,
        Task,
        Tasks,
        Turn,
        generate,
        load_suite,
        render,
        run_suite,
        tasks,
        verify,
    )
    from phyblock.config.suite import Suite
    from phyblock.errors import PhyblockError
    from phyblock.results.load import Run, load_run

    __version__: str

__all__ = [
    "Episode",
    "PhyblockError",
    "Run",
    "Score",
    "Suite",
    "Task",
    "Tasks",
    "Turn",
    "__version__",
    "generate",
    "load_run",
    "load_suite",
    "render",
    "run_suite",
    "tasks",
    "verify",
]
_HOMES = {
    "PhyblockError": "errors",
    "Suite": "config.suite",
    **dict.fromkeys(("Run", "load_run"), "results.load"),
}
"""The modules of names that are not in `api`."""
if find_spec("verifiers"):
    # verifiers looks for a taskset and its environment among the names that a package exports.
    __all__ += ["VerifiersEnv", "VerifiersTaskset"]
    _HOMES |= dict.fromkeys(("VerifiersEnv", "VerifiersTaskset"), "integrations.verifiers")


def __getattr__(name: str) -> object:
    # Imported on first use: what these names need takes up to a second.
    if name == "__version__":
        from importlib.metadata import version

        return version("phyblock")
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"phyblock.{_HOMES.get(name, 'api')}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
