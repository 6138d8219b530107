"""A run as tables, figures and a page; nothing is re-scored.

Names are imported when they are first used: pandas takes longer to import than most commands run.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from phyblock.tables.text_table import NO_VALUE, Column, TextTable

if TYPE_CHECKING:
    from phyblock.report.files import files_of
    from phyblock.report.html import write_page, write_report
    from phyblock.report.write import TablesWritten, table_makers, write_tables
    from phyblock.tables.coverage import coverage_frame
    from phyblock.tables.design import Design, read_design
    from phyblock.tables.latex import to_latex
    from phyblock.tables.load import Run, load_run
    from phyblock.tables.markdown import to_markdown
    from phyblock.tables.paper_numbers import published_table

__all__ = [
    "NO_VALUE",
    "Column",
    "Design",
    "Run",
    "TablesWritten",
    "TextTable",
    "coverage_frame",
    "files_of",
    "load_run",
    "published_table",
    "read_design",
    "table_makers",
    "to_latex",
    "to_markdown",
    "write_page",
    "write_report",
    "write_tables",
]

_HOMES = {
    "coverage_frame": "tables.coverage",
    "Design": "tables.design",
    "read_design": "tables.design",
    "files_of": "report.files",
    "to_latex": "tables.latex",
    "Run": "tables.load",
    "load_run": "tables.load",
    "to_markdown": "tables.markdown",
    "published_table": "tables.paper_numbers",
    "TablesWritten": "report.write",
    "table_makers": "report.write",
    "write_page": "report.html",
    "write_report": "report.html",
    "write_tables": "report.write",
}


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"phyblock.{_HOMES[name]}"), name)
