"""Output on pipes, terminals, and outputs that know few characters."""

from __future__ import annotations

import os
import pty
import subprocess

import pytest

from tests.servers.chassis import Faults, Running
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import COMMAND, Workspace


def in_terminal(workspace: Workspace, answer: str, *args: str) -> tuple[int, str]:
    """Run with a terminal of 120 columns, and type `answer` first; exit code and screen. No page,
    which takes seconds.
    """
    master, slave = pty.openpty()
    with subprocess.Popen(
        [*COMMAND, "run", "suite.yaml", "--out", str(workspace.out), "--no-report", *args],
        cwd=workspace.root,
        env=workspace.env | {"TERM": "xterm-256color", "COLUMNS": "120", "LINES": "40"},
        stdin=slave,
        stdout=slave,
        stderr=slave,
        start_new_session=True,
    ) as process:
        os.close(slave)
        os.write(master, answer.encode())
        screen = b""
        while chunk := _read(master):
            screen += chunk
    os.close(master)
    return process.returncode, screen.decode()


def _read(master: int) -> bytes:
    try:
        return os.read(master, 65536)
    except OSError:  # Linux says EIO when the other side is closed.
        return b""


@pytest.fixture
def suite(workspace: Workspace) -> Workspace:
    workspace.write_suite()
    return workspace


def test_a_pipe_gets_whole_tables_without_escapes(suite: Workspace) -> None:
    done = suite.run()
    assert done.code == 0
    assert "\x1b" not in done.out
    assert [row.split()[0] for row in done.out.splitlines() if "[" in row] == ["oracle", "random"]
    assert done.out.splitlines()[-1] == "out/tables"


def test_a_terminal_shows_bars_and_then_the_tables(suite: Workspace) -> None:
    class Bracketing(OpenAIChat):
        """A model whose messages look like markup."""

        def error(self, status: int, ending: str, message: str) -> dict[str, object]:
            return super().error(status, ending, f"[/bold] busy [blink {message}")

    faults = Faults(latency_s=0.3, rate_limited=0.5, retry_after="0")
    with Running(Bracketing(faults)) as running:
        suite.write_models(running.url, "alpha", price={"input": 0.0, "output": 0.0})
        code, screen = in_terminal(
            suite, "", "--models", "alpha,oracle", "--set", "seeds=[0,1,2,3]"
        )
    assert code == 0
    assert "Traceback" not in screen
    assert "Go on?" not in screen
    assert "[/bold] busy [blink" in screen
    assert screen.index("20/20") < screen.index("Full planning, suite trial")
    assert "All 40 samples are done" in screen


@pytest.mark.parametrize(("answer", "code", "calls"), [("n\n", 1, 0), ("y\n", 0, 5)])
def test_a_person_is_asked_before_money_is_spent(
    suite: Workspace, answer: str, code: int, calls: int
) -> None:
    with Running(OpenAIChat()) as running:
        suite.write_models(running.url, "alpha", price={"input": 1.0, "output": 1.0})
        found, screen = in_terminal(suite, answer, "--models", "alpha")
        assert (found, running.server.requests) == (code, calls)
    assert "5 calls, about $" in screen
    assert "Go on?" in screen
    assert ("Nothing was asked." in screen) == (calls == 0)
    assert suite.out.exists() == (code == 0)


def test_tables_may_be_read_by_whoever_may_read_the_records(suite: Workspace) -> None:
    assert suite.run().code == 0
    modes = {path.stat().st_mode for path in suite.out.rglob("*") if path.is_file()}
    assert modes == {(suite.out / "records.jsonl").stat().st_mode}
    assert not list(suite.out.rglob("*.part"))


def test_nothing_is_spent_unasked_where_nobody_can_be_asked(suite: Workspace) -> None:
    with Running(OpenAIChat()) as running:
        suite.write_models(running.url, "alpha", price={"input": 1.0, "output": 1.0})
        refused = suite.run("--models", "alpha")
        assert (refused.code, running.server.requests) == (2, 0)
        assert "would cost money, and there is no terminal to ask on" in refused.err
        assert "5 calls, about $" in refused.out
        assert not suite.out.exists()
        running.server.faults = Faults(mode="400")
        limit = ["--set", "limits.max_cost_usd=1"]
        rejected = suite.run("--models", "alpha", *limit)
        assert (rejected.code, running.server.requests) == (1, 5), rejected.err
        # What was rejected is asked again only where somebody agrees to that.
        assert suite.run("--models", "alpha").code == 1
        again = suite.run("--models", "alpha", "--retry-failed")
        assert (again.code, running.server.requests) == (2, 5)
        assert "5 calls, about $" in again.out
        running.server.faults = Faults()
        limited = suite.run("--models", "alpha", *limit, "--retry-failed")
        assert (limited.code, running.server.requests) == (0, 10), limited.err


def test_a_price_is_asked_about_and_none_at_a_local_server_is_not(suite: Workspace) -> None:
    free, dear = ({"input": n, "output": n} for n in (0.0, 1.0))
    with Running(OpenAIChat()) as running:
        base = f"{running.url}/v1"
        entries = {
            name: {"id": f"hosted_vllm/{name}", "api_base": base, "price": price}
            for name, price in {"dear": dear, "free": free, "unknown": None}.items()
        }
        suite.write_yaml("models.yaml", entries)
        refused = suite.run("--models", "free,dear,unknown")
        assert (refused.code, running.server.requests) == (2, 0)
        assert "found: dear\n" in refused.err
        assert suite.run("--models", "free,unknown").code == 0


def test_yes_asks_no_person(suite: Workspace) -> None:
    with Running(OpenAIChat()) as running:
        suite.write_models(running.url, "alpha", price={"input": 1.0, "output": 1.0})
        code, screen = in_terminal(suite, "", "--models", "alpha", "--yes")
        assert (code, running.server.requests) == (0, 5)
    assert "Go on?" not in screen


def test_failed_calls_are_shown_with_what_the_provider_said(suite: Workspace) -> None:
    with Running(OpenAIChat(Faults(mode="400"))) as running:
        suite.write_models(running.url, "alpha")
        done = suite.run("--models", "alpha,oracle")
        assert done.code == 1
        assert "5 x alpha: HTTP 400: Invalid value for messages" in done.out
        assert "5 requests rejected for good" in done.out

        running.server.faults = Faults()
        same = suite.run("--models", "alpha,oracle")
        assert (same.code, running.server.requests) == (1, 5)
        mended = suite.run("--models", "alpha,oracle", "--retry-failed")
        assert (mended.code, running.server.requests) == (0, 10)
    assert "All 10 samples are done" in mended.out
    assert "rejected" not in mended.out


def test_the_folder_of_a_run_is_found_again_without_naming_it(suite: Workspace) -> None:
    first = suite.phyblock("run", "suite.yaml")
    assert first.code == 0
    (folder,) = (suite.root / "results").iterdir()
    assert folder.name.startswith("trial-")
    assert first.out.splitlines()[-1] == f"results/{folder.name}/report.html"
    before = suite.files()
    assert suite.phyblock("run", "suite.yaml").out == first.out
    assert suite.files() == before
