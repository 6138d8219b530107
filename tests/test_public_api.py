"""What a notebook may import, and what it costs."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import version

import pytest

import phyblock


def test_public_names_are_these_and_completion_finds_them() -> None:
    assert phyblock.__all__ == ["Run", "__version__", "load_run"]
    assert all(getattr(phyblock, name).__doc__ for name in phyblock.__all__)
    assert set(phyblock.__all__) <= set(dir(phyblock))
    assert phyblock.__version__ == version("phyblock")
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        _ = phyblock.nothing


def test_importing_phyblock_imports_nothing_heavy() -> None:
    code = "import phyblock, sys; print(*sorted({name.split('.')[0] for name in sys.modules}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    heavy = {
        "numpy",
        "pandas",
        "litellm",
        "pybullet",
        "mujoco",
        "aiohttp",
        "pydantic",
        "yaml",
        "click",
    }
    assert not heavy & set(done.stdout.split())
