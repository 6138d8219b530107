"""The path of one sample: the modules that it goes through, those it imports."""

from __future__ import annotations

import subprocess
import sys
import threading
from pathlib import Path
from types import FrameType

import phyblock as package
from tests.servers.chassis import Running
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import call

ROOT = Path(package.__file__).parent
MOST_ENTERED = 24
"""As many as today; 20 is the aim."""
MOST_IMPORTED = 100

IMPORTED = (
    "import atexit, sys\n"
    "from phyblock.cli.main import main\n"
    "names = lambda: [name for name in sys.modules if name.partition('.')[0] == 'phyblock']\n"
    "atexit.register(lambda: print('modules', *names(), file=sys.stderr))\n"
    "main()\n"
)


def test_one_sample_goes_through_few_modules(inside):
    """From the arrival of the second request to that of the third: the end of one sample and the
    beginning of the next, in every thread.
    """
    workspace = inside
    workspace.write_suite(models=["alpha"], levels=[2, 3], settings=["A"])
    entered: set[str] = set()

    def profile(frame: FrameType, event: str, _: object) -> None:
        if event == "call" and len(server.seen) == 2:
            entered.add(frame.f_code.co_filename)

    with Running(server := OpenAIChat()) as running:
        workspace.write_models(running.url, "alpha", max_concurrency=1)
        threading.setprofile(profile)
        sys.setprofile(profile)
        try:
            call("run", "suite.yaml", "--out", "out")
        finally:
            sys.setprofile(None)
            threading.setprofile(None)
    assert server.requests == 4
    modules = {Path(name).relative_to(ROOT) for name in entered if name.startswith(str(ROOT))}
    assert Path("models/model.py") in modules
    assert len(modules) <= MOST_ENTERED, " ".join(sorted(map(str, modules)))


def test_one_sample_of_a_baseline_imports_few_modules(workspace):
    workspace.write_suite(models=["random"], levels=[2], settings=["A"])
    command = [sys.executable, "-c", IMPORTED, "run", "suite.yaml", "--limit", "1", "--out", "out"]
    done = subprocess.run(
        command, cwd=workspace.root, env=workspace.env, capture_output=True, text=True, check=True
    )
    modules = done.stderr.rpartition("modules ")[2].split()
    assert "phyblock.tracks.full_planning" in modules
    assert len(modules) <= MOST_IMPORTED, sorted(modules)
