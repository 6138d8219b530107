from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from phyblock.data.scenes import read_builtin
from phyblock.domain.scene import AssemblyTask
from phyblock.tracks.pictures import Workshop
from tests.data.broken import write_scenes
from tests.workspace import SCENES


@pytest.fixture(scope="session")
def tasks(tmp_path_factory: pytest.TempPathFactory) -> tuple[AssemblyTask, ...]:
    """The first is a red cube under a blue one; candidate 1 is the red cube, 3 the blue one."""
    return read_builtin(write_scenes(tmp_path_factory.mktemp("data"), *SCENES)).tasks


@pytest.fixture(scope="session")
def shop(pictures_dir: Path) -> Iterator[Workshop]:
    made = Workshop(1, pictures_dir)
    yield made
    made.close()
