"""Tutorials work as they are written, from an empty folder. Slow: they draw figures and pages."""

from __future__ import annotations

import re

import pytest

from tests.docs.following import DOCS, follow
from tests.servers.chassis import Running
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import Workspace

LEFT = {
    "first-model.md": ("my-bench/results/first/report.html",),
    "first-scenes.md": ("mine-set/scenes.jsonl", "pictures", "results/mine-poses/tables"),
    "paper-tables.md": ("results/comparison", "results/paper/paper", "rocket.gif"),
}
"""What is there after each tutorial; blocks of agent.md are run with the environment's tests."""


@pytest.mark.slow
@pytest.mark.parametrize("page", LEFT)
def test_a_reader_comes_to_the_end(page: str, workspace: Workspace) -> None:
    with Running(OpenAIChat()) as server:
        text = (DOCS / "tutorials" / page).read_text(encoding="utf-8")
        printed = follow(text, workspace, server.url)
    for name in LEFT[page]:
        assert (workspace.root / "reader" / name).exists(), name
    if page == "first-model.md":
        table = printed[printed.index("Assembly planning") :]
        assert re.search(r"^\W*my-model\b.*\d", table, re.M)
        assert "All 24 samples are done" in printed


def test_every_tutorial_is_followed() -> None:
    assert {page.name for page in (DOCS / "tutorials").glob("*.md")} == {*LEFT, "agent.md"}


@pytest.mark.parametrize(
    "page", ["../README.md", "index.md", "models.md", "tutorials/first-model.md"]
)
def test_a_model_that_a_page_adds_is_not_there_yet(page: str) -> None:
    models = (DOCS.parent / "models.yaml").read_text(encoding="utf-8")
    added = re.findall(r"^(\S+:) openai/", (DOCS / page).read_text(encoding="utf-8"), re.M)
    assert added
    assert not [name for name in added if re.search(f"^{re.escape(name)}", models, re.M)]
