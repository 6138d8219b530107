"""The public API: what a notebook may import, what it costs, and that the guide to it runs."""

from __future__ import annotations

import asyncio
import re
import subprocess
import sys
import typing
from importlib.metadata import version
from pathlib import Path

import pytest
from PIL import Image

import phyblock
from phyblock.errors import SpecError
from phyblock.sim.engine import ENGINES
from tests.workspace import Workspace

NAMES = ["Episode", "PhyblockError", "Run", "Score", "Suite", "Task"]
NAMES += ["Tasks", "Turn", "__version__", "generate", "load_run", "load_suite", "render"]
NAMES += ["run_suite", "tasks", "verify"]
GUIDE = Path(__file__).parents[1] / "docs" / "python.md"
PNG = b"\x89PNG\r\n\x1a\n"


def test_public_names_are_these_and_completion_finds_them() -> None:
    assert phyblock.__all__ == NAMES
    assert all(getattr(phyblock, name).__doc__ for name in phyblock.__all__)
    assert set(phyblock.__all__) <= set(dir(phyblock))
    assert phyblock.__version__ == version("phyblock")
    for name in ("load_suite", "render", "run_suite", "load_run", "tasks", "generate", "verify"):
        assert "return" in typing.get_type_hints(getattr(phyblock, name)), name
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        _ = phyblock.nothing


def test_importing_phyblock_imports_nothing_heavy() -> None:
    code = "import phyblock, sys; print(*sorted({name.split('.')[0] for name in sys.modules}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    heavy = {
        "numpy",
        "pandas",
        "litellm",
        *ENGINES,
        "aiohttp",
        "pydantic",
        "yaml",
        "click",
    }
    assert not heavy & set(done.stdout.split())


def test_the_guide_runs_and_every_object_shows_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", GUIDE.read_text("utf-8"), re.DOTALL)
    assert len(blocks) == 5
    assert blocks[0].count("\n") < 25, "one screen"
    names: dict[str, typing.Any] = {}
    for block in blocks:
        exec(compile(block, str(GUIDE), "exec"), names)
    assert "levels[0]" in capsys.readouterr().out
    assert Image.open(tmp_path / "front.png").tobytes() == names["picture"].tobytes()
    assert names["picture"]._repr_png_().startswith(PNG)
    run = names["run"]
    assert "quick" in repr(names["suite"])
    assert "random" in run._repr_html_()
    assert set(run.estimates["model"]) == {"random", "goal-blind"}


def test_what_is_wrong_is_named() -> None:
    suite = phyblock.load_suite("quick", "limit=2")
    scene = phyblock.tasks("full_planning", limit=1)[0].item
    wrong: dict[str, typing.Callable[[], object]] = {
        "there is no such suite": lambda: phyblock.load_suite("quik"),
        "load_suite: suite: is too short": lambda: phyblock.load_suite(""),
        "--set limit=0": lambda: phyblock.load_suite("quick", "limit=0"),
        "has no such task": lambda: phyblock.tasks("full_planning", limit=1)["l9"],
        "render: show": lambda: phyblock.render(scene, show="all"),  # type: ignore[arg-type]
        "background is 'sea'": lambda: phyblock.render(scene, background="sea"),  # type: ignore[arg-type]
        "size_px is 5": lambda: phyblock.render(scene, size_px=5),
        "tasks: track": lambda: phyblock.tasks("full"),
        "tasks: split: has no questions": lambda: phyblock.tasks("vqa", split="train"),
        "tasks: split: takes no data": lambda: phyblock.tasks("vqa", split="dev", data="x"),
        "tasks: limit": lambda: phyblock.tasks("vqa", limit=0),
        "levels[0]": lambda: phyblock.tasks("full_planning", levels=[7]),
        "generate: count": lambda: phyblock.generate(0),
        "verify: scene": lambda: phyblock.verify("x"),  # type: ignore[arg-type]
        "run_suite: limit": lambda: phyblock.run_suite(suite, limit=0),
        "run_suite: models: has the wrong type": lambda: phyblock.run_suite(suite, models="random"),
        "run_suite: models[0]": lambda: phyblock.run_suite(suite, models=[1]),  # type: ignore[list-item]
        "run_suite: models: has too few items": lambda: phyblock.run_suite(suite, models=[]),
        "run_suite: out: is too short": lambda: phyblock.run_suite(suite, out=""),
        'found: "x"': lambda: phyblock.run_suite(suite, limit="x"),  # type: ignore[arg-type]
        "found: true": lambda: phyblock.run_suite(suite, limit=True),
        "render: scene": lambda: phyblock.render(suite),  # type: ignore[arg-type]
        "render: size_px": lambda: phyblock.render(scene, size_px=128.5),  # type: ignore[arg-type]
        "render: view": lambda: phyblock.render(scene, view=["front"]),  # type: ignore[arg-type]
        "load_suite: overrides": lambda: phyblock.load_suite("quick", 5),  # type: ignore[arg-type]
    }
    for said, call in wrong.items():
        with pytest.raises(SpecError, match=re.escape(said)):
            call()


def test_nothing_is_spent_unasked_and_a_loop_may_run(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(workspace.root)
    monkeypatch.setenv("OPENAI_API_KEY", "sk-nobody")
    (workspace.root / "billed.yaml").write_text(
        "paid: {id: openai/gpt-4o, api_base: 'http://127.0.0.1:9/v1', "
        "price: {input: 1, output: 1}}\n"
    )
    out = workspace.root / "paid"
    with pytest.raises(SpecError, match=r"nobody agreed(.|\n)*yes=True"):
        phyblock.run_suite("quick", models=["paid"], limit=1, out=out, models_file="billed.yaml")
    assert not out.exists()

    async def in_a_notebook() -> phyblock.Run:
        return phyblock.run_suite("quick", models=["random"], limit=2, out=out)

    run = asyncio.run(in_a_notebook())
    assert set(run.records["outcome"]) == {"ok"}
