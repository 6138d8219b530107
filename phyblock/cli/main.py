"""The `phyblock` command: subcommands, plugins, and exit codes of errors."""

from __future__ import annotations

import gc
import importlib
import os
import sys
import traceback
from importlib.metadata import entry_points

import click

from phyblock.errors import InputError, PhyblockError, Problem, SpecError, StoreError, reason_of
from phyblock.registry import PLUGINS
from phyblock.text import counted, did_you_mean, plain_lines
from phyblock.types import QUOTE_HINT

_SECTIONS = {
    "Run": {
        "init": ("cli.setup", "Create a folder: a suite, models.yaml, prompts."),
        "validate": ("cli.setup", "Check suites, models files and data sets."),
        "models": ("cli.setup", "List models with prices and keys."),
        "cache": ("cli.setup", "List replies kept for other runs, or delete some."),
        "run": ("cli.run", "Run a suite, or continue where it stopped."),
        "play": ("cli.run", "Answer a suite yourself, in a browser."),
        "score": ("cli.run", "Score stored replies again; calls no model."),
    },
    "Look": {
        "report": ("cli.results", "Rebuild tables and page, or print the tables."),
        "show": ("cli.results", "Show a sample: prompt, reply, verdict of each step."),
        "compare": ("cli.results", "Compare models on the same samples."),
        "figures": ("cli.results", "Draw figures for a paper, as PDF and SVG."),
    },
    "Share": {
        "export": ("integrations.cli", "Write a run, scenes or questions for other tools."),
        "bundle": ("cli.results", "Write a run as one file that others can verify."),
        "verify": ("cli.results", "Score a bundle again and compare."),
        "site": ("cli.results", "Make a leaderboard of runs and bundles."),
    },
    "Data": {
        "scenes": ("making.cli", "Make, check, show and draw scenes."),
        "questions": ("making.cli", "Make, check and show questions."),
    },
}
"""Commands by the heading in the help: each with its module in phyblock and its help text."""
_VERBS = {name: verb for verbs in _SECTIONS.values() for name, verb in verbs.items()}


def _load_plugins(_: click.Context, __: click.Parameter, modules: tuple[str, ...]) -> None:
    """Import plugins while the options of `phyblock` are parsed, before those of a command.

    Raises SpecError naming the line in which one fails.
    """
    entries = entry_points(group="phyblock.plugins")
    named = {entry.value.partition(":")[0]: f"plugin {entry.name}" for entry in entries}
    if modules and os.getcwd() not in sys.path:
        sys.path.insert(0, os.getcwd())
    for module in dict.fromkeys([*named, *modules]):
        try:
            importlib.import_module(module)
        except Exception as error:
            last = traceback.extract_tb(error.__traceback__)[-1]
            place = "" if last.filename.startswith("<") else f" ({last.filename}:{last.lineno})"
            message = f"cannot be imported: {type(error).__name__}: {error}{place}"
            where = named.get(module, "--plugin")
            raise SpecError(Problem(where, message, found=module)) from error
        PLUGINS.append(module)


class _Verbs(click.Group):
    """The commands, whose names and help texts are known without importing them."""

    def list_commands(self, _: click.Context) -> list[str]:
        return list(_VERBS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command:
        if cmd_name not in _VERBS:
            hint = did_you_mean(cmd_name, _VERBS) or f"Commands: {', '.join(_VERBS)}"
            raise click.UsageError(f"No such command {cmd_name!r}. {hint.capitalize()}", ctx)
        module = importlib.import_module(f"phyblock.{_VERBS[cmd_name][0]}")
        command: click.Command = getattr(module, cmd_name)
        return command

    def format_commands(self, _: click.Context, formatter: click.HelpFormatter) -> None:
        width = max(map(len, _VERBS))
        for heading, verbs in _SECTIONS.items():
            with formatter.section(heading):
                formatter.write_dl([(f"{name:{width}}", verb[1]) for name, verb in verbs.items()])


@click.group(
    cls=_Verbs,
    context_settings={
        "help_option_names": ["-h", "--help"],
        "max_content_width": 80,
        "show_default": True,
    },
    epilog="Start with: phyblock run quick",
)
@click.option(
    "--plugin",
    multiple=True,
    expose_value=False,
    callback=_load_plugins,
    metavar="MODULE",
    help="Import a Python module that adds shapes, tracks, measures, ...; may be repeated.",
)
@click.version_option(None, "-V", "--version", package_name="phyblock", prog_name="phyblock")
def phyblock() -> None:
    """Test vision-language models on PhyBlock: 3D block assembly from pictures."""


def main() -> None:
    """Run the command line; exit code 2 for bad input, 1 for a failure, 130 for Ctrl-C."""
    # Objects of modules and data stay. Garbage collection at Python's default intervals takes a
    # tenth of a short command; at much longer ones, garbage of calls to models accumulates.
    gc.set_threshold(5_000, 10, 10)
    for stream in (sys.stdout, sys.stderr):
        # A terminal without a plus-minus sign must show a question mark, not fail.
        stream.reconfigure(errors="replace")  # type: ignore[union-attr]
    try:
        code = phyblock.main(prog_name="phyblock", standalone_mode=False)
        sys.stdout.flush()
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message())
        sys.exit(0)
    except click.ClickException as error:
        error.show()
        context = getattr(error, "ctx", None)
        takes_set = context and any(param.name == "sets" for param in context.command.params)
        if takes_set and "unexpected extra argument" in error.format_message():
            click.echo(f"Hint: {QUOTE_HINT}", err=True)
        elif takes_set and isinstance(error, click.NoSuchOption):
            from phyblock.config.suite import suite_model

            name = error.option_name.lstrip("-").replace("-", "_")
            field = suite_model().model_fields.get(name)
            form = f"{name}=VALUE" if field else "KEY=VALUE"
            form = f"'{name}=[...]'" if field and isinstance(field.default, tuple) else form
            click.echo(f"Hint: fields of the suite are set with --set {form}", err=True)
        sys.exit(2)
    except click.Abort:
        click.echo("Interrupted.", err=True)
        sys.exit(130)
    except InputError as error:
        show_problems(error)
        sys.exit(2)
    except PhyblockError as error:
        click.echo(plain_lines(f"error: {error}"), err=True)
        sys.exit(1)
    except BrokenPipeError:
        # The reader of the output has closed it, as `| head` does.
        _drop_output()
        sys.exit(1)
    except OSError as error:
        _drop_output()
        where = "output" if error.filename is None else os.fsdecode(error.filename)
        show_problems(StoreError(Problem(where, f"cannot be used: {reason_of(error)}")))
        sys.exit(2)
    sys.exit(code if isinstance(code, int) else 0)


def _drop_output() -> None:
    """Drop unwritten standard output, or the interpreter would try to write it again."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, sys.stdout.fileno())
    os.close(nowhere)


def show_problems(error: InputError, most: int = 25) -> None:
    """Print the problems, at most `most` of them."""
    for problem in error.problems[:most]:
        click.secho("error: ", fg="red", bold=True, nl=False, err=True)
        click.echo(plain_lines(str(problem)), err=True)
    if (more := len(error.problems) - most) > 0:
        click.echo(f"... and {counted(more, 'more problem')}", err=True)
