"""phyblock: PhyBlock, 3D block assembly for vision-language models, as tasks, scenes and runs.

`tasks(track)` gives what a track asks, and the score of a reply. `generate(n)` makes scenes,
`verify(scene)` checks one, `render(scene)` draws one. `load_suite(name)` reads a suite and its
scenes, `run_suite(suite)` runs it. `load_run(path)` opens a run folder: `.records` is a DataFrame,
a row a sample, `.estimates` every value with its interval, `.tables` maps names to DataFrames,
`.summary()` and `.compare(other)` say what came out.
"""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from phyblock.api import Picture, Run, SceneTask, Suite, load_run, load_suite, render, run_suite
    from phyblock.errors import PhyblockError
    from phyblock.task import Episode, Score, Task, Tasks, Turn, generate, tasks, verify

    __version__: str

__all__ = [
    "Episode",
    "PhyblockError",
    "Picture",
    "Run",
    "SceneTask",
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
    **dict.fromkeys(("Picture", "Run", "SceneTask", "Suite"), "api"),
    **dict.fromkeys(("load_run", "load_suite", "render", "run_suite"), "api"),
    **dict.fromkeys(("Episode", "Score", "Task", "Tasks", "Turn"), "task"),
    **dict.fromkeys(("generate", "tasks", "verify"), "task"),
}
"""The module of each name."""
if find_spec("verifiers"):
    # It finds a taskset and its environment among the names that a package exports.
    __all__ += ["VerifiersEnv", "VerifiersTaskset"]
    _HOMES |= dict.fromkeys(("VerifiersEnv", "VerifiersTaskset"), "integrations.verifiers")


def __getattr__(name: str) -> object:
    # What these need takes up to a second to import: only those who ask for it pay.
    if name == "__version__":
        from importlib.metadata import version

        return version("phyblock")
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"phyblock.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
