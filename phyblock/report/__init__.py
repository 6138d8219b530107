"""Stored records as data frames, and tables as CSV, Markdown and LaTeX; nothing is re-scored.

Names are imported when they are first used: pandas takes longer to import than most commands run.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from phyblock.report.text_table import NO_VALUE, Column, TextTable

if TYPE_CHECKING:
    from phyblock.report.assembly import ASSEMBLY_COLUMNS, assembly_frame, table1_frame
    from phyblock.report.comparison import (
        comparison_notes,
        largest_differences,
        published_frame,
        published_table,
    )
    from phyblock.report.coverage import coverage_frame
    from phyblock.report.design import Design, read_design
    from phyblock.report.errors import errors_frame
    from phyblock.report.files import files_of
    from phyblock.report.html import write_report
    from phyblock.report.latex import to_latex
    from phyblock.report.load import Run, load_run
    from phyblock.report.markdown import to_markdown
    from phyblock.report.write import TablesWritten, write_tables

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
    "files_of",
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
    "files_of": "files",
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
