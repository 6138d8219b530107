"""Commands in this process, in the folder of the workspace."""

from __future__ import annotations

import sys

import pytest

from tests.workspace import Workspace


@pytest.fixture
def inside(workspace: Workspace, monkeypatch: pytest.MonkeyPatch) -> Workspace:
    """The workspace as the working folder of this process, with its cache."""
    monkeypatch.chdir(workspace.root)
    monkeypatch.setenv("PHYBLOCK_CACHE", str(workspace.cache))
    monkeypatch.setattr(sys, "argv", ["phyblock"])
    return workspace
