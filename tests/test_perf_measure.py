"""Measuring a command, as benchmarks/perf does."""

from __future__ import annotations

import os
import sys

import pytest

from benchmarks.perf.measure import run_measured


def test_a_command_may_say_more_than_a_pipe_holds() -> None:
    loud = "print('x' * 200_000)"
    assert run_measured((sys.executable, "-c", loud), os.environ).wall_s > 0
    with pytest.raises(SystemExit, match=r"failed \(3\):\nx{200000}"):
        run_measured((sys.executable, "-c", f"{loud}\nraise SystemExit(3)"), os.environ)
