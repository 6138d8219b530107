"""Finding the files a person means: suites by name, the models file, run folders."""

from __future__ import annotations

import os
from pathlib import Path

from phyblock.errors import Problem, SpecError
from phyblock.resources import bundled
from phyblock.text import did_you_mean

__all__ = [
    "bundled_suites",
    "find_models_file",
    "find_suite",
    "prompt_dirs",
    "what_it_is",
]


def bundled_suites() -> list[str]:
    """Names of the suites that come with the project, sorted."""
    return sorted(path.stem for path in bundled("benchmarks").glob("*.yaml"))


def find_suite(name: str) -> Path:
    """The suite file that `name` means: a path, or the name of a bundled suite.

    Raises SpecError that lists the bundled suites when there is no such file, or for a prompt.
    """
    path = Path(name)
    if os.path.isfile(path):
        if path.suffix == ".j2":
            hint = "name the suite that uses it: its prompts are rendered"
            raise SpecError(Problem(name, "is a prompt, not a suite", hint=hint))
        return path
    if not name.strip():
        allowed = "a suite file, or a bundled suite: " + ", ".join(bundled_suites())
        raise SpecError(Problem("suite", "is empty", found=repr(name), allowed=allowed))
    if path.suffix in ("", ".yaml") and path.parent == Path():
        inside = bundled("benchmarks", f"{path.stem}.yaml")
        if os.path.isfile(inside):
            return inside
    names = bundled_suites()
    hint = did_you_mean(path.stem, names)
    allowed = "a suite file, or a bundled suite: " + ", ".join(names)
    message = what_it_is(path) or "there is no such suite"
    raise SpecError(Problem(name, message, allowed=allowed, hint=hint))


def what_it_is(path: Path) -> str:
    """Why something that is no file cannot be read; "" where there is nothing at all."""
    if os.path.isdir(path):
        return "is a folder"
    return "is not a regular file" if os.path.exists(path) else ""


def find_models_file(named: str | None, suite: Path | None) -> Path:
    """The models file: the one named, else models.yaml here, near the suite, or the bundled one.

    Raises SpecError when the one named is not there.
    """
    if named is not None:
        if os.path.isfile(named):
            return Path(named)
        message = what_it_is(Path(named)) or "there is no such models file"
        raise SpecError(Problem(named, message))
    for folder in _near(suite):
        if os.path.isfile(folder / "models.yaml"):
            return folder / "models.yaml"
    return bundled("models.yaml")


def prompt_dirs(suite: Path) -> list[Path]:
    """Folders of prompts of one's own: where the models file is looked for, too."""
    return [folder / "prompts" for folder in _near(suite)]


def _near(suite: Path | None) -> list[Path]:
    """Here, and near the suite."""
    return [Path(), *([] if suite is None else [suite.parent, suite.parent.parent])]
