"""Amount and seed of fuzzing: set by environment variables, as `make fuzz` does."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

from hypothesis import HealthCheck, Phase, seed, settings

__all__ = ["FAULTS", "INPUTS", "KILLS", "SEED", "fuzzed"]

SEED = int(os.environ.get("PHYBLOCK_FUZZ_SEED", "0"))
INPUTS = int(os.environ.get("PHYBLOCK_FUZZ_INPUTS", "60"))
"""Bad inputs that are tried, over all kinds."""
FAULTS = int(os.environ.get("PHYBLOCK_FUZZ_FAULTS", "40"))
"""Faults of servers that runs meet, over all tracks and transports."""
KILLS = int(os.environ.get("PHYBLOCK_FUZZ_KILLS", "36"))
"""Kills of runs, over all tracks."""

Test = Callable[..., Any]


def fuzzed(percent: float) -> Callable[[Test], Test]:
    """Draw this share of all inputs for a test, the same ones for the same seed.

    Nothing is shrunk: a command that hangs would be tried again and again.
    """
    examples = max(1, round(INPUTS * percent / 100))
    chosen = settings(
        max_examples=examples,
        deadline=None,
        database=None,
        derandomize=False,
        phases=(Phase.generate,),
        suppress_health_check=list(HealthCheck),
    )

    def decorate(test: Test) -> Test:
        return seed(SEED)(chosen(test))

    return decorate
