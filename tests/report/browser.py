"""A visit to a report that was opened from disk."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from tests.browser import Visit

if TYPE_CHECKING:
    from playwright.sync_api import Page


class ReportVisit(Visit):
    """A report's page, by its file."""

    def __init__(self, page: Page, path: Path) -> None:
        super().__init__(page)
        self.path = path

    def open(self, view: str = "results") -> Page:
        self.page.goto(f"{self.path.as_uri()}#{view}")
        if view.startswith("samples"):
            self.page.wait_for_selector("#list [role=option]")
        return self.page

    def count(self) -> str:
        return self.page.inner_text("#list-status")

    def show(self, sample: str, **words: str) -> None:
        more = "".join(f"&{name}={word}" for name, word in words.items())
        self.page.goto(f"{self.path.as_uri()}#samples?s={sample.replace('/', '%2F')}{more}")
        self.page.wait_for_selector("#detail .tabs")

    @property
    def hash(self) -> str:
        """What the address says behind `#`."""
        found: str = self.page.evaluate("location.hash")
        return found.removeprefix("#")

    def wait_for_hash(self, is_so: Callable[[str], bool]) -> None:
        """Wait until the address says so; it is written once nothing has changed for a while."""
        end = time.monotonic() + 10
        while not is_so(self.hash):
            assert time.monotonic() < end, self.hash
            self.page.wait_for_timeout(50)
