"""Dependencies are declared, pinned with hashes, and licensed."""

import ast
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

from phyblock.sim.engine import ENGINES

ROOT = Path(__file__).parents[1]
LOCKS = ("requirements.lock", "requirements-dev.lock")
MODULES = {
    "PIL": "pillow",
    "pydantic_core": "pydantic-core",
    "sklearn": "scikit-learn",
    "typing_extensions": "typing-extensions",
    "yaml": "pyyaml",
    **{name: engine.distribution for name, engine in ENGINES.items()},
}
"""Import names that differ from the package's."""


def blocks(lock):
    """One requirement each, with its hashes."""
    text = (ROOT / lock).read_text(encoding="utf-8").replace("\\\n", " ")
    return [line for line in text.splitlines() if line.strip()]


def declared():
    """Every requirement in pyproject.toml by the name of its package."""
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    found = re.findall(r'"([A-Za-z][A-Za-z0-9_.-]*)((?:\[[a-z,]+\])?[<>=!][^"]*)"', text)
    return {name.lower(): bounds for name, bounds in found}


@pytest.mark.parametrize("lock", LOCKS)
def test_every_requirement_is_pinned_with_hashes_and_names_no_host(lock):
    pinned = r"[a-z0-9._-]+(\[[a-z0-9,-]+\])?==\S+ .*--hash=sha256:[0-9a-f]{64}( |$)"
    assert not [block[:60] for block in blocks(lock) if not re.match(pinned, block)]
    assert "://" not in (ROOT / lock).read_text(encoding="utf-8")


def pins(lock):
    """Versions by package, and on which Pythons where there are several."""
    whole = [block.split(" --hash")[0].strip() for block in blocks(lock)]
    several = Counter(pin.partition("==")[0] for pin in whole)
    return {pin if several[pin.partition("==")[0]] > 1 else pin.split(" ;")[0] for pin in whole}


def test_lock_files_agree_and_are_installed_with_their_hashes():
    """In one version, tests may have it on more Pythons: an extra brings it there, too."""
    runs, tests = map(pins, LOCKS)
    assert runs <= tests
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for lock in LOCKS:
        assert f"$(PIP) --require-hashes --requirement {lock}" in makefile
    # litellm ends below its next major version.
    assert declared()["litellm"] == ">=1.83.10,!=1.82.7,!=1.82.8,<2"


def test_every_package_that_is_imported_is_declared():
    imported = set()
    for path in (ROOT / "phyblock").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                imported |= {name.name.partition(".")[0] for name in node.names}
            elif isinstance(node, ast.ImportFrom) and not node.level:
                imported.add(str(node.module).partition(".")[0])
    outside = imported - sys.stdlib_module_names - {"phyblock"}
    missing = {name for name in outside if MODULES.get(name, name).lower() not in declared()}
    assert not missing


def test_every_data_set_names_its_licence():
    terms = (ROOT / "LICENSE").read_text(encoding="utf-8")
    folders = [path for path in (ROOT / "benchmarks" / "data").iterdir() if path.is_dir()]
    assert folders
    assert all(terms in (path / "LICENSE").read_text(encoding="utf-8") for path in folders)


def test_nothing_that_is_built_is_tracked():
    """Pages, scripts of others and runs are made here; what is tracked is what people wrote."""
    words = ["git", "-C", str(ROOT), "ls-files", "-z"]
    listed = subprocess.run(words, capture_output=True, text=True, check=False)
    if listed.returncode:
        pytest.skip("not a git checkout")
    files = [Path(name) for name in listed.stdout.split("\0") if name]
    folders = {file.parts[0] for file in files if len(file.parts) > 1}
    known = {".ci", "benchmarks", "docs", "prompts", "results", "tests", "phyblock"}
    assert folders <= known
    # three.js is shipped as it is published, with its license.
    ours = [file for file in files if file.parent.name != "three"]
    assert not [file for file in ours if re.search(r"\.min\.|\.map$", file.name)]
    assert [file for file in files if file.parts[0] == "results"] == [Path("results/README.md")]


def test_tests_that_are_named_are_there():
    texts = [ROOT / "SECURITY.md", ROOT / "CONTRIBUTING.md", ROOT / ".ci" / "pythons"]
    texts += (ROOT / "docs").rglob("*.md")
    named = re.findall(r"tests/[\w/]+\.py", "".join(text.read_text("utf-8") for text in texts))
    assert named
    assert [name for name in named if not (ROOT / name).is_file()] == []
