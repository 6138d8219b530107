"""The runs of which sites are made, once for all tests of sites."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.site.site_runs import make_runs
from tests.workspace import Workspace


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory, pictures_dir: Path) -> Workspace:
    """See `make_runs`; what is there is not to be changed."""
    return make_runs(tmp_path_factory.mktemp("site"), pictures_dir)
