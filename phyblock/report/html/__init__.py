"""`report.html`: a run as a page that opens from disk, with no server and no network.

Beside the page lies a folder of scripts that hold the records in chunks; the page loads what it
shows, when it shows it (docs/results.md).
"""

from phyblock.report.html.write import (
    REPORT_FILE,
    PageWritten,
    page_files,
    write_page,
    write_report,
)

__all__ = ["REPORT_FILE", "PageWritten", "page_files", "write_page", "write_report"]
