"""What the documentation says is done: tutorials from an empty folder, plugins, models."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.servers.chassis import Running
from tests.servers.openai_chat import OpenAIChat
from tests.web.test_data import unpacked
from tests.workspace import csv_rows

DOCS = Path(__file__).parents[2] / "docs"
ADDRESS = "http://localhost:8000"
"""The server that pages name."""
_FENCE = re.compile(r'^```(\w+)(?: title="([^"]+)")?\n(.*?)^```$', re.M | re.S)


def follow(text, workspace, url=ADDRESS):
    """Do what a text says; return what its commands printed.

    Blocks with a title are files, added to those that are there; `sh` blocks are commands. Others,
    such as `console`, need what a test does not have.
    """
    program = workspace.root / "bin" / "phyblock"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m phyblock "$@"\n')
    program.chmod(0o755)
    folder = workspace.root / "reader"
    folder.mkdir()
    env = {**workspace.env, "PATH": f"{program.parent}{os.pathsep}{workspace.env['PATH']}"}
    printed = ""
    for language, file, block in _FENCE.findall(text):
        step = block.replace(ADDRESS, url)
        if file:
            with (folder / file).open("a", encoding="utf-8") as written:
                written.write(step)
        elif language == "sh":
            command = ["bash", "-euc", f"{step}\npwd >{workspace.root}/where"]
            caught = {"stdin": subprocess.DEVNULL, "capture_output": True, "text": True}
            done = subprocess.run(command, cwd=folder, env=env, timeout=300, **caught)
            assert done.returncode == 0, f"{step}\n{done.stdout}\n{done.stderr}"
            folder = Path((workspace.root / "where").read_text().strip())
            printed += done.stdout
    return printed


LEFT = {
    "first-model.md": ("my-bench/results/first/report.html",),
    "first-scenes.md": ("mine-set/scenes.jsonl", "pictures", "results/mine-poses/tables"),
    "paper-tables.md": ("results/comparison", "results/paper/paper"),
}
"""What is there after each tutorial; blocks of agent.md are run with the environment's tests."""
PAGES = sorted({page.name for page in (DOCS / "tutorials").glob("*.md")} - {"agent.md"})


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES)
def test_a_reader_comes_to_the_end(page, workspace):
    with Running(OpenAIChat()) as server:
        text = (DOCS / "tutorials" / page).read_text(encoding="utf-8")
        printed = follow(text, workspace, server.url)
    for name in LEFT[page]:
        assert (workspace.root / "reader" / name).exists(), name
    if page == "first-model.md":
        table = printed[printed.index("Full planning") :]
        assert re.search(r"^\W*my-model\b.*\d", table, re.M)
        assert "All 24 samples are done" in printed


MOST_LINES = 150
EXTENDING = (DOCS / "extending.md").read_text(encoding="utf-8")
SECTIONS = dict(re.findall(r"^## (.+?)\n(.*?)(?=^## |\Z)", EXTENDING, re.M | re.S))
SHOWN = {
    "A block shape": ("towers", "f1", {"oracle": 1.0, "random": None}, "table1", "hexagon"),
    "A background": ("grounds", "f1", {"random": None}, "sensitivity", "sand"),
    "A question kind": ("ground", "accuracy", {"oracle": 1.0}, "table2", "GR"),
    "A measure": ("needless", "needless", {"oracle": 0.0}, "full_planning_measures", "Needless"),
    "A track": ("counting", "exact", {"oracle": 1.0, "random": None}, "counting", "Counting"),
}
"""By section: the folder of its run, a measure with values, a table, and a text of the page."""


@pytest.mark.slow
@pytest.mark.parametrize("section", SECTIONS)
def test_a_plugin_is_in_tables_and_on_the_page(section, workspace):
    text = SECTIONS[section]
    modules = re.findall(r"```python(.*?)```", text, re.S)
    assert max(module.count("\n") for module in modules) <= MOST_LINES
    follow(text, workspace)
    folder, measure, values, table, word = SHOWN[section]
    run = workspace.root / "reader" / "results" / folder
    rows = csv_rows(run / "tables" / "estimates.csv")
    rows = [row for row in rows if (row["measure"], row["cell"]) == (measure, "overall")]
    for model, value in values.items():
        (found, *_) = [row for row in rows if row["model"] == model]
        assert found["lo"] <= found["value"] <= found["hi"]
        assert value is None or float(found["value"]) == value
    shown = (run / "tables" / f"{table}.tex").read_text(encoding="utf-8")
    assert all(model in shown for model in values)
    assert word in shown or section in ("A block shape", "A background")
    scripts = [path for path in (run / "report").rglob("*.js") if path.name != "three.js"]
    page = (run / "report.html").read_text(encoding="utf-8")
    assert word in page + str([*map(unpacked, scripts)])
