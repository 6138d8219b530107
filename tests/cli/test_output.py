"""Output of commands: on pipes and in terminals, and never over what is the user's."""

import contextlib
import os
import pty
import re
import subprocess
from concurrent.futures import ThreadPoolExecutor

import click
import pytest

from phyblock.errors import StoreError
from phyblock.files import LIST
from phyblock.results.tables import write_tables
from phyblock.web.pages import write_report
from tests.servers.chassis import Faults
from tests.servers.openai_chat import OpenAIChat
from tests.web.factory import LEVELS, manifest, record, score, write_run
from tests.workspace import COMMAND, files_below, invoked


def in_terminal(workspace, answer):
    """Run with a terminal of 120 columns, and type `answer` first; exit code and screen."""
    master, slave = pty.openpty()
    words = [*COMMAND, "run", "suite.yaml", "--out", str(workspace.out), "--no-report"]
    env = workspace.env | {"TERM": "xterm-256color", "COLUMNS": "120", "LINES": "40"}
    ends = dict.fromkeys(("stdin", "stdout", "stderr"), slave)
    with subprocess.Popen(
        words, cwd=workspace.root, env=env, start_new_session=True, **ends
    ) as process:
        os.close(slave)
        os.write(master, answer.encode())
        screen = b""
        # Linux says EIO when the other side is closed.
        with contextlib.suppress(OSError):
            while chunk := os.read(master, 65536):
                screen += chunk
    os.close(master)
    return process.returncode, screen.decode()


@pytest.fixture
def suite(workspace, monkeypatch):
    workspace.write_suite()
    for name, value in workspace.env.items():
        monkeypatch.setenv(name, value)
    return workspace


def test_a_terminal_shows_bars_and_then_the_tables(suite):
    class Bracketing(OpenAIChat):
        """A model whose messages look like markup."""

        def error(self, status, ending, message):
            return super().error(status, ending, f"[/bold] busy [blink {message}")

    faults = Faults({"429": 0.5}, latency_s=0.3, retry_after="0")
    entry = {"price": {"input": 0.0, "output": 0.0}}
    asked = {"models": ["alpha", "oracle"], "seeds": [0, 1, 2, 3]}
    with suite.served(Bracketing(faults), entry=entry, **asked):
        code, screen = in_terminal(suite, "")
    assert code == 0
    assert "Continue?" not in screen
    assert "[/bold] busy [blink" in screen
    assert screen.index("20/20") < screen.index("Full planning, suite trial")


@pytest.mark.parametrize(("answer", "code", "calls"), [("n\n", 1, 0), ("y\n", 0, 5)])
def test_a_person_is_asked_before_money_is_spent(suite, answer, code, calls):
    with suite.served(OpenAIChat(), entry={"price": {"input": 1.0, "output": 1.0}}) as server:
        found, screen = in_terminal(suite, answer)
    assert (found, server.requests, suite.out.exists()) == (code, calls, code == 0)
    assert re.search(r"5 calls, about \$(?s:.*)Continue\?", screen)
    assert ("Nothing was asked." in screen) == (calls == 0)


def test_nothing_is_spent_unasked_where_nobody_can_be_asked(suite):
    with suite.served(OpenAIChat(), entry={"price": {"input": 1.0, "output": 1.0}}) as server:
        refused = suite.run()
        assert (refused.code, server.requests) == (2, 0)
        assert "would cost money, and there is no terminal to ask on" in refused.err
        assert "5 calls, about $" in refused.out
        assert not suite.out.exists()
        server.faults = Faults(mode="400")
        limit = ["--set", "limits.max_cost_usd=1"]
        rejected = suite.run(*limit)
        assert (rejected.code, server.requests) == (1, 5), rejected.err
        # What was rejected is asked again only where somebody agrees to that.
        assert suite.run().code == 1
        again = suite.run("--retry-failed")
        assert (again.code, server.requests) == (2, 5)
        assert "5 calls, about $" in again.out
        server.faults = Faults()
        limited = suite.run(*limit, "--retry-failed")
        assert (limited.code, server.requests) == (0, 10), limited.err
        more = ["--set", "seeds=[7]"]
        assert (suite.run(*more).code, server.requests) == (2, 10)
        suite.completed(*more, "--yes")
        assert server.requests == 15


def test_the_folder_of_a_run_is_found_again_without_naming_it(suite):
    first = suite.does("run", "suite.yaml")
    (folder,) = (suite.root / "results").iterdir()
    assert folder.name.startswith("trial-")
    assert first.out.splitlines()[-1] == f"results/{folder.name}/report.html"
    before = suite.files()
    again = suite.does("run", "suite.yaml")
    assert f"phyblock report results/{folder.name} --print shows its tables." in again.out
    assert suite.files() == before


def put(path, text="mine"):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def link(path):
    """A link at `path` to a folder of the user's beside the out folder."""
    put(path.parent.parent / "elsewhere" / "ch1" / "thesis.tex")
    path.symlink_to(path.parent.parent / "elsewhere", target_is_directory=True)


@pytest.fixture
def finished(tmp_path):
    """A run folder with records, begun by this version."""
    records = [record(scene=scene, scores=[score(1, 1, 1)]) for scene in LEVELS]
    folder = write_run(tmp_path / "run", records, manifest(models=["alpha"], seeds=[0]))
    put(folder / LIST, "# ours\n")
    return folder


def test_an_empty_path_is_a_slip_and_not_this_folder():
    named = "run quick --out, run, run quick --models-file, report, init, bundle run --out"
    more = "export run --to csv --out, scenes render phyblock-400 --out"
    for words in f"{named}, {more}".split(", "):
        with pytest.raises(click.UsageError, match="empty"):
            invoked(*words.split(), "")


def test_a_tilde_is_the_home_folder(suite, monkeypatch):
    home = str(suite.root / "home")
    monkeypatch.chdir(suite.root)
    invoked("init", "~/bench", HOME=home)
    invoked("run", suite.root / "suite.yaml", "--out", "~/run", "--no-report", HOME=home)
    assert (suite.root / "home" / "bench" / "models.yaml").is_file()
    assert "Full planning" in invoked("report", "~/run", "--print", HOME=home).output
    assert not (suite.root / "~").exists()


IN_THE_WAY = {
    "report": (lambda run: put(run / "report"), "report: cannot be written in: it is not a folder"),
    "linked-report": (lambda run: link(run / "report"), "report: .*it is a link"),
    "linked-tables": (lambda run: link(run / "tables"), "tables: .*it is a link"),
    "page": (lambda run: put(run / "report.html"), r"report\.html: .*phyblock did not make"),
    "table": (lambda run: put(run / "tables" / "table1.tex"), "table1.tex: .*did not make"),
}


@pytest.mark.parametrize("name", IN_THE_WAY)
def test_what_is_in_the_way_is_named_and_stays(finished, name):
    prepare, said = IN_THE_WAY[name]
    prepare(finished)
    before = files_below(finished.parent)
    with pytest.raises(StoreError, match=said):
        invoked("report", finished)
    after = files_below(finished.parent)
    assert all(after[path] == before[path] for path in before if not path.endswith(LIST))
    assert not (finished / "report").is_dir() or (finished / "report").is_symlink()


def test_a_verb_writes_through_no_link(suite):
    put(suite.root / "theirs")
    words = ("run", suite.root / "suite.yaml", "--out", suite.out)
    invoked(*words, "--no-report")
    (suite.out / "calls.jsonl").symlink_to(suite.root / "theirs")
    with pytest.raises(StoreError, match=r"calls\.jsonl: is a link"):
        invoked(*words)
    assert (suite.root / "theirs").read_text() == "mine"


WRITING = {
    "export {run} --to csv": "records.csv",
    "compare {run}": "ranks.csv",
    "figures {run} --only errors": "errors.pdf",
    "scenes generate --jobs 1": "SHA256SUMS",
    "questions generate --jobs 1": "SHA256SUMS",
    "scenes render phyblock-400 l1-001-animal": "l1-001-animal-oblique-checkerboard.png",
}


@pytest.mark.parametrize(("words", "name"), WRITING.items())
def test_a_verb_writes_over_its_own_files_and_no_others(tmp_path, words, name):
    records = [
        record(model, scene, scores=[score(1, 1, 1)])
        for model in ("alpha", "beta")
        for scene in LEVELS
    ]
    run = write_run(tmp_path / "run", records, manifest(seeds=[0]))
    called, said = words.format(run=run).split(), "already there"
    if "generate" not in words:
        said = "phyblock did not make"
        for _ in range(2):
            invoked(*called, "--out", tmp_path / "ours")
    put(tmp_path / "theirs" / name)
    with pytest.raises(StoreError, match=f"{re.escape(name)}: .*{said}"):
        invoked(*called, "--out", tmp_path / "theirs")
    assert (tmp_path / "theirs" / name).read_text() == "mine"
    assert set(files_below(tmp_path / "theirs")) <= {name, LIST}


def test_output_that_nobody_takes_is_no_traceback(suite):
    def models(output):
        pipes = {"stdout": output, "stderr": subprocess.PIPE, "text": True}
        env = suite.env | {"PYTHONIOENCODING": "ascii"}
        done = subprocess.run([*COMMAND, "models"], env=env, **pipes)
        return done.returncode, done.stderr

    with open("/dev/full", "wb") as full:
        code, said = models(full)
    assert (code, said) == (2, "error: output: cannot be used: No space left on device\n")
    reader, writer = os.pipe()
    os.close(reader)
    assert models(writer) == (1, "")
    os.close(writer)


def test_reports_that_are_written_at_once_all_come_to_their_end(finished):
    with ThreadPoolExecutor(3) as pool:
        pages = list(pool.map(lambda run: write_report(write_tables(run)), [finished] * 3))
    assert set(pages) == {finished / "report.html"}
    (build,) = (finished / "report").iterdir()
    assert {path.name for path in build.iterdir()} >= {"samples.js", "records-0.js"}
    assert f"report/{build.name}" in pages[0].read_text(encoding="utf-8")


def test_a_run_goes_on_only_where_its_report_can_be_written(suite):
    words = ("run", suite.root / "suite.yaml", "--out", suite.out)
    invoked(*words, "--no-report")
    put(suite.out / "tables" / "mine.md")
    before = files_below(suite.root).items()
    for name in ("report", "linked-report", "page"):
        prepare, said = IN_THE_WAY[name]
        prepare(suite.out)
        with pytest.raises(StoreError, match=said):
            invoked(*words)
        for path in (suite.out / "report", suite.out / "report.html"):
            path.unlink(missing_ok=True)
    assert before <= files_below(suite.root).items()
    invoked(*words, "--no-report")
