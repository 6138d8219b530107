"""Ctrl-C: calls under way are waited for, the rest is left, and the same command goes on."""

from __future__ import annotations

import select
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable

import pytest

from tests.fork_server import Forked
from tests.servers.chassis import Faults, Running
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import Workspace

SAMPLES = 20
AT_ONCE = 4


def wait_for(condition: Callable[[], bool]) -> None:
    for _ in range(3000):
        if condition():
            return
        time.sleep(0.01)
    raise AssertionError("this did not come to pass")


def ended(process: Forked) -> tuple[int, str, str]:
    out, err = process.communicate(timeout=60)
    return process.returncode, out, err


def interrupted(process: Forked, server: OpenAIChat, name: signal.Signals) -> tuple[int, str, str]:
    """Interrupt a run while its calls are held, and let them be answered once it waits for them."""
    wait_for(lambda: server.at_once == AT_ONCE)
    process.send_signal(name)
    assert process.stdout is not None
    assert f"waiting for {AT_ONCE} calls under way" in process.stdout.readline()
    server.holds = False
    return ended(process)


def prepare(workspace: Workspace, url: str, *names: str) -> None:
    workspace.write_models(url, *names)
    workspace.write_suite(
        models=list(names), seeds=[0, 1, 2, 3], limits={"max_concurrency": AT_ONCE}
    )


@pytest.mark.parametrize("name", [signal.SIGINT, signal.SIGTERM])
def test_calls_under_way_are_waited_for_and_nothing_more_is_asked(
    workspace: Workspace, name: signal.Signals
) -> None:
    with Running(OpenAIChat(holds=True)) as running:
        server = running.server
        prepare(workspace, running.url, "alpha")
        code, out, err = interrupted(workspace.start(), server, name)

        assert (code, err) == (130, "")
        assert f"{AT_ONCE} of {SAMPLES} samples are done (interrupted)" in out
        assert f"phyblock run suite.yaml --out {workspace.out}" in out
        assert server.requests == AT_ONCE
        assert [record["outcome"] for record in workspace.records()] == ["ok"] * AT_ONCE

        server.faults = Faults()
        done = workspace.run()
        assert (done.code, done.err) == (0, "")
        assert f"All {SAMPLES} samples are done" in done.out
        assert server.requests == SAMPLES
        before = workspace.files()
        again = workspace.run()
        assert (again.code, again.out) == (0, done.out)
        assert server.requests == SAMPLES
        assert workspace.files() == before


def test_calls_that_wait_for_their_turn_are_not_sent_any_more(workspace: Workspace) -> None:
    with Running(OpenAIChat(holds=True)) as running:
        server = running.server
        prepare(workspace, running.url, "alpha", "beta")
        code, _, _ = interrupted(workspace.start(), server, signal.SIGINT)
    assert code == 130
    assert server.requests == AT_ONCE
    assert len(workspace.records()) == AT_ONCE


def test_a_wait_before_another_attempt_is_given_up(workspace: Workspace) -> None:
    with Running(OpenAIChat(Faults(rate_limited=1.0, retry_after="100"))) as running:
        server = running.server
        prepare(workspace, running.url, "alpha")
        process = workspace.start()
        wait_for(lambda: server.requests == AT_ONCE and not server.at_once)
        process.send_signal(signal.SIGINT)
        code, out, err = ended(process)
    assert (code, err) == (130, "")
    assert f"0 of {SAMPLES} samples are done" in out
    assert not workspace.records()
    assert server.requests == AT_ONCE


def test_a_wait_for_a_server_that_cannot_be_reached_is_given_up(workspace: Workspace) -> None:
    prepare(workspace, "http://127.0.0.1:9", "alpha")
    process = workspace.start()
    assert process.stdout is not None
    while "http://127.0.0.1:9 cannot be reached" not in process.stdout.readline():
        assert process.poll() is None
    process.send_signal(signal.SIGINT)
    code, out, err = ended(process)
    assert (code, err) == (130, "")
    assert f"0 of {SAMPLES} samples are done (interrupted)" in out
    assert not workspace.records()


def test_a_second_interrupt_ends_at_once(workspace: Workspace) -> None:
    with Running(OpenAIChat(Faults(mode="slow"))) as running:
        prepare(workspace, running.url, "alpha")
        process = workspace.start()
        wait_for(lambda: running.server.at_once == AT_ONCE)
        process.send_signal(signal.SIGINT)
        assert process.stdout is not None
        said = process.stdout.readline()
        assert "Ctrl-C again" in said
        process.send_signal(signal.SIGINT)
        code, out, err = ended(process)
    assert (code, err) == (130, "")
    assert f"0 of {SAMPLES} samples are done (interrupted)" in out
    assert "give the same command again" in out
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


def test_a_program_is_interrupted_in_a_run_as_well_at_any_time(workspace: Workspace) -> None:
    opening, asking, waiting = folders = [workspace.root / name for name in ("a", "b", "c")]
    told = workspace.root / "told"
    slow = OpenAIChat(Faults(latency_s=1.0))
    with Running(slow) as running, told.open("w", encoding="utf-8") as errors:
        server = running.server
        prepare(workspace, running.url, "alpha")
        locked = sqlite3.connect(workspace.cache / "replies.sqlite", isolation_level=None)
        locked.execute("BEGIN EXCLUSIVE")
        process = subprocess.Popen(
            [sys.executable, "-c", PROGRAM, *map(str, folders)],
            cwd=workspace.root,
            env=workspace.env,
            stdout=subprocess.PIPE,
            stderr=errors,
            text=True,
        )
        assert process.stdout is not None
        with process, process.stdout as said:
            try:
                # The reply cache is opened last; until it is unlocked, the run is not open.
                wait_for((opening / "run.yaml").exists)
                process.send_signal(signal.SIGINT)
                locked.close()
                assert said.readline() == "interrupted\n"
                assert (server.requests, workspace.records(opening)) == (0, [])

                wait_for(lambda: server.requests == AT_ONCE)
                server.faults = Faults(mode="slow")
                process.send_signal(signal.SIGINT)
                assert said.readline() == "interrupted\n"
                assert len(workspace.records(asking)) == AT_ONCE
                last = told.read_text(encoding="utf-8").splitlines()[-1]
                assert f"interrupted; waiting for {AT_ONCE} calls" in last

                wait_for(lambda: server.requests == 2 * AT_ONCE)
                while not select.select([said], [], [], 0.5)[0]:
                    process.send_signal(signal.SIGINT)
                assert said.readline() == "interrupted\n"
                # The first four are known from the run before.
                assert len(workspace.records(waiting)) == AT_ONCE
                assert process.wait(60) == 0
            finally:
                process.kill()
        assert server.requests == 2 * AT_ONCE
