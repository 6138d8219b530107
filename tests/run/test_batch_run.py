"""Whole runs whose models are asked in batches: stopped, killed and resumed by the same command."""

import contextlib
import os
import re
import signal
import threading

import pytest

from phyblock.config.models import load_models
from phyblock.config.suite import load_suite
from phyblock.run.plan import estimate, make_plan
from tests.servers.batches import BatchFaults, OpenAIBatches
from tests.servers.chassis import Running

POLLING = {"batch_poll_s": 0.05}


def prepare(workspace, url, **suite):
    """A model that is asked in batches; `singly.yaml` is the same without them."""
    entry = {"id": "openai/gpt-4o-2024-08-06", "api_base": f"{url}/v1"}
    workspace.write_yaml("models.yaml", {"alpha": {**entry, "batch": True}})
    workspace.write_yaml("singly.yaml", {"alpha": entry})
    workspace.write_suite(**{"models": ["alpha"], "limits": POLLING, "seeds": [0, 1], **suite})


def counted_once(server, samples):
    """Both seeds of an item ask the same where no seeds are sent."""
    return sum(server.asked.values()) == samples and len(set(server.asked.values())) == 1


def test_a_run_that_waits_is_stopped_and_goes_on_by_the_same_command(workspace):
    """Between both commands the provider is asked nothing, and the estimate asks for no money."""
    with Running(OpenAIBatches(batch=BatchFaults(looks=10**6))) as running:
        server = running.server
        prepare(workspace, running.url)
        waits = threading.Event()
        looks = iter(range(10**6))

        def moment(name):
            # What the first look gave was told before the second.
            if name == "look done" and next(looks) == 1:
                waits.set()

        server.moment = moment
        with workspace.start("--yes") as process:
            assert waits.wait(60)
            process.send_signal(signal.SIGINT)
            out, err = process.communicate()
        assert (process.returncode, err) == (130, "")
        assert "waiting for batch batch-0 since" in out
        assert "0 of 10 samples are done (interrupted)" in out

        dry = workspace.run("--dry-run")
        assert "0 calls, about $0.00." in dry.out
        other = workspace.run("--set", "sampling.temperature=0.5")
        assert other.code == 2
        assert "holds another run" in other.err

        singly = workspace.run("--yes", "--models-file", "singly.yaml")
        assert singly.code == 2
        assert "has a batch in progress, whose questions would be asked twice" in singly.err
        assert not server.by_sample

        server.batch_faults = BatchFaults()
        done = workspace.completed("--yes")
        assert "All 10 samples are done" in done.out
        assert counted_once(server, 10)


def test_kills_of_the_process_lose_nothing_and_ask_nothing_twice(workspace):
    """When a batch is made and nobody heard, then when its answers are on their way."""
    with Running(OpenAIBatches()) as running:
        server = running.server
        prepare(workspace, running.url)
        assert killed_at(workspace, server, 3)
        assert server.calls[-1] == "create"
        for _ in range(2):
            refused = workspace.run("--yes")
            assert (refused.code, refused.err) == (1, "")
            assert "it is not known whether batch pb" in refused.out
        (line,) = set(re.findall(r"\{.*?\}", refused.out.replace("\n", " ")))
        with (workspace.out / "batches.jsonl").open("a") as ledger:
            ledger.write(line.replace('"ID"', '"batch-0"') + "\n")
        assert killed_at(workspace, server, 5)
        assert server.calls[-1] == "results"
        assert not workspace.records()
        workspace.completed("--yes")
        assert [record["outcome"] for record in workspace.records()] == ["ok"] * 10
        assert counted_once(server, 10)


def killed_at(workspace, server, number):
    """Kill a run at a moment of its server; True if it was reached."""
    reached, first, pids = threading.Event(), threading.Event(), []
    count = iter(range(10**6))

    def moment(_):
        if next(count) == number:
            first.wait(30)
            reached.set()
            with contextlib.suppress(ProcessLookupError):
                os.kill(pids[0], signal.SIGKILL)

    server.moment = moment
    with workspace.start("--yes") as process:
        pids.append(process.pid)
        first.set()
        process.communicate()
    server.moment = lambda _: None
    return reached.is_set()


def test_calls_in_batches_are_estimated_at_half_the_price(workspace):
    prepare(workspace, "http://127.0.0.1:9")
    suite = load_suite(workspace.root / "suite.yaml")
    costs = []
    for name in ("models.yaml", "singly.yaml"):
        plan = make_plan(suite, load_models(workspace.root / name), only=["alpha"])
        rows = estimate(plan, workspace.out, use_cache=False)
        costs.append(next((row.cost_usd, row.most_usd) for row in rows if row.calls))
    assert min(costs[0]) > 0
    assert [2 * usd for usd in costs[0]] == pytest.approx(costs[1])
