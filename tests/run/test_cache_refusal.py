"""A reply cache that fails while a run goes on: said once, and neither a reply nor a call is lost.

Replies stand in the records too, so that nothing depends on the cache but what other runs find.
"""

from __future__ import annotations

import contextlib
import re
import signal
import sqlite3
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from phyblock.models import ReplyCache
from tests.servers.chassis import Faults, Running
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import Workspace

SAMPLES = 20
AT_ONCE = 4


def prepare(workspace: Workspace, url: str, at_once: int = 1) -> None:
    workspace.write_models(url, "alpha")
    limits = {"max_concurrency": at_once}
    workspace.write_suite(models=["alpha"], seeds=[0, 1, 2, 3], limits=limits)


def catches(pid: int, number: signal.Signals) -> bool:
    """True if a process has its own handler of a signal, as one that asks models has of SIGTERM."""
    status = Path(f"/proc/{pid}/status").read_text(encoding="utf-8")
    (mask,) = re.findall(r"^SigCgt:\s*(\w+)", status, re.MULTILINE)
    return bool(int(mask, 16) >> (number - 1) & 1)


@contextlib.contextmanager
def locked(workspace: Workspace) -> Iterator[None]:
    """Hold the reply cache as another process would."""
    path = workspace.cache / "replies.sqlite"
    ReplyCache(path).close()
    with contextlib.closing(sqlite3.connect(path, isolation_level=None)) as db:
        db.execute("BEGIN IMMEDIATE")
        yield


@pytest.mark.parametrize("room", [3, SAMPLES - 1])
def test_a_cache_that_takes_no_more_is_said_once_and_all_is_recorded(
    workspace: Workspace, room: int
) -> None:
    path = workspace.cache / "replies.sqlite"
    ReplyCache(path).close()
    db = sqlite3.connect(path)
    db.execute(
        f"CREATE TRIGGER full BEFORE INSERT ON replies WHEN (SELECT count(*) FROM replies) >= "
        f"{room} BEGIN SELECT RAISE(ABORT, 'the disk is full'); END"
    )
    with Running(OpenAIChat()) as running:
        prepare(workspace, running.url)
        done = workspace.run()
        assert (done.code, done.err) == (0, "")
        (said,) = [line for line in done.out.splitlines() if "the disk is full" in line]
        assert str(path) in said
        assert "going on without it" in said
        assert f"All {SAMPLES} samples are done" in done.out
        assert running.server.ended == {"ok": SAMPLES}
        assert [record["outcome"] for record in workspace.records()] == ["ok"] * SAMPLES
        with ReplyCache(path) as cache:
            assert sum(cache.counts().values()) == room

        db.execute("DROP TRIGGER full")
        db.close()
        again = workspace.run()
        assert (again.code, again.err) == (0, "")
        assert running.server.requests == SAMPLES


def test_a_disk_that_takes_neither_replies_nor_records_ends_the_run_after_few_calls(
    workspace: Workspace,
) -> None:
    with Running(OpenAIChat(Faults(latency_s=0.01))) as running:
        prepare(workspace, running.url, AT_ONCE)
        assert workspace.run("--limit", "1", "--models", "random").code == 0
        workspace.out = workspace.root / "full"
        done = workspace.run(bytes_left=20_000)
        assert done.code == 2
        assert len(done.errors) == 1
        kept = len(workspace.records())
        asked = running.server.requests
        assert kept < SAMPLES
        assert asked - kept <= 2 * AT_ONCE

        again = workspace.run()
        assert (again.code, again.err) == (0, "")
        assert running.server.requests <= asked + SAMPLES - kept
        assert len({record["sample"] for record in workspace.records()}) == SAMPLES


def test_ctrl_c_ends_a_run_whose_cache_is_locked(workspace: Workspace) -> None:
    with Running(OpenAIChat()) as running, locked(workspace):
        prepare(workspace, running.url, AT_ONCE)
        with workspace.start() as process:
            while not catches(process.pid, signal.SIGTERM):
                time.sleep(0.01)
            time.sleep(1.0)
            process.send_signal(signal.SIGINT)
            out, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (130, "")
    assert "(interrupted)" in out


@pytest.mark.slow
def test_a_run_with_a_locked_cache_ends_as_without_one(workspace: Workspace) -> None:
    with Running(OpenAIChat()) as running, locked(workspace):
        prepare(workspace, running.url, AT_ONCE)
        done = workspace.run()
        assert (done.code, done.err) == (0, "")
        assert done.out.count("database is locked") == 1
        assert running.server.requests == SAMPLES
