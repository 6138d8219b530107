"""Groups of verbs that are imported only when they are called."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import click

__all__ = ["Verbs"]


class Verbs(click.Group):
    """A group whose verbs' names and help texts are known without importing any of them.

    `verbs` maps a name to its help. The verb is `command` in the module that `modules` names, else
    in the module `prefix` + name, with underscores for hyphens.
    """

    def __init__(
        self,
        *,
        verbs: Mapping[str, str],
        prefix: str,
        modules: Mapping[str, str] = MappingProxyType({}),
        **options: Any,
    ) -> None:
        super().__init__(**options)
        self._verbs = verbs
        self._prefix = prefix
        self._modules = modules

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The names, in the order given."""
        del ctx
        return list(self._verbs)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The verb, imported now; None for an unknown name."""
        del ctx
        if cmd_name not in self._verbs:
            return None
        module = self._modules.get(cmd_name, self._prefix + cmd_name.replace("-", "_"))
        command = importlib.import_module(module).command
        assert isinstance(command, click.Command)
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """As click does; an unknown name is refused with the known ones."""
        if args and args[0] not in self._verbs and not args[0].startswith("-"):
            known = ", ".join(self._verbs)
            raise click.UsageError(f"No such command {args[0]!r}. Commands: {known}", ctx)
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write names and help texts."""
        del ctx
        with formatter.section("Commands"):
            formatter.write_dl(list(self._verbs.items()))
