"""What the tutorials tell a reader to do works, in their order and from nothing.

`make docs` runs these; they are slow, since a reader waits for figures and pages, too.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.servers.chassis import Running
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import Workspace

TUTORIALS = Path(__file__).parents[2] / "docs" / "tutorials"
ADDRESS = "http://localhost:8000"
"""The server that the tutorials speak of."""

_FENCE = re.compile(r'^```(\w+)(?: title="([^"]+)")?\n(.*?)^```$', re.M | re.S)


@dataclass(frozen=True)
class Step:
    """A block of a page that a reader carries out: a file to write, or commands."""

    file: str
    text: str


def steps(page: str) -> Iterator[Step]:
    """The blocks of a page in their order; `console` blocks need what a test does not have."""
    for language, file, text in _FENCE.findall((TUTORIALS / page).read_text(encoding="utf-8")):
        if language == "sh" or file:
            yield Step(file, text)


def follow(page: str, workspace: Workspace, url: str) -> str:
    """Do what a page says; gives what its commands printed. A file that is there is added to."""
    command = workspace.root / "bin" / "phyblock"
    command.parent.mkdir()
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m phyblock "$@"\n')
    command.chmod(0o755)
    folder = workspace.root / "reader"
    folder.mkdir()
    env = {**workspace.env, "PATH": f"{command.parent}{os.pathsep}{workspace.env['PATH']}"}
    printed = ""
    for step in steps(page):
        text = step.text.replace(ADDRESS, url)
        if step.file:
            with (folder / step.file).open("a", encoding="utf-8") as file:
                file.write(text)
            continue
        done = subprocess.run(
            ["bash", "-euc", f"{text}\npwd >{workspace.root}/where"],
            cwd=folder,
            env=env,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=300,
        )
        assert done.returncode == 0, f"{page}: {text}\n{done.stdout}\n{done.stderr}"
        folder = Path((workspace.root / "where").read_text().strip())
        printed += done.stdout
    return printed


@pytest.mark.slow
def test_a_reader_gets_an_own_model_into_the_table(workspace: Workspace) -> None:
    with Running(OpenAIChat()) as server:
        printed = follow("first-model.md", workspace, server.url)
    table = printed[printed.index("Assembly planning") :]
    assert re.search(r"^ my-model +\d", table, re.M)
    assert "All 16 samples are done" in table
    assert (workspace.root / "reader/my-bench/results/first/report.html").is_file()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("page", "left"),
    [
        ("first-scenes.md", ["mine-set/scenes.jsonl", "pictures", "results/mine-poses/tables"]),
        (
            "paper-tables.md",
            ["results/comparison", "results/paper/figures", "results/paper/paper", "rocket.gif"],
        ),
    ],
)
def test_a_reader_comes_to_the_end(page: str, left: list[str], workspace: Workspace) -> None:
    follow(page, workspace, ADDRESS)
    for name in left:
        assert (workspace.root / "reader" / name).exists(), name


def test_every_page_is_followed() -> None:
    followed = {"first-model.md", "first-scenes.md", "paper-tables.md"}
    assert {page.name for page in TUTORIALS.glob("*.md")} == followed
