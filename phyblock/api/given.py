"""Checks of arguments."""

from __future__ import annotations

from collections.abc import Mapping

from phyblock.errors import Problem, SpecError

__all__ = ["Kinds", "expect"]

Kinds = Mapping[str, tuple[object, type | tuple[type, ...], str]]
"""What was given, the types that it may have, and these in words, by the name of an argument."""


def expect(function: str, kinds: Kinds) -> None:
    """Raise SpecError for all arguments that are of another kind; a bool is no number."""
    problems = [
        Problem(function, "is of another kind", name, _shown(value), allowed)
        for name, (value, types, allowed) in kinds.items()
        if not isinstance(value, types) or (isinstance(value, bool) and bool not in _all(types))
    ]
    if problems:
        raise SpecError(problems)


def _all(types: type | tuple[type, ...]) -> tuple[type, ...]:
    return types if isinstance(types, tuple) else (types,)


def _shown(value: object) -> str:
    return f"{type(value).__name__} {value!r:.60}"
