"""A run that another version of phyblock judged: refused until it is scored, then gone on with."""

import re
import shutil
import sys
from collections import Counter

import pytest

from phyblock.errors import StoreError
from phyblock.parsing.answer import parse_move
from phyblock.parsing.plan import parse_plan
from phyblock.records.files import read_manifest
from phyblock.registry import known_tracks
from phyblock.run import manifest, rescore, store
from tests.run.test_track_runs import by_sample
from tests.servers.chassis import Faults, Running
from tests.servers.openai_chat import OpenAIChat, answered
from tests.workspace import call, problem_of

EARLIER = 5


class Stopping(OpenAIChat):
    """Takes no key any more once it has given so many answers; `answered` names their requests."""

    def __init__(self, answers):
        super().__init__(say=self.said)
        self.answers, self.answered = answers, []

    def said(self, seen):
        self.answered.append(seen.sample)
        if len(self.answered) >= self.answers:
            self.faults = Faults(mode="401")
        return answered(seen)


def run(out, *args):
    return call("run", "suite.yaml", "--out", out, "--no-report", "--yes", "--no-cache", *args)


def score(folder, *args):
    """Score again in this process: others take seconds to start."""
    return call("score", folder, "--jobs", "1", *args)


def read_earlier(monkeypatch):
    """Read as readers of an earlier version, which did not read all numbers."""
    monkeypatch.setattr(manifest, "READER_VERSION", EARLIER)
    plan, move = parse_plan, parse_move
    earlier = {
        "parse_plan": lambda text, *rest: plan(unread(text), *rest),
        "parse_move": lambda text: move(unread(text)),
    }
    known_tracks()
    for path, module in list(sys.modules.items()):
        for name, read in earlier.items():
            if path.startswith("phyblock.tracks") and hasattr(module, name):
                monkeypatch.setattr(module, name, read)


def unread(text):
    return re.sub(r"\(2\)|\(4\)|(?<=index )3", "?", text)


@pytest.fixture
def begun(inside, monkeypatch):
    """A run of two tracks that earlier readers began, stopped in the middle of episodes; the
    server, which answers again.
    """
    server = Stopping(22)
    with Running(server) as running:
        inside.write_models(running.url, "alpha", max_tokens=100)
        inside.write_suite(
            tracks=["full_planning", "step_planning"],
            models=["random", "alpha"],
            images={"size_px": 128, "layout": "separate"},
            limits={"max_concurrency": 3},
            steps={"physics": "off", "max_steps": 4},
        )
        with monkeypatch.context() as earlier:
            read_earlier(earlier)
            assert run("out") == 1
        server.faults, server.answers = Faults(), 10**6
        yield server


def newest(workspace, folder):
    """The newest record of every sample, but for what differs between two runs."""
    return by_sample(workspace.records(workspace.root / folder))


def test_it_is_refused_until_it_is_scored_and_ends_as_if_begun_today(begun, workspace, capsys):
    before, earlier = newest(workspace, "out"), read_manifest(workspace.out)
    files = workspace.files()
    for args in ((), ("--dry-run",)):
        problem = problem_of(StoreError, run, "out", *args)
        assert "by another version" in str(problem)
        assert f"readers {EARLIER}" in problem.found
        assert problem.hint.startswith("phyblock score out first")
    assert workspace.files() == files
    asked = len(begun.seen)
    capsys.readouterr()
    assert score("out") == 0
    assert len(begun.seen) == asked
    scored = newest(workspace, "out")
    diverged = {name for name, one in scored.items() if one["error"] and not before[name]["error"]}
    assert f"in {len(diverged)} episodes this version would have asked" in capsys.readouterr().err
    assert {scored[name]["model"] for name in diverged} == {"random", "alpha"}
    assert any(scored[name]["scores"] != one["scores"] for name, one in before.items())
    now = read_manifest(workspace.out)
    assert (now.identity, now.created) == (earlier.identity, earlier.created)

    answered = len(begun.answered)
    assert run("out") == 0
    assert max(Counter(begun.answered).values()) == 1, "a reply that still holds was asked again"
    assert len(begun.answered) > answered
    assert run("fresh") == 0
    assert newest(workspace, "out") == newest(workspace, "fresh")


@pytest.mark.usefixtures("begun")
def test_kills_processes_and_shards_end_in_the_same_records(workspace, monkeypatch):
    def records(name):
        return (workspace.root / name / "records.jsonl").read_bytes()

    for name in ("whole", "1", "2", "processes", "shards"):
        shutil.copytree(workspace.out, workspace.root / name)
    assert score("whole") == 0
    for writes in (1, 2):
        folder = workspace.root / str(writes)
        left, write = writes, store.atomic_write

        def dying(*args, **options):
            nonlocal left
            left -= 1
            if not left:
                raise KeyboardInterrupt
            write(*args, **options)  # noqa: B023

        with monkeypatch.context() as dies:
            dies.setattr(store, "atomic_write", dying)
            with pytest.raises(KeyboardInterrupt):
                rescore.rescore(folder)
        assert (records(folder.name) == records("out")) == (writes == 1)
        with pytest.raises(StoreError, match="by another version"):
            run(folder.name)
        assert score(folder.name) == 0
        assert newest(workspace, folder.name) == newest(workspace, "whole")
    assert run("2") == 0
    assert call("score", "processes", "--jobs", "2") == 0
    for shard in ("2/3", "1/3", "3/3"):
        assert score("shards", "--shard", shard) == 0
    assert records("processes") == records("shards") == records("whole")


@pytest.mark.usefixtures("begun")
def test_answers_of_a_shard_about_earlier_records_are_refused(workspace):
    assert score("out", "--shard", "1/1") == 0
    assert run("out") == 0
    before = newest(workspace, "out")
    with pytest.raises(StoreError, match="is not the record that was scored"):
        score("out", "--shard", "1/1")
    assert newest(workspace, "out") == before
    assert score("out") == 0
    assert newest(workspace, "out") == before
