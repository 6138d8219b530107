"""The `phyblock` command: verbs are loaded only when they are called."""

from __future__ import annotations

import importlib
import sys

import click

from phyblock.errors import InputError, PhyblockError

__all__ = ["main"]

_VERBS = {
    "run": "Run a suite, or go on where it stopped.",
    "score": "Read and score stored replies again; calls no model.",
    "report": "Write a run's tables again from its records.",
    "models": "List models with kinds, prices and keys; check one.",
    "validate": "Check suites, models files and data sets.",
    "cache": "Show or clear the reply cache.",
    "init": "Lay out a working folder: a suite, models.yaml, prompts.",
}


class _Verbs(click.Group):
    """Names and help texts are known without importing any verb."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        del ctx
        return list(_VERBS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        del ctx
        if cmd_name not in _VERBS:
            return None
        command = importlib.import_module(f"phyblock.cli.{cmd_name}").command
        assert isinstance(command, click.Command)
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if args and args[0] not in _VERBS and not args[0].startswith("-"):
            known = ", ".join(_VERBS)
            raise click.UsageError(f"No such command {args[0]!r}. Commands: {known}", ctx)
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        del ctx
        with formatter.section("Commands"):
            formatter.write_dl(list(_VERBS.items()))


@click.group(
    cls=_Verbs,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="Start with: phyblock run quick",
)
@click.version_option(None, "-V", "--version", package_name="phyblock", prog_name="phyblock")
def phyblock() -> None:
    """Test vision-language models on PhyBlock: 3D block assembly from pictures."""


def main() -> None:
    """Run the command line; exit code 2 for bad input, 1 for a failure, 130 for Ctrl-C."""
    for stream in (sys.stdout, sys.stderr):
        # A terminal that knows no plus-minus sign shall show a question mark, not fail.
        stream.reconfigure(errors="replace")  # type: ignore[union-attr]
    try:
        code = phyblock.main(prog_name="phyblock", standalone_mode=False)
    except click.ClickException as error:
        error.show()
        sys.exit(2)
    except click.Abort:
        sys.exit(130)
    except InputError as error:
        _complain(error)
        sys.exit(2)
    except PhyblockError as error:
        click.echo(f"error: {error}", err=True)
        sys.exit(1)
    sys.exit(code if isinstance(code, int) else 0)


def _complain(error: InputError) -> None:
    shown = error.problems[:_SHOWN]
    for problem in shown:
        click.echo(click.style("error: ", fg="red", bold=True) + str(problem), err=True)
    if len(error.problems) > len(shown):
        click.echo(f"... and {len(error.problems) - len(shown)} more problems", err=True)


_SHOWN = 25
