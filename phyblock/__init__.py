"""phyblock: declarative runner for PhyBlock, 3D block assembly for vision-language models.

`load_suite(name)` reads a suite and its scenes, `render(scene)` draws one, `score(reply, scene)`
says what a reply is worth, `run_suite(suite)` runs a suite. `load_run(path)` opens a run folder:
`.records` is a DataFrame, a row a sample, `.estimates` every value with its interval, `.tables`
maps names to DataFrames, `.summary()` and `.compare(other)` say what came out.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from phyblock.lazy import lazy_names

if TYPE_CHECKING:
    from phyblock.api.pictures import Picture, render
    from phyblock.api.running import run_suite
    from phyblock.api.scores import PlanScore, score
    from phyblock.api.suites import SceneTask, Suite, load_suite
    from phyblock.errors import PhyblockError
    from phyblock.results.load import Run, load_run

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

_HOMES = {
    "PhyblockError": "phyblock.errors",
    "Picture": "phyblock.api.pictures",
    "PlanScore": "phyblock.api.scores",
    "Run": "phyblock.results.load",
    "SceneTask": "phyblock.api.suites",
    "Suite": "phyblock.api.suites",
    "load_run": "phyblock.results.load",
    "load_suite": "phyblock.api.suites",
    "render": "phyblock.api.pictures",
    "run_suite": "phyblock.api.running",
    "score": "phyblock.api.scores",
}
_public = lazy_names(__name__, _HOMES)


def __getattr__(name: str) -> object:
    # What these need takes up to a second to import: only those who ask for it pay.
    if name == "__version__":
        from importlib.metadata import version

        return version("phyblock")
    return _public(name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
