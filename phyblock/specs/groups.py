"""Groups of models: one name in a suite or on the command line for all that say they belong."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from phyblock.specs.model import ModelSpec

__all__ = ["GROUP", "HUMAN", "group_names", "unknown_model", "with_members"]

GROUP = "group:"
"""What stands before the name of a group where models are named."""
HUMAN = "human:"
"""What stands before the name of a person where models are named."""


def group_names(known: Mapping[str, ModelSpec]) -> tuple[str, ...]:
    """The groups that models belong to, in the order in which the file names them."""
    return tuple(dict.fromkeys(group for spec in known.values() for group in spec.groups))


def with_members(names: Sequence[str], known: Mapping[str, ModelSpec]) -> tuple[str, ...]:
    """The names with the members of a group in its place, each once; an unknown group stays."""
    groups = group_names(known)
    members: dict[str, None] = {}
    for name in names:
        group = name.removeprefix(GROUP)
        if name.startswith(GROUP) and group in groups:
            members |= {n: None for n, spec in known.items() if group in spec.groups}
        else:
            members[name] = None
    return tuple(members)


def unknown_model(name: str) -> str:
    """What is wrong with a name that is neither a model nor a group."""
    if name.startswith(GROUP):
        return "is no group of the models file"
    if name.startswith(HUMAN):
        return "is a person, who answers in `phyblock play`"
    return "is neither in the models file nor a built-in baseline"
