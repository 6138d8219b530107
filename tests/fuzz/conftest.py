"""A summary of what was tried."""

from collections import Counter

import pytest

from tests.fuzz.strategies import FAULTS, INPUTS, SEED

_tallies: dict[str, Counter[str]] = {}


@pytest.fixture(scope="session")
def tallies() -> dict[str, Counter[str]]:
    """Counts of what was tried, by kind and end; printed in the end."""
    return _tallies


def pytest_report_header() -> str:
    """The seed, so that what fails can be had again."""
    return f"fuzzing: seed {SEED}, {INPUTS} inputs, {FAULTS} faults"


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print what was tried, and how it ended."""
    if not _tallies:
        return
    terminalreporter.section(f"fuzzing with seed {SEED}")
    for name, tally in sorted(_tallies.items()):
        told = ", ".join(f"{key}: {count:,}" for key, count in sorted(tally.items()))
        terminalreporter.line(f"{name:<12} {sum(tally.values()):>6,}  ({told})")
