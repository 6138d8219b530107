"""PyYAML's loader with the scalars of YAML 1.2's core schema, and the bounds of our own files."""

from __future__ import annotations

import re

from phyblock.bounded_yaml import TAG, BoundedLoader, YamlBounds

__all__ = ["BOUNDS", "CoreLoader"]

BOUNDS = YamlBounds(values=20_000, depth=64)


class CoreLoader(BoundedLoader):
    """A loader with the scalars of YAML 1.2's core schema."""

    def __init__(self, text: str) -> None:
        super().__init__(text, BOUNDS)


CoreLoader.yaml_implicit_resolvers = {}

for _kind, _pattern, _first in (
    ("null", r"^(?:~|null|Null|NULL|)$", ["~", "n", "N", ""]),
    ("bool", r"^(?:true|True|TRUE|false|False|FALSE)$", list("tTfF")),
    ("int", r"^(?:[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+)$", list("-+0123456789")),
    (
        "float",
        r"^(?:[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?"
        r"|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN))$",
        list("-+.0123456789"),
    ),
    ("merge", r"^<<$", ["<"]),
):
    CoreLoader.add_implicit_resolver(TAG + _kind, re.compile(_pattern), _first)
