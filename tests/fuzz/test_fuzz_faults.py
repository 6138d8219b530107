"""The laws hold whatever servers do: each track, over both transports, with every fault drawn."""

from __future__ import annotations

import math
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from tests.fork_server import Done
from tests.fuzz.laws import Broken, broken_laws, take_tree
from tests.fuzz.ledger import LedgerAgent, LedgerChat, asked_twice, kept_in, lost
from tests.fuzz.sizes import FAULTS, SEED
from tests.fuzz.worker import Ended, Worker
from tests.servers.chassis import Faults, Running
from tests.servers.faults import WIRE_FAULTS
from tests.vqa_set import questions, vqa_suite, write_questions
from tests.workspace import SCENES, SHARED, Workspace

pytestmark = pytest.mark.fuzz

_SHARE = 0.35
_LONGEST_S = 300.0
_TRACKS: dict[str, dict[str, Any]] = {
    "full_planning": {},
    "vqa": vqa_suite(subtasks=["SH", "OR", "VP"]),
    "step_planning": {"tracks": ["step_planning"], "steps": {"physics": "off"}},
}
_ASKED_PER_SEED = {"full_planning": 5, "vqa": 12, "step_planning": 15}
"""At least so many requests."""
_TRANSPORTS = ("direct", "litellm")
_CELLS = [
    pytest.param(track, transport, marks=[] if n == 0 else [pytest.mark.slow])
    for n, (track, transport) in enumerate((t, w) for w in _TRANSPORTS for t in _TRACKS)
]
_PASSING = (
    *("429", "500", "reset", "cut", "html", "empty", "400"),
    *tuple(name for name, fault in WIRE_FAULTS.items() if fault.ending != "unavailable"),
)
_STOPPING = tuple(name for name, fault in WIRE_FAULTS.items() if fault.ending == "unavailable")
_QUOTA = math.ceil(FAULTS / len(_CELLS))
"""Faults that each track meets over each transport."""


def prepare(workspace: Workspace, url: str, track: str, transport: str, seeds: list[int]) -> None:
    write_questions(workspace.root / "questions", questions(SCENES, 4, ("SH", "OR", "VP")))
    fields: dict[str, Any] = {"transport": transport, "price": {"input": 1, "output": 1}}
    if transport == "direct":  # by two addresses, so that what fails at one is asked at the other
        fields["api_base"] = [f"{one}/v1" for one in (url, url.replace("127.0.0.1", "localhost"))]
    workspace.write_models(url, "alpha", **fields)
    workspace.write_suite(
        **{
            "images": {"size_px": 128},
            **_TRACKS[track],
            "models": ["alpha"],
            "seeds": seeds,
            "limits": {"max_concurrency": 24, "timeout_s": 20.0},
        }
    )


class Runner:
    """Runs the suite of a workspace and holds the first two laws.

    Commands whose transport is litellm, which keeps clients for the life of a process, are run in
    a process each.
    """

    def __init__(self, workspace: Workspace, worker: Worker | None) -> None:
        self.workspace = workspace
        self._worker = worker
        self._before = take_tree(workspace.root)

    def run(self, *args: str) -> Done:
        workspace = self.workspace
        if self._worker is None:
            done = workspace.run("--yes", *args)
            ended = Ended(done.code, done.out, done.err)
        else:
            command = [
                "run",
                "suite.yaml",
                "--out",
                str(workspace.out),
                "--no-report",
                "--yes",
                *args,
            ]
            ended = self._worker.phyblock(command, workspace.root, workspace.env, _LONGEST_S)
        after = take_tree(workspace.root)
        shared = [str((workspace.cache / name).resolve()) for name in SHARED]
        places = (workspace.out.name, "cache", *shared)
        broken = broken_laws(ended, workspace.root, self._before, after, places, ())
        assert not broken, told(broken)
        self._before = after
        return ended.done


def told(broken: list[Broken]) -> str:
    return "\n".join(f"{one.name}: {one.detail}" for one in broken[:20])


def one_round(runner: Runner, server: LedgerChat, track: str) -> None:
    """A run with faults to its end, the same again, what was refused again, and a second run."""
    workspace = runner.workspace
    ledger = server.ledger
    first = len(ledger.entries)
    for _ in range(10):
        done = runner.run()
        if "To go on" not in done.out:
            break
    asked = len(ledger.entries)
    assert runner.run().code == (1 if ledger.refused() else 0), done.out + done.err
    assert len(ledger.entries) == asked, "a run that was done asked again"
    broken = [*asked_twice(ledger.entries), *lost(ledger, kept_in(workspace.out))]
    assert not broken, told(broken)

    server.faults = Faults()
    refused = {entry.key for entry in ledger.entries[first:] if entry.comes_to == "sample"}
    done = runner.run("--retry-failed")
    assert done.code == 0, done.out + done.err
    again = ledger.entries[asked:]
    if track != "step_planning":  # where an episode goes on with turns that were never asked
        assert Counter(entry.key for entry in again) == Counter(refused)
    broken = [*asked_twice(ledger.entries, retries_refused=True)]
    assert not broken, told(broken)

    asked = len(ledger.entries)
    workspace.out = workspace.out.with_name(f"{workspace.out.name}-again")
    done = runner.run()
    assert done.code == 0, done.out + done.err
    assert len(ledger.entries) == asked, "what stands in the cache was asked again"


@pytest.mark.parametrize(("track", "transport"), _CELLS)
def test_faults(
    workspace: Workspace,
    worker: Worker,
    tallies: dict[str, Counter[str]],
    track: str,
    transport: str,
) -> None:
    seeds = math.ceil(_QUOTA * (1 - _SHARE) / _SHARE / _ASKED_PER_SEED[track]) + 1
    met: Counter[str] = Counter()
    n = 0
    while sum(met.values()) < _QUOTA:
        faults = Faults.spread(_PASSING, _SHARE, seed=1 + SEED + n, retry_after="0")
        server = (LedgerAgent if track == "step_planning" else LedgerChat)(faults)
        with Running(server) as running:
            workspace.out = workspace.root / f"out{n}"
            drawn = list(range(n * seeds, (n + 1) * seeds))
            prepare(workspace, running.url, track, transport, drawn)
            runner = Runner(workspace, worker if transport == "direct" else None)
            one_round(runner, server, track)
        met += server.ledger.faults
        n += 1
    tallies.setdefault(f"faults met by {track}, {transport}", Counter()).update(met)


@pytest.mark.slow
@pytest.mark.parametrize("transport", _TRANSPORTS)
def test_faults_that_stop_a_model(
    workspace: Workspace, tallies: dict[str, Counter[str]], transport: str
) -> None:
    faults = Faults.spread(_STOPPING, 0.5, seed=1 + SEED)
    with Running(LedgerChat(faults)) as running:
        server = running.server
        assert isinstance(server, LedgerChat)
        prepare(workspace, running.url, "full_planning", transport, list(range(8)))
        workspace.write_models(running.url, "alpha", transport=transport, max_concurrency=2)
        runner = Runner(workspace, None)
        for _ in range(12):
            done = runner.run()
            assert done.code in (0, 1), done.out + done.err
        server.faults = Faults()
        assert runner.run().code == 0
    broken = [*asked_twice(server.ledger.entries), *lost(server.ledger, kept_in(workspace.out))]
    assert not broken, told(broken)
    tallies.setdefault(f"faults that stop, {transport}", Counter()).update(server.ledger.faults)


def test_nothing_of_the_workspace_is_left_out(workspace: Workspace) -> None:
    """The look at a folder sees every file, also hidden ones."""
    Path(workspace.root / ".hidden").write_text("x", encoding="utf-8")
    assert {".hidden", "data/scenes.jsonl"} <= take_tree(workspace.root).keys()
