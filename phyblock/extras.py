"""Packages that only an extra installs."""

from __future__ import annotations

from importlib import import_module

from phyblock.errors import Problem, SpecError

__all__ = ["needs"]


def needs(package: str, extra: str, form: str) -> None:
    """Raise SpecError that names the extra to install where a package of a format is not there."""
    try:
        import_module(package)
    except ImportError as error:
        name, hint = package.partition(".")[0], f"pip install 'phyblock[{extra}]'"
        raise SpecError(Problem(f"--to {form}", f"needs the package {name}", hint=hint)) from error
