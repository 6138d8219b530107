"""Shared parts of verbs: groups that import a verb when it is called, paths, names and options."""

from __future__ import annotations

import importlib
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from phyblock.errors import Problem, SpecError

Sections = Mapping[str, Mapping[str, tuple[str, str]]]
"""Verbs by the heading that help lists them under: where each is (`module:name`), and its help."""


class Verbs(click.Group):
    """A group whose verbs' names and help texts are known without importing any of them."""

    def __init__(self, *, sections: Sections, **options: Any) -> None:
        super().__init__(**options)
        self._sections = sections
        self._verbs = {name: verb for part in sections.values() for name, verb in part.items()}

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names, in the order of help."""
        del ctx
        return list(self._verbs)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return the verb, imported now; None for an unknown name."""
        if cmd_name not in self._verbs:
            return None
        module, _, name = self._verbs[cmd_name][0].partition(":")
        command = getattr(importlib.import_module(module), name)
        assert isinstance(command, click.Command)
        command.name = cmd_name
        del ctx
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Resolve as click does; refuse an unknown name with the known ones."""
        if args and args[0] not in self._verbs and not args[0].startswith("-"):
            known = ", ".join(self._verbs)
            raise click.UsageError(f"No such command {args[0]!r}. Commands: {known}", ctx)
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write names and help texts under their headings."""
        del ctx
        width = max(map(len, self._verbs))
        for heading, verbs in self._sections.items():
            with formatter.section(heading):
                formatter.write_dl([(f"{name:{width}}", verb[1]) for name, verb in verbs.items()])


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
        """Return the path that `value` means."""
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

run_argument = click.argument("run", type=UserPath())
models_file_option = click.option(
    "--models-file",
    type=NAME_OR_PATH,
    metavar="FILE",
    help="Models file instead of models.yaml.",
)
data_option = click.option(
    "--data",
    type=UserPath(exists=True, file_okay=False),
    metavar="DIR",
    help="The data set, where it has moved.",
)
data_folders_option = click.option(
    "--data",
    type=UserPath(),
    metavar="DIR",
    multiple=True,
    help="A folder of data that the run needs; may be given again.",
)
sets_option = click.option(
    "--set", "sets", multiple=True, metavar="KEY=VALUE", help="Override a value of the suite."
)
limit_option = click.option(
    "--limit", type=click.IntRange(min=1), metavar="N", help="N scenes, spread over levels."
)
yes_option = click.option("--yes", is_flag=True, help="Spend money without asking.")


def split_names(given: str | None) -> list[str]:
    """Return the names of `A,B`; SpecError for an empty one."""
    if given is None:
        return []
    names = [name.strip() for name in given.split(",")]
    if not all(names):
        allowed = "names separated by single commas"
        raise SpecError(Problem("--models", "holds an empty name", "", repr(given), allowed))
    return names
