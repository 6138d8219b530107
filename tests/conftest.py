"""Shared fixtures: where the official data is, if it is here; workspaces."""

import gc
import os
import signal
import sys
from collections.abc import Callable, Generator
from pathlib import Path

import pytest
from hypothesis import settings

from phyblock.data.base import Dataset, QuestionSet
from tests.fork_server import ONE_THREAD
from tests.workspace import KEY, KEY_VARIABLE, Raw, Workspace, write_questions

OFFICIAL_MISSING = "no official data: put it at ../shared or set PHYBLOCK_OFFICIAL to its folder"
EXAMPLES = int(os.environ.get("PHYBLOCK_EXAMPLES", "100"))
settings.register_profile("phyblock", deadline=None, max_examples=EXAMPLES)
settings.load_profile("phyblock")

os.environ.update(ONE_THREAD | {KEY_VARIABLE: KEY, "NO_PROXY": "*"})

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # A shell has the commands that it starts in the background ignore it, and their children too.
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Most of what tests make is gone without a collector, and what is collected stays."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.set_threshold(20_000, 10, 10)
        gc.enable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Pages come first: two processes that share them late would make their runs twice."""
    items.sort(key=lambda item: "web" not in item.path.parts)


def official_root() -> Path | None:
    """The folder that holds `PhyBlock/` and `expected/`, or None; the checkout itself will do."""
    named = os.environ.get("PHYBLOCK_OFFICIAL")
    root = Path(named) if named else Path(__file__).parents[2] / "shared"
    if (root / "data").is_dir() and root.name == "PhyBlock":
        root = root.parent
    return root if (root / "PhyBlock" / "data").is_dir() else None


@pytest.fixture(scope="session")
def official_dir() -> Path:
    """The folder that holds `PhyBlock/` and `expected/`; skips where it is not there."""
    root = official_root()
    if root is None:
        pytest.skip(OFFICIAL_MISSING)
    return root


@pytest.fixture(scope="session")
def official_checkout(official_dir: Path) -> Path:
    """The (partial) checkout of the official repository."""
    return official_dir / "PhyBlock"


@pytest.fixture(scope="session")
def pictures_dir(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of rendered pictures of all workspaces of a test session, in all its processes."""
    base = tmp_path_factory.getbasetemp()
    return (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "pictures"


@pytest.fixture(scope="session")
def new_workspace(
    tmp_path_factory: pytest.TempPathFactory, pictures_dir: Path
) -> Callable[..., Workspace]:
    """Makes workspaces with some scenes, for what is made once and looked at by many tests."""

    def make(*scenes: Raw) -> Workspace:
        made = Workspace(tmp_path_factory.mktemp("made"), pictures_dir)
        made.write_scenes(*scenes)
        return made

    return make


@pytest.fixture(scope="session")
def towers(new_workspace: Callable[..., Workspace]) -> Dataset:
    """The scenes of a workspace, as they are read."""
    from phyblock.data.scenes import read_builtin

    return read_builtin(new_workspace().root / "data")


@pytest.fixture(scope="session")
def question_set(tmp_path_factory: pytest.TempPathFactory, towers: Dataset) -> QuestionSet:
    """The questions of a workspace, as they are read."""
    from phyblock.data.questions import read_questions

    return read_questions(write_questions(tmp_path_factory.mktemp("vqa") / "q"), towers)


@pytest.fixture
def workspace(tmp_path: Path, pictures_dir: Path) -> Workspace:
    """A folder with scenes and nothing else; see Workspace."""
    made = Workspace(tmp_path, pictures_dir)
    made.write_scenes()
    return made


@pytest.fixture
def inside(workspace: Workspace, monkeypatch: pytest.MonkeyPatch) -> Workspace:
    """The workspace as the working folder of this process, with its cache."""
    monkeypatch.chdir(workspace.root)
    monkeypatch.setenv("PHYBLOCK_CACHE", str(workspace.cache))
    monkeypatch.setattr(sys, "argv", ["phyblock"])
    return workspace
