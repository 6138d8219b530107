"""Failures of a provider and of the reply cache: retried, recorded by kind, said once."""

import contextlib
import re
import signal
import sqlite3
import time
from collections import Counter
from pathlib import Path

import pytest

from phyblock.models.cache import ReplyCache
from phyblock.records.files import STOPPED, read_stopped
from phyblock.results.load import load_run
from tests.servers.chassis import Faults, Running
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import until


class BySeed(OpenAIChat):
    """Ends each request as its seed says."""

    def __init__(self, endings, **more):
        super().__init__()
        self._endings, self._more = endings, more

    def read(self, body, request):
        seen = super().read(body, request)
        self.faults = Faults(mode=self._endings.get(seen.seed or 0, "ok"), **self._more)
        return seen


def is_scored(record):
    """True if a record has a score of every setting and matcher."""
    found = {(s["setting"], s["matcher"]) for s in record["scores"] if s["criterion"] == "aov"}
    return found == {(setting, matcher) for setting in "AB" for matcher in ("optimal", "paper")}


def coverage(workspace):
    table = load_run(workspace.out).table("coverage").astype(str)
    return {row["model"]: row for row in table.to_dict("records")}


def test_a_model_that_cannot_answer_is_stopped_alone(workspace):
    servers = [OpenAIChat(Faults(mode=mode)) for mode in ("401", "404", "ok")]
    with Running(servers[0]) as locked, Running(servers[1]) as unknown, Running(servers[2]) as fine:
        urls = {"locked": locked.url, "unknown": unknown.url, "fine": fine.url}
        workspace.write_served(urls)
        workspace.write_suite(models=list(urls), seeds=list(range(20)))
        done = workspace.run("--set", "limits.max_concurrency=6")
        assert (done.code, done.err) == (1, "")
        assert "locked was stopped: HTTP 401: Incorrect API key provided" in done.out
        assert "unknown was stopped: HTTP 404: The model unknown does not exist" in done.out
        assert "100 of 300 samples are done" in done.out
        # Reports made later, from the folder alone, know it too.
        stopped = read_stopped(workspace.out).models
        told = {name: why[:8] for name, why in stopped.items()}
        assert told == {"locked": "HTTP 401", "unknown": "HTTP 404"}
        assert max(servers[0].requests, servers[1].requests) <= 6
        told = coverage(workspace)
        assert [(told[name]["ok"], told[name]["expected"]) for name in urls] == [
            ("0", "100"), ("0", "100"), ("100", "100"),
        ]  # fmt: skip

        # The key is set right, the name too: the same command asks for what is missing alone.
        for server in servers:
            server.faults = Faults()
        again = workspace.completed("--set", "limits.max_concurrency=6")
    assert "All 300 samples are done" in again.out
    assert not (workspace.out / STOPPED).exists()
    assert [server.ended["ok"] for server in servers] == [100, 100, 100]


def test_a_model_that_is_stopped_waits_for_no_other_attempt(workspace):
    server = BySeed({0: "429", 1: "401"}, retry_after="100")
    with workspace.served(server, seeds=[0, 1]), workspace.start("--limit", "1") as process:
        out, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (1, "")
    assert "alpha was stopped: HTTP 401" in out
    assert "0 of 2 samples are done" in out


def test_a_sample_whose_every_attempt_failed_is_asked_again_by_the_same_command(workspace):
    endings = {1: "500"}
    few = ("--set", "limits.max_attempts=2", "--set", "limits.retry_for_s=0")
    with workspace.served(BySeed(endings), seeds=[0, 1]) as server:
        assert workspace.run(*few).code == 1
        assert server.requests == 5 + 2 * 5
        endings.clear()
        workspace.completed(*few)
        assert server.requests == 5 + 2 * 5 + 5
    assert {record["outcome"] for record in workspace.records()[-5:]} == {"ok"}


def test_each_way_to_fail_is_an_outcome_of_its_own(workspace):
    endings = {1: "400", 2: "policy", 3: "length", 4: "filtered", 5: "blank"}
    outcomes = ("ok", "api_error", "refusal", "truncated", "refusal", "parse_failure")
    with workspace.served(BySeed(endings), seeds=[0, 1, 2, 3, 4, 5]) as server:
        # One request was rejected for good.
        assert workspace.run().code == 1
        records = workspace.records()
        found = {(record["seed"], record["outcome"]) for record in records}
        assert found == set(enumerate(outcomes))
        assert all(is_scored(record) for record in records)
        assert workspace.run().code == 1
        assert server.requests == 30
    told = coverage(workspace)["alpha"]
    assert Counter({name: int(told[name]) for name in set(outcomes)}) == {
        name: 5 * outcomes.count(name) for name in outcomes
    }


SAMPLES = 20
AT_ONCE = 4


def prepare(workspace, server, at_once=1):
    return workspace.served(server, seeds=[0, 1, 2, 3], limits={"max_concurrency": at_once})


@pytest.mark.parametrize("room", [3, SAMPLES - 1])
def test_a_cache_that_takes_no_more_is_said_once_and_all_is_recorded(workspace, room):
    path = workspace.cache / "replies.sqlite"
    ReplyCache(path).close()
    db = sqlite3.connect(path)
    db.execute(
        f"CREATE TRIGGER full BEFORE INSERT ON replies WHEN (SELECT count(*) FROM replies) >= "
        f"{room} BEGIN SELECT RAISE(ABORT, 'the disk is full'); END"
    )
    with prepare(workspace, OpenAIChat()) as server:
        done = workspace.completed()
        (said,) = [line for line in done.out.splitlines() if "the disk is full" in line]
        assert str(path) in said
        assert "going on without it" in said
        assert f"All {SAMPLES} samples are done" in done.out
        assert server.ended == {"ok": SAMPLES}
        assert [record["outcome"] for record in workspace.records()] == ["ok"] * SAMPLES
        assert db.execute("SELECT count(*) FROM replies").fetchone() == (room,)
        db.execute("DROP TRIGGER full")
        db.close()
        workspace.completed()
        assert server.requests == SAMPLES


def test_a_disk_that_takes_neither_replies_nor_records_ends_the_run_after_few_calls(workspace):
    with prepare(workspace, OpenAIChat(Faults(latency_s=0.01)), AT_ONCE) as server:
        workspace.completed("--limit", "1", "--models", "random")
        workspace.out = workspace.root / "full"
        done = workspace.run(bytes_left=20_000)
        assert done.code == 2
        assert done.err.count("error: ") == 1
        kept = len(workspace.records())
        asked = server.requests
        assert kept < SAMPLES
        assert asked - kept <= 2 * AT_ONCE

        workspace.completed()
        assert server.requests <= asked + SAMPLES - kept
        assert len({record["sample"] for record in workspace.records()}) == SAMPLES


@contextlib.contextmanager
def locked(workspace):
    """Hold the reply cache as another process would."""
    path = workspace.cache / "replies.sqlite"
    ReplyCache(path).close()
    with contextlib.closing(sqlite3.connect(path, isolation_level=None)) as db:
        db.execute("BEGIN IMMEDIATE")
        yield


def test_ctrl_c_ends_a_run_whose_cache_is_locked(workspace):
    with prepare(workspace, OpenAIChat(), AT_ONCE), locked(workspace), workspace.start() as process:
        until(lambda: catches(process.pid, signal.SIGTERM))
        time.sleep(1.0)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (130, "")
    assert "(interrupted)" in out


@pytest.mark.slow
def test_a_run_with_a_locked_cache_ends_as_without_one(workspace):
    with prepare(workspace, OpenAIChat(), AT_ONCE) as server, locked(workspace):
        done = workspace.completed()
        assert done.out.count("database is locked") == 1
        assert server.requests == SAMPLES


def catches(pid, number):
    """True if a process has its own handler of a signal, as one that asks models has of SIGTERM."""
    status = Path(f"/proc/{pid}/status").read_text(encoding="utf-8")
    (mask,) = re.findall(r"^SigCgt:\s*(\w+)", status, re.MULTILINE)
    return bool(int(mask, 16) >> (number - 1) & 1)
