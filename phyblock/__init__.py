"""phyblock: declarative runner for PhyBlock, 3D block assembly for vision-language models.

`load_run(path)` opens a run folder for notebooks: `.records` is a DataFrame, a row a sample,
`.tables` maps names to DataFrames, `.summary()` and `.compare(other)` say what came out.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from phyblock.report.notebook import LoadedRun as Run
    from phyblock.report.notebook import load_run

    __version__: str

__all__ = ["Run", "__version__", "load_run"]


def __getattr__(name: str) -> object:
    # What these need takes up to a second to import: only those who ask for it pay.
    if name == "__version__":
        from importlib.metadata import version

        return version("phyblock")
    if name in __all__:
        from phyblock.report import notebook

        return notebook.LoadedRun if name == "Run" else notebook.load_run
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
