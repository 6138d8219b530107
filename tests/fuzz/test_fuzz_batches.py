"""Batches under drawn faults and kills: every question comes to its end, and none that has a whole
answer is asked again.
"""

from __future__ import annotations

import asyncio
import tempfile
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.errors import SampleError
from phyblock.models import Budget, Reply
from tests.fuzz.sizes import fuzzed
from tests.models.batching import Disk, Killing, command, run_command
from tests.models.factory import QUICK, make_request
from tests.models.routes import KEY_VARIABLE, ROUTES
from tests.servers.batches import (
    AnthropicBatches,
    BatchFaults,
    BatchServer,
    GeminiBatches,
    OpenAIBatches,
)
from tests.servers.chassis import Running

pytestmark = pytest.mark.fuzz

QUESTIONS = 4
COMMANDS = 25


class Forgetful(OpenAIBatches):
    """Keeps no metadata: batches are known by their answers."""

    forgets_names = True


WAYS: dict[str, tuple[type[BatchServer], str]] = {
    "openai": (OpenAIBatches, "direct"),
    "forgetful": (Forgetful, "direct"),
    "anthropic": (AnthropicBatches, "anthropic"),
    "gemini": (GeminiBatches, "gemini"),
}
WHOLE = ("ok", "twice", "stranger")
endings = st.sampled_from([*WHOLE, "500", "429", "400", "length", "missing", "broken", "expired"])
failures = st.lists(st.sampled_from(["", "500", "reset", "done-reset"]), max_size=3).map(tuple)


@st.composite
def batch_faults(draw: st.DrawFn) -> BatchFaults:
    """Faults of four batches, one of which may be cancelled or refused, and calls about them."""
    lines = st.dictionaries(st.integers(0, QUESTIONS - 1), endings, max_size=QUESTIONS)
    kinds = ["upload", "create", "look", "list", "results"]
    ends = st.dictionaries(st.integers(0, 1), st.sampled_from(["refused", "cancelled"]), max_size=1)
    return BatchFaults(
        draw(st.dictionaries(st.integers(0, 3), lines)),
        draw(ends),
        {kind: draw(failures) for kind in kinds},
        looks=draw(st.integers(1, 3)),
    )


# What a kill cuts off in litellm is closed when it is collected.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize(
    "way",
    [name if name == "openai" else pytest.param(name, marks=pytest.mark.slow) for name in WAYS],
)
@fuzzed(15)
@given(batch_faults(), st.lists(st.integers(0, 25), max_size=3))
def test_batches(way: str, faults: BatchFaults, kills: list[int]) -> None:
    kind, route = WAYS[way]
    requests = [make_request(f"{n:03d}") for n in range(QUESTIONS)]
    policy = replace(QUICK, attempts=3, max_connection_failures=3)
    with (
        tempfile.TemporaryDirectory() as folder,
        pytest.MonkeyPatch.context() as patch,
        Running(kind(batch=faults)) as running,
    ):
        patch.setenv(KEY_VARIABLE, "sk-not-a-real-key-1234")
        server = running.server
        assert isinstance(server, BatchServer)
        config = ROUTES[route].config(running.url, batch=True, price={"input": 1.0, "output": 1.0})
        disk = Disk(Path(folder))
        for at in kills:
            killing = Killing(at)
            disk.moment, server.moment = killing.here, killing.there
            asyncio.run(killing.run(command(config, disk, requests, policy=policy)))
        disk.moment, server.moment = None, lambda *_: None
        for _ in range(COMMANDS):
            ended = run_command(config, disk, requests, policy=policy, budget=Budget(1e9))
            if all(isinstance(one, (Reply, SampleError)) for one in ended):
                break
        else:
            raise AssertionError(f"no end after {COMMANDS} commands: {ended}")
        answered: Counter[str] = Counter()
        for made in server.made:
            told = faults.lines.get(made.ordinal, {})
            if faults.ends.get(made.ordinal) == "refused":
                continue
            for place, seen in enumerate(made.seen):
                answered[seen.sample] += told.get(place, "ok") in (*WHOLE, "length", "400")
        assert set(answered.values()) == {1}, answered
