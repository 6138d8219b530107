"""One run for all tests of the page."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.report.html_run import make_run
from tests.workspace import Workspace


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory, pictures_dir: Path) -> Workspace:
    """The run of `make_run`, which no test changes."""
    return make_run(tmp_path_factory.mktemp("page"), pictures_dir)
