"""Finding the files a person means: suites by name, the models file, run folders."""

from __future__ import annotations

from pathlib import Path

from phyblock.errors import Problem, SpecError
from phyblock.resources import bundled
from phyblock.specs import did_you_mean

__all__ = ["find_models_file", "find_suite"]


def find_suite(name: str) -> Path:
    """The suite file that `name` means: a path, or the name of a bundled suite.

    Raises SpecError that lists the bundled suites when there is no such file.
    """
    path = Path(name)
    if path.is_file():
        return path
    if path.suffix in ("", ".yaml") and path.parent == Path():
        inside = bundled("benchmarks", f"{path.stem}.yaml")
        if inside.is_file():
            return inside
    names = sorted(p.stem for p in bundled("benchmarks").glob("*.yaml"))
    hint = did_you_mean(path.stem, names)
    allowed = "a suite file, or a bundled suite: " + ", ".join(names)
    message = "is a folder" if path.is_dir() else "there is no such suite"
    raise SpecError(Problem(name, message, allowed=allowed, hint=hint))


def find_models_file(named: str | None, suite: Path | None) -> Path:
    """The models file: the one named, else models.yaml here, near the suite, or the bundled one.

    Raises SpecError when the one named is not there.
    """
    if named is not None:
        if Path(named).is_file():
            return Path(named)
        raise SpecError(Problem(named, "there is no such models file"))
    near = [] if suite is None else [suite.parent, suite.parent.parent]
    for folder in (Path(), *near):
        if (folder / "models.yaml").is_file():
            return folder / "models.yaml"
    return bundled("models.yaml")
