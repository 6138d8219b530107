"""phyblock: declarative runner for PhyBlock, 3D block assembly for vision-language models.

`load_run(path)` opens a run folder for notebooks; its `.records` is a DataFrame, a row a sample.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from phyblock.report import Run, load_run

__all__ = ["Run", "load_run"]


def __getattr__(name: str) -> object:
    # pandas takes most of a second to import: only those who ask for it pay.
    if name in __all__:
        from phyblock import report

        return getattr(report, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
