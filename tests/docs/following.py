"""A reader who does what a page says: writes its files and gives its commands, in their order."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

from tests.workspace import Workspace

DOCS = Path(__file__).parents[2] / "docs"
ADDRESS = "http://localhost:8000"
"""The server that pages name."""
_FENCE = re.compile(r'^```(\w+)(?: title="([^"]+)")?\n(.*?)^```$', re.M | re.S)


def follow(text: str, workspace: Workspace, url: str = ADDRESS) -> str:
    """Do what a text says; return what its commands printed.

    Blocks with a title are files, added to those that are there; `sh` blocks are commands. Others,
    such as `console`, need what a test does not have.
    """
    command = workspace.root / "bin" / "phyblock"
    command.parent.mkdir()
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m phyblock "$@"\n')
    command.chmod(0o755)
    folder = workspace.root / "reader"
    folder.mkdir()
    env = {**workspace.env, "PATH": f"{command.parent}{os.pathsep}{workspace.env['PATH']}"}
    printed = ""
    for language, file, block in _FENCE.findall(text):
        step = block.replace(ADDRESS, url)
        if file:
            with (folder / file).open("a", encoding="utf-8") as written:
                written.write(step)
        elif language == "sh":
            done = subprocess.run(
                ["bash", "-euc", f"{step}\npwd >{workspace.root}/where"],
                cwd=folder,
                env=env,
                stdin=subprocess.DEVNULL,
                capture_output=True,
                text=True,
                timeout=300,
            )
            assert done.returncode == 0, f"{step}\n{done.stdout}\n{done.stderr}"
            folder = Path((workspace.root / "where").read_text().strip())
            printed += done.stdout
    return printed
