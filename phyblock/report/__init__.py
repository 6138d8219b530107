"""Stored records as data frames, and tables as CSV, Markdown and LaTeX; nothing is re-scored."""

from phyblock.report.assembly import ASSEMBLY_COLUMNS, assembly_frame, table1_frame
from phyblock.report.comparison import largest_differences, published_frame, published_table
from phyblock.report.coverage import coverage_frame
from phyblock.report.design import Design, read_design
from phyblock.report.errors import errors_frame
from phyblock.report.latex import to_latex
from phyblock.report.load import Frames, Run, frames_from, load_run
from phyblock.report.markdown import to_markdown
from phyblock.report.text_table import NO_VALUE, Column, TextTable
from phyblock.report.write import TablesWritten, write_tables

__all__ = [
    "ASSEMBLY_COLUMNS",
    "NO_VALUE",
    "Column",
    "Design",
    "Frames",
    "Run",
    "TablesWritten",
    "TextTable",
    "assembly_frame",
    "coverage_frame",
    "errors_frame",
    "frames_from",
    "largest_differences",
    "load_run",
    "published_frame",
    "published_table",
    "read_design",
    "table1_frame",
    "to_latex",
    "to_markdown",
    "write_tables",
]
