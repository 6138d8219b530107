"""Tracks opened for tests on a suite of some fields; scenes, and who draws their pictures."""

import contextlib
import json
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from phyblock.config.suite import load_suite
from phyblock.data.base import Dataset
from phyblock.data.scenes import StoredScene
from phyblock.domain.scene import AssemblyTask, Candidate, CandidateSet, Scene
from phyblock.tracks.base import open_tracks
from phyblock.tracks.pictures import Workshop
from tests.shipped import TASKS
from tests.sim.structures import block
from tests.workspace import Raw


def track_of(
    name: str,
    tasks: Sequence[AssemblyTask] = TASKS,
    shop: Workshop | None = None,
    limit: int | None = None,
    **fields: Any,
) -> Any:
    """A track about these scenes, in a suite of these fields; a shop draws its small pictures."""
    images = {"size_px": 128, **fields.pop("images", {})}
    whole = {"name": "s", "tracks": [name], "models": ["oracle"], "images": images, **fields}
    with tempfile.NamedTemporaryFile("w", suffix=".yaml") as file:
        json.dump(whole, file)
        file.flush()
        suite = load_suite(Path(file.name))
    (track,) = open_tracks(suite, Dataset("test", Path("."), tuple(tasks)), limit, shop)
    return track


def raw_of(task: AssemblyTask) -> Raw:
    """The line of a data set that says a task."""
    return json.loads(StoredScene.of(task.scene, task.candidates).as_json())


def seesaw() -> AssemblyTask:
    """A bar that tips unless the second cube is there before it; nothing says so but physics."""
    blocks = (
        block(1, "cube", (0, 0, 0.025)),
        block(2, "cube", (0.11, 0, 0.025), color="blue"),
        block(3, "cuboid3", (0.055, 0, 0.0625), color="yellow", depend=(1,)),
    )
    numbered = tuple(Candidate(*one.kind, one.euler_deg) for one in blocks)
    return AssemblyTask(Scene("seesaw", (2,), blocks, ("seesaw",)), CandidateSet(numbered))


@pytest.fixture(scope="session")
def tasks(towers: Dataset) -> tuple[AssemblyTask, ...]:
    """The first is a red cube under a blue one; candidate 1 is the red cube, 3 the blue one."""
    return towers.tasks


@pytest.fixture(scope="session")
def shop(pictures_dir: Path) -> Iterator[Workshop]:
    with contextlib.closing(Workshop(1, pictures_dir)) as made:
        yield made
