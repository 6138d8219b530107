"""Paths as people give them on the command line."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import click

__all__ = ["NAME_OR_PATH", "UserPath", "models_file_option", "moved_data_option"]


class UserPath(click.Path):
    """A path with `~` for the home folder, a `pathlib.Path` unless `path_type` says otherwise.

    An empty one is refused: it comes from a variable that is not set, and would mean this folder.
    """

    def __init__(self, *, path_type: type[Any] = Path, **options: Any) -> None:
        super().__init__(path_type=path_type, **options)

    def convert(
        self,
        value: str | os.PathLike[str],
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> str | bytes | os.PathLike[str]:
        """The path that `value` means."""
        text = os.fspath(value)
        if not text:
            self.fail("it is empty: is a variable not set?", param, ctx)
        if "\0" in text:
            self.fail("a path cannot hold a zero byte", param, ctx)
        expanded = os.path.expanduser(text)
        if expanded.startswith("~"):
            self.fail(f"{text}: no such home folder is known (./{text} is here)", param, ctx)
        return super().convert(expanded, param, ctx)


NAME_OR_PATH = UserPath(path_type=str)
"""The name of something bundled, or a path, as text."""

models_file_option = click.option(
    "--models-file",
    type=NAME_OR_PATH,
    metavar="FILE",
    help="Models file instead of models.yaml.",
)

moved_data_option = click.option(
    "--data",
    type=UserPath(exists=True, file_okay=False),
    help="The data set, where it has moved.",
)
