"""A headless Chromium, and a visit to a page: what it complained of and what it asked for."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Locator, LocatorAssertions, Page

_FLAGS = [
    *("--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync"),
    *("--disable-background-networking", "--disable-component-update"),
    # WebGL in software, which draws the same everywhere.
    *("--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
]
_CHROMIUMS = ("chromium", "chromium-browser", "google-chrome")


def expect(locator: Locator) -> LocatorAssertions:
    """Return what waits for a locator; the page forbids `eval`, which other ways need."""
    from playwright.sync_api import expect as expected

    return expected(locator)


@contextmanager
def chromium() -> Iterator[Browser]:
    """A headless Chromium; skips where there is none."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    found = next(filter(None, map(shutil.which, _CHROMIUMS)), None)
    if found is None:
        pytest.skip("no Chromium: apt-get install chromium")
    with playwright.sync_playwright() as started:
        running = started.chromium.launch(executable_path=found, args=_FLAGS)
        yield running
        running.close()


class Visit:
    """A page, and all that it complained of or asked for."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.complaints: list[str] = []
        self.requests: list[str] = []
        page.on("console", lambda message: self._complain(message.text))
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.on("dialog", lambda dialog: self.complaints.append(dialog.message))
        page.on("request", lambda request: self.requests.append(request.url))

    def _complain(self, text: str) -> None:
        # A driver without a graphics card speaks of its own speed.
        if "GL Driver Message" not in text:
            self.complaints.append(text)

    def asked_elsewhere(self, *own: str) -> list[str]:
        """Return the requests to addresses that do not begin so."""
        return [url for url in self.requests if not url.startswith(own)]
