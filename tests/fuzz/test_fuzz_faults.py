"""The laws hold whatever servers do: each track, over both transports, with every fault drawn."""

from __future__ import annotations

import math
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from tests.fuzz.laws import CODES, Broken, take_tree
from tests.fuzz.ledger import LedgerAgent, LedgerChat, asked_twice, kept_in, lost
from tests.fuzz.sizes import FAULTS, SEED
from tests.servers.chassis import Faults, Running
from tests.servers.faults import WIRE_FAULTS
from tests.vqa_set import questions, vqa_suite, write_questions
from tests.workspace import SCENES, Done, Workspace

pytestmark = pytest.mark.fuzz

_SHARE = 0.35
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
    "429",
    "500",
    "reset",
    "cut",
    "html",
    "empty",
    "400",
    *tuple(name for name, fault in WIRE_FAULTS.items() if fault.ending != "unavailable"),
)
_STOPPING = tuple(name for name, fault in WIRE_FAULTS.items() if fault.ending == "unavailable")
_QUOTA = math.ceil(FAULTS / len(_CELLS))
"""Faults that each track meets over each transport."""


def prepare(workspace: Workspace, url: str, track: str, transport: str, seeds: list[int]) -> None:
    write_questions(workspace.root / "questions", questions(SCENES, 4, ("SH", "OR", "VP")))
    workspace.write_models(url, "alpha", transport=transport, price={"input": 1, "output": 1})
    workspace.write_suite(
        **{
            "images": {"size_px": 128},
            **_TRACKS[track],
            "models": ["alpha"],
            "seeds": seeds,
            "limits": {"max_concurrency": 24, "timeout_s": 20.0},
        }
    )


def checked(workspace: Workspace, before: dict[str, tuple[str, str]], *args: str) -> Done:
    """Run, and hold the first two laws."""
    done = workspace.run(*args)
    assert done.code in CODES, done.err
    assert "Traceback" not in done.err, done.err
    own = (str(workspace.out.relative_to(workspace.root)), "cache", "suite.yaml", "models.yaml")
    after = take_tree(workspace.root)
    strays = {p for p in before.keys() | after.keys() if before.get(p) != after.get(p)}
    assert not [path for path in strays if not path.startswith(own)]
    return done


def told(broken: list[Broken]) -> str:
    return "\n".join(f"{one.name}: {one.detail}" for one in broken[:20])


def one_round(workspace: Workspace, server: LedgerChat, url: str, *cell: Any) -> None:
    """A run with faults to its end, the same again, what was refused again, and a second run."""
    prepare(workspace, url, *cell)
    ledger = server.ledger
    first = len(ledger.entries)
    before = take_tree(workspace.root)
    for _ in range(10):
        done = checked(workspace, before)
        if "To go on" not in done.out:
            break
    asked = len(ledger.entries)
    assert checked(workspace, before).code == (1 if ledger.refused() else 0), done.out + done.err
    assert len(ledger.entries) == asked, "a run that was done asked again"
    broken = [*asked_twice(ledger.entries), *lost(ledger, kept_in(workspace.out))]
    assert not broken, told(broken)

    server.faults = Faults()
    refused = {entry.key for entry in ledger.entries[first:] if entry.comes_to == "sample"}
    done = checked(workspace, before, "--retry-failed")
    assert done.code == 0, done.out + done.err
    again = ledger.entries[asked:]
    if cell[0] != "step_planning":  # where an episode goes on with turns that were never asked
        assert Counter(entry.key for entry in again) == Counter(refused)
    broken = [*asked_twice(ledger.entries, retries_refused=True)]
    assert not broken, told(broken)

    asked = len(ledger.entries)
    workspace.out = workspace.out.with_name(f"{workspace.out.name}-again")
    done = checked(workspace, before | take_tree(workspace.root))
    assert done.code == 0, done.out + done.err
    assert len(ledger.entries) == asked, "what stands in the cache was asked again"


@pytest.mark.parametrize(("track", "transport"), _CELLS)
def test_faults(
    workspace: Workspace, tallies: dict[str, Counter[str]], track: str, transport: str
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
            one_round(workspace, server, running.url, track, transport, drawn)
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
        before = take_tree(workspace.root)
        for _ in range(12):
            done = checked(workspace, before)
            assert done.code in (0, 1), done.out + done.err
        server.faults = Faults()
        assert checked(workspace, before).code == 0
    broken = [*asked_twice(server.ledger.entries), *lost(server.ledger, kept_in(workspace.out))]
    assert not broken, told(broken)
    tallies.setdefault(f"faults that stop, {transport}", Counter()).update(server.ledger.faults)


def test_nothing_of_the_workspace_is_left_out(workspace: Workspace) -> None:
    """The look at a folder sees every file, also hidden ones."""
    Path(workspace.root / ".hidden").write_text("x", encoding="utf-8")
    assert {".hidden", "data/scenes.jsonl"} <= take_tree(workspace.root).keys()
