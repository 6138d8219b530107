"""Shared parts of verbs: groups that import a verb when it is called, paths, names and options."""

from __future__ import annotations

import importlib
import os
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from phyblock.text import did_you_mean
from phyblock.types import QUOTE_HINT

if TYPE_CHECKING:
    from phyblock.workers import Shards

INTERRUPTED = 130
"""The exit code after Ctrl-C."""
Sections = Mapping[str, Mapping[str, tuple[str, str]]]
"""Verbs by the heading that help lists them under: where each is (`module:name`), and its help."""


class Verbs(click.Group):
    """A group whose verbs' names and help texts are known without importing any of them."""

    def __init__(self, *, sections: Sections, **options: Any) -> None:
        super().__init__(**options)
        self._sections = sections
        self._verbs = {name: verb for part in sections.values() for name, verb in part.items()}

    def list_commands(self, _: click.Context) -> list[str]:
        """Return the names, in the order of help."""
        return list(self._verbs)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command:
        """Return the verb, imported now; UsageError for an unknown name."""
        if cmd_name not in self._verbs:
            hint = did_you_mean(cmd_name, self._verbs) or f"Commands: {', '.join(self._verbs)}"
            raise click.UsageError(f"No such command {cmd_name!r}. {hint.capitalize()}", ctx)
        module, _, name = self._verbs[cmd_name][0].partition(":")
        command: click.Command = getattr(importlib.import_module(module), name)
        return command

    def format_commands(self, _: click.Context, formatter: click.HelpFormatter) -> None:
        """Write names and help texts under their headings."""
        width = max(map(len, self._verbs))
        for heading, verbs in self._sections.items():
            with formatter.section(heading):
                formatter.write_dl([(f"{name:{width}}", verb[1]) for name, verb in verbs.items()])


class UserPath(click.Path):
    """A path with `~` for the home folder; an empty one, as from an unset variable, is refused."""

    def __init__(self, *, path_type: type[Any] = Path, **options: Any) -> None:
        super().__init__(path_type=path_type, **options)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the path that `value` means."""
        if not os.fspath(value):
            self.fail("it is empty: is a variable not set?", param, ctx)
        return super().convert(os.path.expanduser(value), param, ctx)


class Names(click.ParamType[Any]):
    """Names separated by single commas."""

    name = "names"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the names."""
        names = [name.strip() for name in value.split(",")] if isinstance(value, str) else value
        if not all(names):
            self.fail(f"{value!r} holds an empty name: {QUOTE_HINT}", param, ctx)
        return names


class ShardType(click.ParamType[tuple[int, int]]):
    """A shard and the number of all, as in 3/64."""

    name = "shard"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, int]:
        """Return the two numbers."""
        found = re.fullmatch(r"([1-9]\d{0,4})/([1-9]\d{0,4})", value)
        if found is None or int(found[1]) > int(found[2]):
            self.fail(f"{value!r} is no shard: 3/64 is the third of 64", param, ctx)
        return int(found[1]), int(found[2])


def jobs_option(default: int | None = None) -> Callable[..., Any]:
    """Return the option `--jobs`, by default all processors."""
    return click.option(
        *("--jobs", "-j"),
        type=click.IntRange(1, 256),
        default=default or os.cpu_count() or 1,
        show_default=True if default else "all processors",
        metavar="N",
        help="Processes.",
    )


_CLUSTER_OPTIONS = (
    click.option(
        *("--ray", "ray_address"),
        metavar="ADDRESS",
        help="Work on this Ray cluster; local: on one of N workers here.",
    ),
    click.option(
        "--shard",
        type=ShardType(),
        metavar="I/N",
        help="Be shard I of N programs that share the work through OUT.shards.",
    ),
)


def worker_options(jobs: int | None = None) -> Callable[[Any], Any]:
    """Return a decorator that adds the options of a verb that works in parallel."""

    def add(command: Any) -> Any:
        for option in reversed((jobs_option(jobs), *_CLUSTER_OPTIONS)):
            command = option(command)
        return command

    return add


def shards_folder(out: Path) -> Path:
    """Return the folder that the shards of what goes to `out` share."""
    return out.with_name(f"{out.name}.shards")


def open_shards(shard: tuple[int, int] | None, out: Path, work: str) -> Shards | None:
    """Return the shard that was asked for, if any; StoreError in a folder of other work."""
    from phyblock.workers import Shards

    return None if shard is None else Shards(shards_folder(out), *shard, work)


def left_to_first(shards: Shards | None, out: Path) -> bool:
    """True, with a word of it, if another shard writes what was made."""
    from phyblock.cli.console import shown_path

    if shards is None or shards.writes:
        return False
    click.echo(f"shard {shards.number}/{shards.count} is done; the first writes {shown_path(out)}")
    return True


def models_option(help_text: str) -> Callable[..., Any]:
    """Return the option `--models`."""
    return click.option("--models", type=Names(), default=(), metavar="A,B", help=help_text)


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
run_out_option = click.option(
    "--out",
    type=UserPath(),
    metavar="DIR",
    help="Folder of the run. [default: results/SUITE-DIGEST]",
)
sets_option = click.option(
    "--set", "sets", multiple=True, metavar="KEY=VALUE", help="Override a value of the suite."
)
limit_option = click.option(
    "--limit", type=click.IntRange(min=1), metavar="N", help="N scenes, spread over levels."
)
yes_option = click.option("--yes", is_flag=True, help="Spend money without asking.")
