"""Runs that are ended by Ctrl-C, a kill or a mistake of ours, and failures: answers are kept."""

import asyncio
import contextlib
import itertools
import os
import re
import select
import signal
import sqlite3
import subprocess
import sys
import threading
import time
from functools import partial
from pathlib import Path

import psutil
import pytest

from phyblock.api import run_suite
from phyblock.models.cache import ReplyCache
from phyblock.records.files import STOPPED, read_stopped
from phyblock.results.load import load_run
from phyblock.run.plan import estimate
from phyblock.run.rescore import rescore
from phyblock.run.runner import Session, Stopping
from phyblock.run.store import AppendFile, Summary
from phyblock.sim import dynamics
from phyblock.tracks.full_planning import FullPlanning
from phyblock.tracks.pictures import Workshop
from phyblock.tracks.pose_planning import PosePlanning
from tests.fork_server import killed
from tests.servers.batches import BatchFaults, OpenAIBatches
from tests.servers.chassis import Faults, Running
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import SCENES, call, until

SAMPLES = 20
AT_ONCE = 4


def interrupted(process):
    out, err = process.communicate()
    assert (process.returncode, err) == (130, "")
    return out


def prepare(workspace, server, *names):
    limits = {"max_concurrency": AT_ONCE}
    return workspace.served(server, *names, seeds=[0, 1, 2, 3], limits=limits)


@pytest.mark.parametrize("name", [signal.SIGINT, signal.SIGTERM])
def test_calls_under_way_are_waited_for_and_no_other_is_sent(workspace, name):
    with prepare(workspace, OpenAIChat(holds=True), "alpha", "beta") as server:
        process = workspace.start()
        until(lambda: server.at_once == AT_ONCE)
        process.send_signal(name)
        assert f"waiting for {AT_ONCE} calls in progress" in process.stdout.readline()
        server.holds = False
        out = interrupted(process)
        assert f"{AT_ONCE} of {2 * SAMPLES} samples are done (interrupted)" in out
        assert f"phyblock run suite.yaml --out {workspace.out}" in out
        assert server.requests == AT_ONCE
        assert [record["outcome"] for record in workspace.records()] == ["ok"] * AT_ONCE

        assert f"All {2 * SAMPLES} samples are done" in workspace.completed().out
        before = workspace.files()
        workspace.completed()
        assert server.requests == 2 * SAMPLES
        assert workspace.files() == before


def test_a_second_interrupt_ends_at_once(workspace):
    with prepare(workspace, OpenAIChat(Faults(mode="slow"))) as server:
        process = workspace.start()
        until(lambda: server.at_once == AT_ONCE)
        process.send_signal(signal.SIGINT)
        assert "Ctrl-C again" in process.stdout.readline()
        process.send_signal(signal.SIGINT)
        out = interrupted(process)
    assert f"0 of {SAMPLES} samples are done (interrupted)" in out
    assert "run the same command again" in out
    assert not workspace.records()


PROGRAM = """
import signal, sys, phyblock
for folder in sys.argv[1:]:
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        phyblock.run_suite("suite.yaml", out=folder)
    except KeyboardInterrupt:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        print("interrupted", flush=True)
    else:
        print("went on", flush=True)
"""


def test_a_program_is_interrupted_in_a_run_as_well_at_any_time(workspace):
    opening, asking, waiting = folders = [workspace.root / name for name in ("a", "b", "c")]
    told = workspace.root / "told"
    command = [sys.executable, "-c", PROGRAM, *map(str, folders)]
    slow = OpenAIChat(Faults(latency_s=1.0))
    with prepare(workspace, slow) as server, told.open("w", encoding="utf-8") as errors:
        locked = sqlite3.connect(workspace.cache / "replies.sqlite", isolation_level=None)
        locked.execute("BEGIN EXCLUSIVE")
        options = {"cwd": workspace.root, "env": workspace.env, "text": True}
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, **options)
        with process, process.stdout as said:
            try:
                # The reply cache is opened last; until it is unlocked, the run is not open.
                until((opening / "run.yaml").exists)
                process.send_signal(signal.SIGINT)
                locked.close()
                assert said.readline() == "interrupted\n"
                assert (server.requests, workspace.records(opening)) == (0, [])

                until(lambda: server.requests == AT_ONCE)
                server.faults = Faults(mode="slow")
                process.send_signal(signal.SIGINT)
                assert said.readline() == "interrupted\n"
                assert len(workspace.records(asking)) == AT_ONCE
                last = told.read_text(encoding="utf-8").splitlines()[-1]
                assert f"interrupted; waiting for {AT_ONCE} calls" in last

                until(lambda: server.requests == 2 * AT_ONCE)
                while not select.select([said], [], [], 0.5)[0]:
                    process.send_signal(signal.SIGINT)
                assert said.readline() == "interrupted\n"
                # The first four are known from the run before.
                assert len(workspace.records(waiting)) == AT_ONCE
                assert process.wait(60) == 0
            finally:
                process.kill()
        assert server.requests == 2 * AT_ONCE


class FirstAtOnce(OpenAIChat):
    """Answers the first request when all are there, and the others when that is long done."""

    async def _end(self, seen, ending, request):
        if seen is self.seen[0]:
            while self.at_once < AT_ONCE:
                await asyncio.sleep(0.01)
        else:
            await asyncio.sleep(1.0)
        return await super()._end(seen, ending, request)


def session(workspace, watch, model):
    workspace.write_suite(models=[model], seeds=[0, 1, 2, 3], limits={"max_concurrency": AT_ONCE})
    plan = workspace.plan("models.yaml" if model == "alpha" else None)
    return Session(plan, workspace.out, watch, use_cache=False)


@pytest.mark.parametrize("place", ["judge", "watch"])
def test_a_mistake_of_ours_loses_no_call_under_way(workspace, monkeypatch, place):
    judge = FullPlanning.judge
    judged = []

    def judges_badly(self, item, text):
        judged.append(item)
        if len(judged) == 1:
            # Why the run stopped cannot be noted then, which hides nothing.
            (workspace.out / STOPPED).mkdir()
            raise ZeroDivisionError("in judge")
        return judge(self, item, text)

    def watches_badly(event):
        if isinstance(event, Summary | Stopping):
            raise ZeroDivisionError("in watch")

    watch = watches_badly if place == "watch" else id
    if place == "judge":
        monkeypatch.setattr(FullPlanning, "judge", judges_badly)
    with Running(FirstAtOnce()) as running:
        workspace.write_models(running.url, "alpha")
        with pytest.raises(ZeroDivisionError, match=f"in {place}"):
            asyncio.run(session(workspace, watch, "alpha").run())
        assert running.server.ended == {"ok": AT_ONCE}
    assert len(workspace.records()) == AT_ONCE - (place == "judge")


def test_an_impatient_cancellation_keeps_all_that_was_answered(workspace, monkeypatch):
    begun, may_end = threading.Event(), threading.Event()
    append, put = AppendFile.append, AppendFile.put
    answered = []

    async def notes(self, record):
        answered.append(record.sample)
        await put(self, record)

    def appends_slowly(self, lines):
        lines = list(lines)
        if "run" in lines[0]:
            begun.set()
            assert may_end.wait(20)
        append(self, lines)

    async def run():
        opened = session(workspace, id, "random")
        running = asyncio.create_task(opened.run())
        await asyncio.to_thread(begun.wait, 20)
        opened.interrupt()
        for _ in range(3):
            running.cancel()
            for _ in range(10):
                await asyncio.sleep(0)
        may_end.set()
        with pytest.raises(asyncio.CancelledError):
            await running
        assert opened.result.stop.cause == "interrupted"

    monkeypatch.setattr(AppendFile, "append", appends_slowly)
    monkeypatch.setattr(AppendFile, "put", notes)
    asyncio.run(run())
    assert len(answered) > 1
    assert sorted(record["sample"] for record in workspace.records()) == sorted(answered)


def test_a_reply_whose_judging_kills_is_recorded_and_scored_later(inside, monkeypatch, capsys):
    inside.write_suite(tracks=["pose_planning"], models=["oracle"])
    marks = inside.root / "marks"
    marks.mkdir()
    whole = PosePlanning.judge_apart

    async def fatal(track, item, text, earlier):
        if text is not None and item.key == SCENES[0]["id"]:
            await track.compute(partial(killed, marks, 2))
        return await whole(track, item, text, earlier)

    monkeypatch.setattr(PosePlanning, "judge_apart", fatal)
    call("run", "suite.yaml", "--out", "out", "--no-report", "--limit", "2")
    lost, other = sorted(inside.records(), key=lambda record: record["scene"])
    assert lost["error"]["kind"] == "unjudged"
    assert "was killed twice" in lost["error"]["message"]
    assert (bool(lost["reply"]["text"]), other["outcome"]) == (True, "ok")
    told = capsys.readouterr().out
    assert "1 answer could not be judged: phyblock score out tries again, without a call" in told
    assert "rejected" not in told
    with pytest.warns(UserWarning, match="1 answer could not be judged: phyblock score out"):
        run_suite("suite.yaml", out="out", limit=2)
    # A plan that takes too long is given up, in a worker or without one, and says so.
    monkeypatch.setattr(PosePlanning, "judge_apart", whole)
    monkeypatch.setattr(dynamics, "LONGEST_S", -1.0)
    rescore(inside.out)
    given_up = next(one for one in inside.records() if one["sample"] == lost["sample"])
    assert (given_up["error"]["kind"], given_up["reply"]) == ("unjudged", lost["reply"])
    assert "step 1 was not reached within -1 s" in given_up["error"]["message"]
    monkeypatch.undo()
    rescore(inside.out)
    for again in inside.records():
        assert (again["outcome"], again["pose"]["completed"], again["error"]) == ("ok", True, None)


def test_a_reply_that_is_judged_at_a_second_interrupt_is_recorded(inside, monkeypatch, capsys):
    inside.write_suite(tracks=["pose_planning"], models=["oracle"])

    async def slow(track, item, text, _):
        for _ in range(2):
            os.kill(os.getpid(), signal.SIGINT)
            await asyncio.sleep(0.1)
        return track.judge(item, text)

    monkeypatch.setattr(PosePlanning, "judge_apart", slow)
    call("run", "suite.yaml", "--out", "out", "--no-report", "--limit", "1")
    assert "All 1 samples are done" in capsys.readouterr().out
    assert [record["outcome"] for record in inside.records()] == ["ok"]


def test_no_process_outlives_a_killed_run(workspace):
    """Pictures are drawn by processes of the run's own."""
    (workspace.cache / "pictures").unlink()
    with prepare(workspace, OpenAIChat()):
        with workspace.start("--yes") as process:
            family = []

            def draws():
                with contextlib.suppress(psutil.NoSuchProcess):
                    family[:] = psutil.Process(process.pid).children(recursive=True)
                    return any("spawn_main" in " ".join(child.cmdline()) for child in family)

            until(draws)
            process.kill()
            process.wait()
        _, alive = psutil.wait_procs(family, timeout=30)
    assert not alive


def test_work_of_a_worker_that_was_killed_once_is_done_again(tmp_path):
    shop = Workshop(1)
    assert asyncio.run(shop.compute(partial(killed, tmp_path, 1))) == "done"
    shop.close()


@pytest.mark.parametrize("words", ["HTTP 429", "no connection to 127.0.0.1:9"])
def test_a_wait_for_another_attempt_or_for_a_server_is_given_up(workspace, words):
    with prepare(workspace, OpenAIChat(Faults(mode="429", retry_after="100"))) as server:
        if "429" not in words:
            workspace.write_models("http://127.0.0.1:9", "alpha")
        process = workspace.start()
        while words not in process.stdout.readline():
            assert process.poll() is None
        until(lambda: not server.at_once)
        process.send_signal(signal.SIGINT)
        assert f"0 of {SAMPLES} samples are done (interrupted)" in interrupted(process)
    assert not workspace.records()
    assert server.requests <= AT_ONCE


# Runs whose models are asked in batches.


def prepare_batches(workspace, url):
    """A model that is asked in batches; `singly.yaml` is the same without them."""
    entry = {"id": "openai/gpt-4o-2024-08-06", "api_base": f"{url}/v1"}
    workspace.write_yaml("models.yaml", {"alpha": {**entry, "batch": True}})
    workspace.write_yaml("singly.yaml", {"alpha": entry})
    workspace.write_suite(models=["alpha"], limits={"batch_poll_s": 0.05}, seeds=[0, 1])


def counted_once(server, samples):
    """Both seeds of an item ask the same where no seeds are sent."""
    return sum(server.asked.values()) == samples and len(set(server.asked.values())) == 1


def test_a_run_that_waits_is_stopped_and_goes_on_by_the_same_command(workspace):
    """Between both commands the provider is asked nothing, and the estimate asks for no money."""
    with Running(OpenAIBatches(batch=BatchFaults(looks=10**6))) as running:
        server = running.server
        prepare_batches(workspace, running.url)
        waits = threading.Event()

        def moment(name):
            # What the first look gave was told before the second.
            if (name, server.calls.count("look")) == ("look done", 2):
                waits.set()

        server.moment = moment
        with workspace.start("--yes") as process:
            assert waits.wait(60)
            process.send_signal(signal.SIGINT)
            out = interrupted(process)
        assert "waiting for batch batch-0 since" in out
        assert "0 of 10 samples are done (interrupted)" in out

        assert "0 calls, about $0.00." in workspace.run("--dry-run").out
        assert "holds another run" in workspace.refused("--set", "sampling.temperature=0.5")
        said = workspace.refused("--yes", "--models-file", "singly.yaml")
        assert "has a batch in progress, whose questions would be asked twice" in said
        assert not server.by_sample

        server.batch = BatchFaults()
        assert "All 10 samples are done" in workspace.completed("--yes").out
        assert counted_once(server, 10)


def test_kills_of_the_process_lose_nothing_and_ask_nothing_twice(workspace):
    """When a batch is made and nobody heard, then when its answers are on their way."""
    with Running(OpenAIBatches()) as running:
        server = running.server
        prepare_batches(workspace, running.url)
        kill_at(3, workspace, server)
        assert server.calls[-1] == "create"
        for _ in range(2):
            done = workspace.run("--yes")
            assert (done.code, done.err) == (1, "")
            assert "it is not known whether batch pb" in done.out
        (line,) = set(re.findall(r"\{.*?\}", done.out.replace("\n", " ")))
        with (workspace.out / "batches.jsonl").open("a") as ledger:
            ledger.write(line.replace('"ID"', '"batch-0"') + "\n")
        kill_at(5, workspace, server)
        assert server.calls[-1] == "results"
        assert not workspace.records()
        workspace.completed("--yes")
        assert [record["outcome"] for record in workspace.records()] == ["ok"] * 10
        assert counted_once(server, 10)


def kill_at(number, workspace, server):
    reached, is_dead = threading.Event(), threading.Event()
    count = itertools.count()

    def moment(_):
        if next(count) == number:
            reached.set()
            is_dead.wait(30)

    server.moment = moment
    with workspace.start("--yes") as process:
        assert reached.wait(60)
        process.kill()
        process.wait()
        server.moment = id
        is_dead.set()


def test_calls_in_batches_are_estimated_at_half_the_price(workspace):
    prepare_batches(workspace, "http://127.0.0.1:9")
    costs = []
    for name in ("models.yaml", "singly.yaml"):
        (row,) = estimate(workspace.plan(name), workspace.out, use_cache=False)
        costs.append((row.cost_usd, row.most_usd))
    assert min(costs[0]) > 0
    assert [2 * usd for usd in costs[0]] == pytest.approx(costs[1])


# Failures of a provider and of the reply cache: retried, recorded by kind, said once.


class BySeed(OpenAIChat):
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
    for name in outcomes:
        assert int(told[name]) == 5 * outcomes.count(name)


@contextlib.contextmanager
def locked(workspace, begin="BEGIN IMMEDIATE"):
    """The reply cache, held as another process would hold it, or not."""
    path = workspace.cache / "replies.sqlite"
    ReplyCache(path).close()
    with contextlib.closing(sqlite3.connect(path, isolation_level=None)) as db:
        db.execute(begin)
        yield db


@pytest.mark.parametrize("room", [3, SAMPLES - 1])
def test_a_cache_that_takes_no_more_is_said_once_and_all_is_recorded(workspace, room):
    with locked(workspace, begin="") as db, prepare(workspace, OpenAIChat()) as server:
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
    with prepare(workspace, OpenAIChat(Faults(latency_s=0.01))) as server:
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

    with prepare(workspace, OpenAIChat()), locked(workspace), workspace.start() as process:
        until(catches_sigterm)
        time.sleep(1.0)
        process.send_signal(signal.SIGINT)
        assert "(interrupted)" in interrupted(process)


@pytest.mark.slow
def test_a_run_with_a_locked_cache_ends_as_without_one(workspace):
    with prepare(workspace, OpenAIChat()) as server, locked(workspace):
        done = workspace.completed()
        assert done.out.count("database is locked") == 1
        assert server.requests == SAMPLES
