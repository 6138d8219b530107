"""What whole commands, in processes of their own, leave in a home folder: nothing but the cache."""

from __future__ import annotations

import os
from pathlib import Path

from tests.fuzz.laws import take_tree
from tests.workspace import Workspace


def test_figures_and_report_leave_nothing_at_home(workspace: Workspace, tmp_path: Path) -> None:
    home, passing = tmp_path / "home", tmp_path / "tmp"
    for folder in (home, passing):
        folder.mkdir()
    workspace.write_suite(models=["oracle"])
    env = {"HOME": str(home), "TMPDIR": str(passing), "PATH": os.environ["PATH"]}
    before = take_tree(workspace.root)
    done = workspace.run("--limit", "1", page=True, env=env)
    assert done.code == 0, done.err
    assert (take_tree(home), take_tree(passing)) == ({}, {})
    changed = {path for path, look in take_tree(workspace.root).items() if before.get(path) != look}
    assert {path.split("/")[0] for path in changed} <= {"out", "cache"}
    assert (workspace.out / "report.html").exists()
