"""kill -9 at any moment: every reply that was read is kept, none is asked for twice, and what was
billed is known.
"""

from __future__ import annotations

import contextlib
import json
import os
import random
import signal
import sqlite3
import time
from typing import Any

import psutil
import pytest

from tests.servers.chassis import Faults, Running, Seen
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import Workspace

AT_ONCE = 6
LATENCY_S = 0.03
PRICE = {"input": 10.0, "output": 100.0}
CALL_USD = 1000 * PRICE["input"] / 1e6 + 40 * PRICE["output"] / 1e6
"""The server counts 1,000 tokens in and 40 out for every call."""


class Signing(OpenAIChat):
    """Puts the sample's id into the reasoning of a reply, so that it is found again on disk."""

    def reply(self, seen: Seen, ending: str) -> dict[str, Any]:
        body = super().reply(seen, ending)
        body["choices"][0]["message"]["reasoning_content"] = seen.sample
        return body


def kept(workspace: Workspace) -> set[str]:
    """Ids of all samples whose reply is on disk: in a whole record, the calls or the cache."""
    found: set[str] = set()
    for name in ("records.jsonl", "calls.jsonl"):
        replies = [line.get("reply") for line in lines_in(workspace, name)]
        found |= {reply["reasoning"] for reply in replies if reply}
    path = workspace.cache / "replies.sqlite"
    if path.exists():
        with contextlib.closing(sqlite3.connect(path)) as database:
            tables = database.execute("SELECT name FROM sqlite_master").fetchall()
            rows = database.execute("SELECT reply FROM replies").fetchall() if tables else []
        found |= {json.loads(row[0])["reasoning"] for row in rows}
    return found


def lines_in(workspace: Workspace, name: str) -> list[dict[str, Any]]:
    """The whole lines of a file of the run."""
    path = workspace.out / name
    lines = path.read_bytes().split(b"\n")[:-1] if path.exists() else []
    return [json.loads(line) for line in lines]


def counted_usd(workspace: Workspace) -> tuple[float, int]:
    """Return the cost of a run's calls, those without an end at their most, and their number."""
    calls = {call["call"]: call for call in lines_in(workspace, "calls.jsonl")}
    open_calls = [call for call in calls.values() if not call.get("ended")]
    ended_usd = sum(call["billed_usd"] for call in calls.values() if call.get("ended"))
    return ended_usd + sum(call["most_usd"] for call in open_calls), len(open_calls)


def settle(server: OpenAIChat) -> int:
    """Wait until the server has dealt with all it was sent; how many requests that were."""
    seen = -1
    while server.at_once or seen != len(server.seen):
        seen = len(server.seen)
        time.sleep(0.05)
    return seen


def run_until_killed(
    workspace: Workspace, server: OpenAIChat, *options: str, more: int, extra_s: float
) -> int:
    """Kill a run after `more` further requests and a little time; its exit code."""
    target = len(server.seen) + more
    with workspace.start("--yes", *options) as process:
        while process.poll() is None and len(server.seen) < target:
            time.sleep(0.002)
        time.sleep(extra_s)
        process.kill()
        process.communicate()
    return process.returncode


def prepare(workspace: Workspace, url: str, seeds: int) -> None:
    workspace.write_models(url, "alpha", price=PRICE, max_tokens=1000)
    workspace.write_suite(
        models=["alpha", "random"],
        seeds=list(range(seeds)),
        limits={"max_concurrency": AT_ONCE},
    )


@pytest.mark.parametrize("options", [(), ("--no-cache",)], ids=["cache", "no cache"])
@pytest.mark.parametrize(
    ("kills", "seeds", "start"),
    [
        (2, 5, 1),
        *(pytest.param(*case, marks=pytest.mark.slow) for case in ((4, 20, 1), (20, 80, 2))),
    ],
)
def test_what_was_answered_is_kept_whenever_the_run_is_killed(
    workspace: Workspace, kills: int, seeds: int, start: int, options: tuple[str, ...]
) -> None:
    draw = random.Random(start)
    samples = 5 * seeds
    with Running(Signing(Faults(latency_s=LATENCY_S))) as running:
        server = running.server
        assert isinstance(server, OpenAIChat)
        prepare(workspace, running.url, seeds)
        lost = 0
        kept_at: dict[int, set[str]] = {}
        for _ in range(kills):
            more = draw.randrange(samples // kills // 2)
            extra_s = draw.random() / 20
            code = run_until_killed(workspace, server, *options, more=more, extra_s=extra_s)
            assert code == -signal.SIGKILL
            asked = settle(server)
            on_disk = kept(workspace)
            in_flight = len({seen.sample for seen in server.seen[:asked]} - on_disk)
            assert in_flight <= AT_ONCE
            known_usd, unanswered = counted_usd(workspace)
            assert known_usd >= server.requests * CALL_USD - 1e-9
            assert unanswered >= server.requests - len(on_disk)
            lost += in_flight
            kept_at[asked] = on_disk
        done = workspace.run("--yes", *options)
        assert (done.code, done.err) == (0, "")
        assert (f"{unanswered} call" in done.out) == (unanswered > 0)
        assert f"All {2 * samples:,} samples are done" in done.out
        assert server.requests <= samples + lost
        for asked, on_disk in kept_at.items():
            assert on_disk.isdisjoint(seen.sample for seen in server.seen[asked:])

        records = workspace.records()
        names = [record["sample"] for record in records]
        assert len(names) == len(set(names)) == 2 * samples
        assert {record["outcome"] for record in records} == {"ok"}

        killed = workspace.tables()
        workspace.out = workspace.root / "undisturbed"
        assert workspace.run("--no-cache", "--yes").code == 0
        for name in ("estimates.csv", "table1.csv", "table1.md", "errors.csv"):
            assert workspace.tables()[name] == killed[name]


def test_no_process_outlives_a_killed_run(workspace: Workspace) -> None:
    """Pictures are drawn by processes of the run's own."""
    (workspace.cache / "pictures").unlink()
    with Running(OpenAIChat()) as running:
        prepare(workspace, running.url, 1)
        with workspace.start("--yes") as process:
            family: list[psutil.Process] = []
            while not any("phyblock.workers" in " ".join(_command(child)) for child in family):
                assert process.poll() is None
                family = psutil.Process(process.pid).children(recursive=True)
                time.sleep(0.01)
            os.kill(process.pid, signal.SIGKILL)
            process.wait()
        _, alive = psutil.wait_procs(family, timeout=30)
    assert not alive


def _command(process: psutil.Process) -> list[str]:
    with contextlib.suppress(psutil.NoSuchProcess):
        return process.cmdline()
    return []
