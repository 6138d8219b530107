"""A run as tables, figures and a page; nothing is re-scored.

Names are imported when they are first used: pandas takes longer to import than most commands run.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from phyblock.lazy import lazy_names
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
    "coverage_frame": "phyblock.tables.coverage",
    "Design": "phyblock.tables.design",
    "read_design": "phyblock.tables.design",
    "files_of": "phyblock.report.files",
    "to_latex": "phyblock.tables.latex",
    "Run": "phyblock.tables.load",
    "load_run": "phyblock.tables.load",
    "to_markdown": "phyblock.tables.markdown",
    "published_table": "phyblock.tables.paper_numbers",
    "TablesWritten": "phyblock.report.write",
    "table_makers": "phyblock.report.write",
    "write_page": "phyblock.report.html",
    "write_report": "phyblock.report.html",
    "write_tables": "phyblock.report.write",
}
__getattr__ = lazy_names(__name__, _HOMES)
