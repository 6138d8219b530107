"""phyblock: declarative runner for PhyBlock, 3D block assembly for vision-language models.

`load_suite(name)` reads a suite and its scenes, `render(scene)` draws one, `score(reply, scene)`
says what a reply is worth, `run_suite(suite)` runs a suite. `load_run(path)` opens a run folder:
`.records` is a DataFrame, a row a sample, `.estimates` every value with its interval, `.tables`
maps names to DataFrames, `.summary()` and `.compare(other)` say what came out.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from phyblock.api import (
        Picture,
        PlanScore,
        Run,
        SceneTask,
        Suite,
        load_run,
        load_suite,
        render,
        run_suite,
        score,
    )
    from phyblock.errors import PhyblockError

    __version__: str

__all__ = [
    "PhyblockError",
    "Picture",
    "PlanScore",
    "Run",
    "SceneTask",
    "Suite",
    "__version__",
    "load_run",
    "load_suite",
    "render",
    "run_suite",
    "score",
]


def __getattr__(name: str) -> object:
    # What these need takes up to a second to import: only those who ask for it pay.
    if name == "__version__":
        from importlib.metadata import version

        return version("phyblock")
    if name == "PhyblockError":
        from phyblock.errors import PhyblockError

        return PhyblockError
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from phyblock import api

    return getattr(api, name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
