"""Stored records as data frames, and tables as CSV, Markdown and LaTeX; nothing is re-scored.

Names are imported when they are first used: pandas takes longer to import than most commands run.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from phyblock.tables.text_table import NO_VALUE, Column, TextTable

if TYPE_CHECKING:
    from phyblock.report.html import write_report
    from phyblock.report.write import TablesWritten, write_tables
    from phyblock.tables.coverage import coverage_frame
    from phyblock.tables.design import Design, read_design
    from phyblock.tables.latex import to_latex
    from phyblock.tables.load import Run, load_run
    from phyblock.tables.markdown import to_markdown
    from phyblock.tracks.full_planning.assembly import (
        ASSEMBLY_COLUMNS,
        assembly_frame,
        table1_frame,
    )
    from phyblock.tracks.full_planning.errors import errors_frame
    from phyblock.tracks.full_planning.published import (
        comparison_notes,
        largest_differences,
        published_frame,
        published_table,
    )

__all__ = [
    "ASSEMBLY_COLUMNS",
    "NO_VALUE",
    "Column",
    "Design",
    "Run",
    "TablesWritten",
    "TextTable",
    "assembly_frame",
    "comparison_notes",
    "coverage_frame",
    "errors_frame",
    "largest_differences",
    "load_run",
    "published_frame",
    "published_table",
    "read_design",
    "table1_frame",
    "to_latex",
    "to_markdown",
    "write_report",
    "write_tables",
]

_HOMES = {
    "ASSEMBLY_COLUMNS": "assembly",
    "assembly_frame": "assembly",
    "table1_frame": "assembly",
    "comparison_notes": "comparison",
    "largest_differences": "comparison",
    "published_frame": "comparison",
    "published_table": "comparison",
    "coverage_frame": "coverage",
    "Design": "design",
    "read_design": "design",
    "errors_frame": "errors",
    "to_latex": "latex",
    "Run": "load",
    "load_run": "load",
    "to_markdown": "markdown",
    "TablesWritten": "write",
    "write_report": "html",
    "write_tables": "write",
}


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)
