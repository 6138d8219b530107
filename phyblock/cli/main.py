"""The `phyblock` command: verbs are loaded only when they are called."""

from __future__ import annotations

import gc
import os
import re
import sys
from collections import Counter

import click

from phyblock.cli.verbs import Verbs
from phyblock.errors import InputError, PhyblockError, Problem, StoreError, reason_of
from phyblock.text import counted, plain_lines
from phyblock.types import QUOTE_HINT

__all__ = ["main", "show_problems"]

_VERBS = {
    "run": "Run a suite, or continue where it stopped.",
    "play": "Answer a suite yourself, in a browser, as models do.",
    "score": "Read and score stored replies again; calls no model.",
    "report": "Write a run's tables again from its records.",
    "tables": "Print a run's tables; beside the paper's with --paper.",
    "figures": "Draw a run's figures for a paper, as PDF and SVG.",
    "compare": "Compare models on the same samples: difference, interval, verdict.",
    "export": "Write a run for Inspect AI, Hugging Face datasets, or as CSV or Parquet.",
    "bundle": "Write a run as one file that others can score again.",
    "verify-bundle": "Score a bundle again and say whether it comes out the same.",
    "site": "Put runs and bundles into a static leaderboard.",
    "episode": "Show an episode step by step, as text or as a GIF.",
    "export-data": "Write questions with pictures for VLMEvalKit or Hugging Face.",
    "models": "List models with kinds, prices and keys; check one.",
    "validate": "Check suites, models files and data sets.",
    "scenes": "Make, check, show and draw scenes.",
    "vqa": "Make, check and show questions about scenes.",
    "cache": "Show or clear the reply cache.",
    "init": "Lay out a working folder: a suite, models.yaml, prompts.",
}


_MADE_ELSEWHERE = {
    "scenes": "phyblock.making.cli.scenes_verbs",
    "vqa": "phyblock.making.cli.vqa_verbs",
}
"""Verbs of the package beside this one, which the runner never imports but by these names."""


@click.group(
    cls=Verbs,
    verbs=_VERBS,
    prefix="phyblock.cli.",
    modules=_MADE_ELSEWHERE,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="Start with: phyblock run quick",
)
@click.version_option(None, "-V", "--version", package_name="phyblock", prog_name="phyblock")
def phyblock() -> None:
    """Test vision-language models on PhyBlock: 3D block assembly from pictures."""


_LOOSE_END = re.compile(r"unexpected extra argument")
"""What click says of a value that the shell took apart."""
_VALUES = re.compile(r"=|,$")
"""What values have that are often written with spaces: `KEY=[A, B]`, `A, B`."""


def main() -> None:
    """Run the command line; exit code 2 for bad input, 1 for a failure, 130 for Ctrl-C."""
    # What is made while modules load and data are read stays. Looking through it for garbage at
    # Python's own intervals takes a tenth of a short command; at much longer ones, what calls to
    # models leave behind piles up.
    gc.set_threshold(5_000, 10, 10)
    for stream in (sys.stdout, sys.stderr):
        # A terminal that knows no plus-minus sign shall show a question mark, not fail.
        stream.reconfigure(errors="replace")  # type: ignore[union-attr]
    try:
        code = phyblock.main(prog_name="phyblock", standalone_mode=False)
        sys.stdout.flush()
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message())
        sys.exit(0)
    except click.ClickException as error:
        error.show()
        has_values = any(map(_VALUES.search, sys.argv[1:]))
        if has_values and _LOOSE_END.search(error.format_message()):
            click.echo(f"Hint: {QUOTE_HINT}", err=True)
        sys.exit(2)
    except click.Abort:
        sys.exit(130)
    except InputError as error:
        show_problems(error)
        sys.exit(2)
    except PhyblockError as error:
        click.echo(plain_lines(f"error: {error}"), err=True)
        sys.exit(1)
    except BrokenPipeError:
        # Who read the output has seen enough: `| head`.
        _drop_output()
        sys.exit(1)
    except OSError as error:
        _drop_output()
        where = "output" if error.filename is None else os.fsdecode(error.filename)
        show_problems(StoreError(Problem(where, f"cannot be used: {reason_of(error)}")))
        sys.exit(2)
    sys.exit(code if isinstance(code, int) else 0)


def _drop_output() -> None:
    """Give up what standard output refuses to take, or the interpreter would try again."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, sys.stdout.fileno())
    os.close(nowhere)


def show_problems(error: InputError) -> None:
    """Show the problems, of those that are alike the first alone."""
    alike = Counter(_kind(problem) for problem in error.problems)
    shown: Counter[tuple[str, str]] = Counter()
    for problem in error.problems:
        kind = _kind(problem)
        if shown.total() == _SHOWN or shown[kind] == _SHOWN_ALIKE:
            continue
        shown[kind] += 1
        click.echo(
            click.style("error: ", fg="red", bold=True) + plain_lines(str(problem)), err=True
        )
        if shown[kind] == _SHOWN_ALIKE < alike[kind]:
            more = f"... and {alike[kind] - _SHOWN_ALIKE:,} more like it"
            click.echo(plain_lines(f"{more}: {': '.join(filter(None, kind))}"), err=True)
    n_shown = sum(alike[kind] if shown[kind] == _SHOWN_ALIKE else shown[kind] for kind in alike)
    if len(error.problems) > n_shown:
        more = counted(len(error.problems) - n_shown, "more problem")
        click.echo(f"... and {more}", err=True)


def _kind(problem: Problem) -> tuple[str, str]:
    """What problems of many places have in common: the field, whatever its index, and the words."""
    return re.sub(r"\[\d+\]", "[]", problem.field), problem.message


_SHOWN = 25
_SHOWN_ALIKE = 5
