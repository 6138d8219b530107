"""The laws hold for whatever a person gives: files, arguments, folders, earlier runs."""

from __future__ import annotations

from collections import Counter

import pytest
from hypothesis import given

from tests.fuzz.bench import Bench, Case
from tests.fuzz.cases import KINDS, Cases, run_cases
from tests.fuzz.sizes import fuzzed
from tests.workspace import Workspace

pytestmark = pytest.mark.fuzz
_SHARES_PERCENT = {
    "suites": 14, "models": 12, "overrides": 8, "arguments": 10, "scenes": 12, "questions": 8,
    "prompts": 8, "pictures": 6, "replies": 6, "places": 6,
}  # fmt: skip
_OF_RUNS_PERCENT = 10


@pytest.mark.parametrize("kind", KINDS)
def test_bad_input(plain_bench: Bench, tallies: dict[str, Counter[str]], kind: str) -> None:
    try_cases(plain_bench, KINDS[kind], _SHARES_PERCENT[kind], tallies.setdefault(kind, Counter()))


def test_bad_run_folder(
    runs_bench: Bench, ended: Workspace, tallies: dict[str, Counter[str]]
) -> None:
    tally = tallies.setdefault("run folders", Counter())
    try_cases(runs_bench, run_cases(ended.root), _OF_RUNS_PERCENT, tally)


def try_cases(bench: Bench, cases: Cases, percent: float, tally: Counter[str]) -> None:
    """Draw cases, try each, and fail with all that was broken."""
    bench.tally, bench.found = tally, {}

    @fuzzed(percent)
    @given(case=cases)
    def run(case: Case) -> None:
        bench.try_out(case)

    run()
    if bench.found:
        pytest.fail(bench.told(), pytrace=False)
