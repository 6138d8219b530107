"""One run for all tests of the page, and a browser for each module of them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from tests.report.browser import chromium
from tests.report.html_run import make_run
from tests.workspace import Workspace

if TYPE_CHECKING:
    from playwright.sync_api import Browser


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """A browser; its event loop runs while it does, so that it ends with its module."""
    with chromium() as running:
        yield running


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory, pictures_dir: Path) -> Workspace:
    """The run of `make_run`, which no test changes."""
    return make_run(tmp_path_factory.mktemp("page"), pictures_dir)
