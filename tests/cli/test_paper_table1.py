"""The paper's Table 1 out of the official recordings, by the command a reader would type."""

from __future__ import annotations

import csv
import io
import re
from pathlib import Path

import pytest

from tests.fork_server import Done
from tests.workspace import Workspace

ROUNDING = 0.06
"""Both numbers are rounded to a tenth [points]."""
METRICS = ("precision", "recall", "f1")


@pytest.fixture(scope="module")
def reproduced(
    official_checkout: Path, tmp_path_factory: pytest.TempPathFactory, pictures_dir: Path
) -> tuple[Workspace, Done]:
    workspace = Workspace(tmp_path_factory.mktemp("paper"), pictures_dir)
    command = ["run", "paper-table1", "--set", f"dataset.path={official_checkout}", "--out", "out"]
    done = workspace.phyblock(*command, "--no-report")
    assert (done.code, done.err) == (0, "")
    return workspace, done


def rows(workspace: Workspace, name: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(workspace.tables()[name].decode())))


def test_every_published_cell_comes_out_again(
    reproduced: tuple[Workspace, Done], official_checkout: Path
) -> None:
    workspace, _ = reproduced
    cells = rows(workspace, "published.csv")
    recorded = {folder.name for folder in (official_checkout / "outputs").iterdir()}
    known = {cell["model"] for cell in cells if cell["difference"]}
    assert len(known) >= min(6, len(recorded))
    for model in known:
        mine = [cell for cell in cells if cell["model"] == model]
        assert {(cell["cell"], cell["metric"]) for cell in mine} == {
            (level, metric) for level in ("1", "2", "3", "4", "overall") for metric in METRICS
        }
        for cell in mine:
            assert abs(float(cell["ours"]) - float(cell["published"])) <= ROUNDING, cell


def test_missing_replies_are_skipped_and_said(reproduced: tuple[Workspace, Done]) -> None:
    workspace, done = reproduced
    missing = {row["model"]: int(row["missing"]) for row in rows(workspace, "coverage.csv")}
    assert missing.pop("claude-3-7-thinking") == 10
    assert re.search(r"claude-3-7-thinking +400 +390 +0 +10\n", done.out)
    scored = {
        row["model"]: row["n"]
        for row in rows(workspace, "estimates.csv")
        if (row["measure"], row["setting"], row["cell"]) == ("f1", "A", "overall")
    }
    assert scored["claude-3-7-thinking"] == "390"
    assert {scored[model] for model, lost in missing.items() if not lost} == {"400"}


def test_a_recording_is_never_asked_anything(reproduced: tuple[Workspace, Done]) -> None:
    workspace, _ = reproduced
    replies = [record["reply"] for record in workspace.records() if record["reply"]]
    assert {reply["attempts"] for reply in replies} == {0}
    assert {reply["cost_usd"] for reply in replies} == {0.0}
    assert not (workspace.cache / "replies.sqlite").exists()
