"""Failures of a provider and of the reply cache: retried, recorded by kind, said once."""

import contextlib
import itertools
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


def coverage(workspace):
    table = load_run(workspace.out).table("coverage").astype(str)
    return {row["model"]: row for row in table.to_dict("records")}


def test_a_model_that_cannot_answer_is_stopped_alone(workspace):
    modes = {"locked": "401", "unknown": "404", "fine": "ok"}
    servers = {name: OpenAIChat(Faults(mode=mode)) for name, mode in modes.items()}
    with contextlib.ExitStack() as stack:
        at = {name: stack.enter_context(Running(server)) for name, server in servers.items()}
        workspace.write_served({name: running.url for name, running in at.items()})
        workspace.write_suite(models=list(modes), seeds=list(range(20)))
        done = workspace.run("--set", "limits.max_concurrency=6")
        assert (done.code, done.err) == (1, "")
        assert "locked was stopped: HTTP 401: Incorrect API key provided" in done.out
        assert "unknown was stopped: HTTP 404: The model unknown does not exist" in done.out
        assert "100 of 300 samples are done" in done.out
        # Reports made later, from the folder alone, know it too.
        stopped = read_stopped(workspace.out).models
        told = {name: why[:8] for name, why in stopped.items()}
        assert told == {"locked": "HTTP 401", "unknown": "HTTP 404"}
        assert max(servers[name].requests for name in told) <= 6
        told = coverage(workspace)
        assert [int(told[name]["ok"]) for name in modes] == [0, 0, 100]
        assert {row["expected"] for row in told.values()} == {"100"}

        # The key is set right, the name too: the same command asks for what is missing alone.
        for server in servers.values():
            server.faults = Faults()
        assert "All 300 samples" in workspace.completed("--set", "limits.max_concurrency=6").out
    assert not (workspace.out / STOPPED).exists()
    assert {server.ended["ok"] for server in servers.values()} == {100}


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
        for record in records:
            whole = [score for score in record["scores"] if score["criterion"] == "aov"]
            scored = {(score["setting"], score["matcher"]) for score in whole}
            assert scored == set(itertools.product("AB", ("optimal", "paper")))
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


@contextlib.contextmanager
def opened_cache(workspace, begin=""):
    """The reply cache, which another process may hold."""
    path = workspace.cache / "replies.sqlite"
    ReplyCache(path).close()
    with contextlib.closing(sqlite3.connect(path, isolation_level=None)) as db:
        db.execute(begin)
        yield db


def locked(workspace):
    return opened_cache(workspace, "BEGIN IMMEDIATE")


@pytest.mark.parametrize("room", [3, SAMPLES - 1])
def test_a_cache_that_takes_no_more_is_said_once_and_all_is_recorded(workspace, room):
    with opened_cache(workspace) as db, prepare(workspace, OpenAIChat()) as server:
        db.execute(
            "CREATE TRIGGER full BEFORE INSERT ON replies WHEN (SELECT count(*) FROM replies) >= "
            f"{room} BEGIN SELECT RAISE(ABORT, 'the disk is full'); END"
        )
        done = workspace.completed()
        (said,) = [line for line in done.out.splitlines() if "the disk is full" in line]
        assert str(workspace.cache / "replies.sqlite") in said
        assert "going on without it" in said
        assert f"All {SAMPLES} samples are done" in done.out
        assert server.ended == {"ok": SAMPLES}
        assert [record["outcome"] for record in workspace.records()] == ["ok"] * SAMPLES
        assert db.execute("SELECT count(*) FROM replies").fetchone() == (room,)
        db.execute("DROP TRIGGER full")
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


def test_ctrl_c_ends_a_run_whose_cache_is_locked(workspace):
    def catches_sigterm():
        """As a process that asks models does."""
        status = Path(f"/proc/{process.pid}/status").read_text(encoding="utf-8")
        (mask,) = re.findall(r"^SigCgt:\s*(\w+)", status, re.MULTILINE)
        return int(mask, 16) >> (signal.SIGTERM - 1) & 1

    with prepare(workspace, OpenAIChat(), AT_ONCE), locked(workspace), workspace.start() as process:
        until(catches_sigterm)
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
