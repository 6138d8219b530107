"""A run as tables, figures and a page; nothing is re-scored.

Names are imported when they are first used: pandas takes longer to import than most commands run.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from phyblock.lazy import lazy_names
from phyblock.results.text import NO_VALUE, Column, TextTable

if TYPE_CHECKING:
    from phyblock.report.files import files_of
    from phyblock.report.html import write_page, write_report
    from phyblock.results.design import Design, read_design
    from phyblock.results.load import Run, load_run
    from phyblock.results.paper import published_table
    from phyblock.results.tables import TablesWritten, coverage_frame, write_tables
    from phyblock.results.text import to_latex, to_markdown

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
    "to_latex",
    "to_markdown",
    "write_page",
    "write_report",
    "write_tables",
]

_HOMES = {
    "coverage_frame": "phyblock.results.tables",
    "Design": "phyblock.results.design",
    "read_design": "phyblock.results.design",
    "files_of": "phyblock.report.files",
    "to_latex": "phyblock.results.text",
    "Run": "phyblock.results.load",
    "load_run": "phyblock.results.load",
    "to_markdown": "phyblock.results.text",
    "published_table": "phyblock.results.paper",
    "TablesWritten": "phyblock.results.tables",
    "write_page": "phyblock.report.html",
    "write_report": "phyblock.report.html",
    "write_tables": "phyblock.results.tables",
}
__getattr__ = lazy_names(__name__, _HOMES)
