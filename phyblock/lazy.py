"""Names of a package that are imported when they are first used."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Mapping

__all__ = ["lazy_names"]


def lazy_names(package: str, homes: Mapping[str, str]) -> Callable[[str], object]:
    """The `__getattr__` of a package (PEP 562) whose names have their homes in other modules.

    `homes` gives each name its module, or `module:name` where it is called otherwise there. What is
    returned raises AttributeError for any other name.
    """

    def get(name: str) -> object:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        module, _, called = homes[name].partition(":")
        value: object = getattr(importlib.import_module(module), called or name)
        setattr(sys.modules[package], name, value)
        return value

    return get
