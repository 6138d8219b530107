"""Which command prints which number, what it was and what it is.

    python -m benchmarks.evidence             # the table, as it stands in docs/statistics.md
    python -m benchmarks.evidence CHECKOUT    # every command of it in turn; an hour or less

CHECKOUT is a checkout of the official repository.
"""

from __future__ import annotations

import argparse
import shlex
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

CHECKOUT = "CHECKOUT"


@dataclass(frozen=True)
class Number:
    """A number that was found wanting: what it was, what it is, and the command that prints both.

    `command` is what follows `python -m`.
    """

    what: str
    before: str
    now: str
    command: str


_STEPS = (
    "phyblock run steps --models random,repeat,oracle-no-orientation --limit 40 "
    "--set steps.physics=off --no-report"
)
_ESTIMATES = f"benchmarks.evidence.estimates {CHECKOUT}"
_COMPARISONS = f"benchmarks.evidence.comparisons {CHECKOUT}"
_COVERAGE = "benchmarks.evidence.coverage --resamples 400"
_LOSSES = f"benchmarks.evidence.losses {CHECKOUT}"
_SUBSETS = f"benchmarks.evidence.subsets {CHECKOUT}"
_PARSERS = f"benchmarks.evidence.parsers {CHECKOUT}"

NUMBERS = (
    Number(
        "F1 of Qwen2.5-VL-3B as its replies are read (by eye: 19.56)", "21.23", "19.56", _PARSERS
    ),
    Number("replies of 429 that are not read as by eye", "98", "0", _PARSERS),
    Number(
        "40 replies written before any parser read them: right, failed, wrong",
        "31, 4, 5",
        "39, 1, 0",
        "benchmarks.evidence.replies",
    ),
    Number(
        "20 more, written when these had been mended: right, failed, wrong",
        "14, 3, 3",
        "17, 3, 0",
        "benchmarks.evidence.replies",
    ),
    Number("least p of a comparison, times 325 pairs", "0.051", "0.000", _COMPARISONS),
    Number("pairs of 26 models, of 325, that are told apart", "0", "246", _COMPARISONS),
    Number("the same, of 9 that are 25 points apart", "0", "9", _COMPARISONS),
    Number(
        "the difference that one test finds, and Holm's first step (points)",
        "not said",
        "3.6, 6.0",
        _COMPARISONS,
    ),
    Number(
        "tests at 5 % that find what is not there (recorded world)", "1.8 %", "5.7 %", _COVERAGE
    ),
    Number("a gap of four to five points that is found", "31.2 %", "44.5 %", _COVERAGE),
    Number("intervals of 95 % that hold the truth", "97.1 %", "94.3 %", _COVERAGE),
    Number(
        "one page, overall F1 of several seeds: headline, figure",
        "30.58, 30.97",
        "30.97, 30.97",
        _ESTIMATES,
    ),
    Number(
        "recall and F1 by membership in B that are no ratios (InternVL2.5-4B)",
        "1.156, 1.022",
        "blank",
        _ESTIMATES,
    ),
    Number("the interval of 0 of 119 plans (points)", "0.0 to 0.0", "0.0 to 3.6", _ESTIMATES),
    Number(
        "the interval of `dependency_not_met`, 41.9 % of wrong steps",
        "none",
        "38.4 to 45.4",
        _ESTIMATES,
    ),
    Number("rows of level 1 among error types", "those of level 2", "none", _ESTIMATES),
    Number(
        "scorings of 6,380 whose error types change with the file order of blocks",
        "11",
        "0",
        _LOSSES,
    ),
    Number(
        "goal blocks of all models: supports missing, order (%)", "not told", "16.8, 3.2", _LOSSES
    ),
    Number(
        "what leads Table 3, of `random`, `repeat` and `oracle-no-orientation`: precision of "
        "placed blocks, F1 of attempts (%)",
        "100, 100, 100",
        "15.2, 1.7, 33.8",
        _STEPS,
    ),
    Number(
        "variance of scenes' F1 that level, number of blocks explain (%)",
        "7, 16",
        "6.9, 5.7",
        _SUBSETS,
    ),
    Number(
        "valid orders below F1 = 1, scenes of 400 in A (matchers `paper`, `optimal`)",
        "178",
        "0",
        f"benchmarks.evidence.matchers {CHECKOUT}",
    ),
    Number(
        "95 % intervals of what a factor does to single items: hold the truth in (six designs)",
        "90.0 to 94.6 %",
        "93.1 to 97.2 %",
        "benchmarks.evidence.components --runs 2000",
    ),
)


def table() -> str:
    """The table in Markdown."""
    head = "| number | before | now | printed by |\n|---|---:|---:|---|\n"
    rows = (f"| {n.what} | {n.before} | {n.now} | `{_shown(n.command)}` |" for n in NUMBERS)
    return head + "\n".join(rows) + "\n"


def _shown(command: str) -> str:
    return command if command.startswith("phyblock") else f"python -m {command}"


def main() -> None:
    """Print the table; with a checkout, run its commands."""
    arguments = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    arguments.add_argument("checkout", type=Path, nargs="?")
    given = arguments.parse_args()
    print(table(), flush=True)
    commands = dict.fromkeys(number.command for number in NUMBERS)
    for command in commands if given.checkout is not None else ():
        words = shlex.split(command.replace(CHECKOUT, shlex.quote(str(given.checkout))))
        print(f"\n{_shown(command)}", flush=True)
        python = [] if words[0] == "phyblock" else [sys.executable, "-m"]
        subprocess.run([*python, *words], check=True)


if __name__ == "__main__":
    main()
