"""Lists of names as a person gives them: `A,B`."""

from __future__ import annotations

from phyblock.errors import Problem, SpecError

__all__ = ["split_names"]


def split_names(given: str | None) -> list[str]:
    """The names of `--models`, between commas; SpecError for an empty one."""
    if given is None:
        return []
    names = [name.strip() for name in given.split(",")]
    if not all(names):
        allowed = "names separated by single commas"
        raise SpecError(Problem("--models", "holds an empty name", "", repr(given), allowed))
    return names
