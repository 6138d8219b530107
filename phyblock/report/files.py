"""All that tables, figures and the page may put into a run folder."""

from __future__ import annotations

from phyblock.report.html import page_files
from phyblock.results.figures import figure_files
from phyblock.results.tables import table_files

__all__ = ["files_of"]


def files_of(*, page: bool) -> tuple[str, ...]:
    """Names, as `OutFolder` takes them, of tables and with `page` of figures and the page too."""
    return table_files() + (figure_files() + page_files() if page else ())
