"""Help texts: at once, complete, without importing what the verbs need."""

from __future__ import annotations

import subprocess
import sys

import pytest

from phyblock.cli.main import phyblock as group
from phyblock.sim.registry import ENGINES

VERBS = tuple(group.list_commands(None))  # type: ignore[arg-type]
LIBRARIES = (engine.library for engine in ENGINES.values())
HEAVY = ("litellm", *LIBRARIES, "pandas", "aiohttp", "matplotlib", "phyblock_making")
SCRIPT = """
import atexit, sys
sys.argv = ["phyblock", *sys.argv[1:]]
atexit.register(lambda: sys.stderr.write(" ".join({n.split(".")[0] for n in sys.modules})))
from phyblock.cli.main import main
main()
"""


def ask(*args: str) -> tuple[str, set[str]]:
    """What a command prints, and the packages that it imported."""
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, *args], capture_output=True, text=True, check=True
    )
    return done.stdout, set(done.stderr.split())


def test_help_names_every_verb_and_imports_nothing_heavy() -> None:
    told, imported = ask("--help")
    for verb in VERBS:
        assert f"\n  {verb} " in told
    assert "phyblock run quick" in told
    assert not imported & {*HEAVY, "numpy", "pydantic", "rich", "yaml"}


@pytest.mark.parametrize("verb", ["run", "report", "score", "validate", "models", "cache", "init"])
def test_help_of_a_verb_imports_nothing_heavy(verb: str) -> None:
    told, imported = ask(verb, "--help")
    assert told.startswith(f"Usage: phyblock {verb} ")
    assert not imported & set(HEAVY)


def test_version() -> None:
    told, imported = ask("--version")
    assert told.startswith("phyblock, version ")
    assert not imported & set(HEAVY)
