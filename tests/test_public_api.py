"""What a notebook may import, and what it costs."""

from __future__ import annotations

import subprocess
import sys

import phyblock


def test_public_names_are_these() -> None:
    assert phyblock.__all__ == ["Run", "load_run"]
    assert all(getattr(phyblock, name).__doc__ for name in phyblock.__all__)


def test_importing_phyblock_imports_nothing_heavy() -> None:
    code = "import phyblock, sys; print(*sorted({name.split('.')[0] for name in sys.modules}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    heavy = {"numpy", "pandas", "litellm", "pybullet", "aiohttp", "pydantic", "yaml", "click"}
    assert not heavy & set(done.stdout.split())
