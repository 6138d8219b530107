"""kill -9 at random moments of each track: nothing answered is lost, and of what was answered no
more is asked again than was under way when a kill came.
"""

from __future__ import annotations

import contextlib
import json
import random
import signal
import sqlite3
import time
from collections import Counter
from typing import Any

import pytest

from tests.fuzz.ledger import LedgerAgent, LedgerChat, kept_in
from tests.fuzz.sizes import KILLS, SEED
from tests.servers.chassis import Faults, Running
from tests.vqa_set import questions, vqa_suite, write_questions
from tests.workspace import SCENES, Workspace

AT_ONCE = 6
LATENCY_S = 0.03
TRACKS: dict[str, dict[str, Any]] = {
    "full_planning": {},
    "vqa": vqa_suite(subtasks=["SH", "CO"]),
    "step_planning": {"tracks": ["step_planning"], "steps": {"physics": "off"}},
}
_ASKED_PER_SEED = {"full_planning": 5, "vqa": 8, "step_planning": 30}
"""About so many requests."""
_ASKED_PER_KILL = 12


def on_disk(workspace: Workspace) -> set[tuple[str, str]]:
    """The replies that stand in records, turns or the cache, as the ledger names them."""
    found = kept_in(workspace.out)
    path = workspace.cache / "replies.sqlite"
    if path.exists():
        with contextlib.closing(sqlite3.connect(path)) as database:
            tables = database.execute("SELECT name FROM sqlite_master").fetchall()
            rows = database.execute("SELECT reply FROM replies").fetchall() if tables else []
        found |= {("alpha", json.loads(row[0])["reasoning"]) for row in rows}
    return found


def run_until_killed(workspace: Workspace, server: LedgerChat, draw: random.Random) -> None:
    """Kill a run after some further requests and a little time, and let the server settle."""
    target = len(server.ledger.entries) + draw.randrange(1, _ASKED_PER_KILL)
    with workspace.start() as process:
        while process.poll() is None and len(server.ledger.entries) < target:
            time.sleep(0.002)
        time.sleep(draw.random() / 20)
        process.kill()
        process.communicate()
    assert process.returncode == -signal.SIGKILL, "the run ended before it was killed"
    seen = -1
    while server.at_once or seen != len(server.ledger.entries):
        seen = len(server.ledger.entries)
        time.sleep(0.05)


@pytest.mark.fuzz
@pytest.mark.slow
@pytest.mark.parametrize("track", TRACKS)
def test_kills(workspace: Workspace, tallies: dict[str, Counter[str]], track: str) -> None:
    kills = -(-KILLS // len(TRACKS))
    draw = random.Random(f"{SEED} {track}")
    write_questions(workspace.root / "questions", questions(SCENES, 4, ("SH", "CO")))
    server = (LedgerAgent if track == "step_planning" else LedgerChat)(Faults(latency_s=LATENCY_S))
    ledger = server.ledger
    under_way: Counter[tuple[str, str]] = Counter()
    with Running(server) as running:
        workspace.write_models(running.url, "alpha")
        seeds = list(range(kills * (_ASKED_PER_KILL + AT_ONCE) // _ASKED_PER_SEED[track] + 2))
        fields = {"images": {"size_px": 128}, **TRACKS[track]}
        limits = {"max_concurrency": AT_ONCE}
        workspace.write_suite(**{**fields, "models": ["alpha"], "seeds": seeds, "limits": limits})
        for _ in range(kills):
            run_until_killed(workspace, server, draw)
            missing = {entry.key for entry in ledger.entries} - on_disk(workspace)
            assert len(missing) <= AT_ONCE, "more is missing than was under way"
            under_way.update(missing)
        done = workspace.run()
    assert (done.code, done.err) == (0, "")
    assert not ledger.answered() - kept_in(workspace.out)
    asked = Counter(entry.key for entry in ledger.entries)
    for key, count in asked.items():
        assert count <= 1 + under_way[key], "asked again, though its reply stood on disk"
    again = sum(count - 1 for count in asked.values())
    told = {"kills": kills, "lost": 0, "under way at a kill": sum(under_way.values())}
    tallies[f"kills, {track}"] = Counter({**told, "asked again": again})
