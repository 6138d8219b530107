"""Tracks, measures and baselines from outside, by `--plugin` and by an entry point."""

from __future__ import annotations

import pytest

from tests.workspace import Workspace

PLUGIN = """
from phyblock.registry import add_baseline

def backwards(subject, rng):
    return "Step1: Move block with index 16"

add_baseline("full_planning", "backwards", backwards)
"""


@pytest.fixture
def suite(workspace: Workspace) -> Workspace:
    workspace.write_suite(models=["backwards"])
    (workspace.root / "mine.py").write_text(PLUGIN, encoding="utf-8")
    return workspace


def test_a_baseline_of_a_module_is_run_and_shown(suite: Workspace) -> None:
    assert suite.run().code == 2
    words = ("run", "suite.yaml", "--out", suite.out, "--no-report")
    done = suite.phyblock("--plugin", "mine", *words, fresh=True)
    assert (done.code, done.err) == (0, "")
    assert {record["model"] for record in suite.records()} == {"backwards"}
    assert {tuple(record["parse"]["plan"]) for record in suite.records()} == {(16,)}


def test_an_entry_point_is_loaded_without_being_named(suite: Workspace) -> None:
    about = suite.root / "mine-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: mine\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("[phyblock.plugins]\nmine = mine\n")
    path = f"{suite.env['PYTHONPATH']}:{suite.root}"
    done = suite.run(env={"PYTHONPATH": path}, fresh=True)
    assert (done.code, done.err) == (0, "")
    (suite.root / "mine.py").write_text("1 / 0\n", encoding="utf-8")
    done = suite.run(env={"PYTHONPATH": path}, fresh=True)
    assert done.code == 2
    assert "plugin mine: cannot be imported: ZeroDivisionError" in done.err
    assert "mine.py:1" in done.err


def test_a_module_that_is_not_there_is_named(suite: Workspace) -> None:
    done = suite.phyblock("--plugin", "no_such", "models", fresh=True)
    assert done.code == 2
    assert "--plugin: cannot be imported: ModuleNotFoundError" in done.err
    assert "Traceback" not in done.err
