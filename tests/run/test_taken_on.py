"""Runs that earlier readers began, gone on with under those of today."""

from __future__ import annotations

import asyncio
import contextlib
import json
import re
import shutil
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from phyblock.cli.main import phyblock
from phyblock.config.models import load_models
from phyblock.config.suite import load_suite
from phyblock.errors import DataError, StoreError
from phyblock.parsing import plan as plan_reader
from phyblock.parsing.move import parse_move
from phyblock.parsing.plan import parse_plan
from phyblock.parsing.text import READER_VERSION
from phyblock.play.answers import read_answers
from phyblock.play.person import Person, plan_sitting
from phyblock.records import read_manifest
from phyblock.run import identity, judged_again, manifest, taking_on
from phyblock.run.appending import AppendFile
from phyblock.run.plan import RunPlan, make_plan
from phyblock.run.store import RunStore, held_run
from phyblock.run.taking_on import begun_anew
from phyblock.tables.load import load_run
from phyblock.tracks.full_planning import track
from phyblock.tracks.step_planning import episode
from tests.run.test_step_runs import by_sample
from tests.servers.chassis import Faults, Running, Seen
from tests.servers.step_agent import StepAgent
from tests.workspace import Raw, Workspace

EARLIER = 5
VERSIONED = (identity, judged_again, manifest, taking_on, plan_reader)  # type: ignore[attr-defined]
PRICE = {"input": 1000.0, "output": 1000.0}


class Stopping(StepAgent):
    """Takes no key any more once it has given so many answers; `answered` names their requests."""

    def __init__(self, answers: int) -> None:
        super().__init__()
        self.answers = answers
        self.answered: list[str] = []

    def reply(self, seen: Seen, ending: str) -> dict[str, Any]:
        self.answered.append(seen.sample)
        if len(self.answered) >= self.answers:
            self.faults = Faults(mode="401")
        return super().reply(seen, ending)


class Killed(BaseException):
    """What ends a command where nothing can be done any more."""


def call(*args: object) -> int:
    return phyblock.main([str(arg) for arg in args], standalone_mode=False) or 0


def run(out: str | Path, *args: object) -> int:
    return call("run", "suite.yaml", "--out", out, "--no-report", *args)


def read_earlier(monkeypatch: pytest.MonkeyPatch) -> None:
    """Read as readers of an earlier version, which did not read all numbers."""
    plan, move = parse_plan, parse_move
    for module in VERSIONED:
        monkeypatch.setattr(module, "READER_VERSION", EARLIER)
    monkeypatch.setattr(track, "parse_plan", lambda text, *rest: plan(unread(text), *rest))
    monkeypatch.setattr(episode, "parse_move", lambda text: move(unread(text)))


def unread(text: str) -> str:
    return re.sub(r"\(2\)|\(4\)|(?<=index )3", "?", text)


@pytest.fixture
def begun(workspace: Workspace, monkeypatch: pytest.MonkeyPatch) -> Iterator[Stopping]:
    """A run of two tracks that earlier readers began, stopped in the middle of episodes; the
    server, which answers again.
    """
    monkeypatch.chdir(workspace.root)
    monkeypatch.setenv("PHYBLOCK_CACHE", str(workspace.cache))
    monkeypatch.setattr(sys, "argv", ["phyblock"])
    server = Stopping(22)
    with Running(server) as running:
        workspace.write_models(running.url, "alpha", price=PRICE, max_tokens=100)
        workspace.write_suite(
            tracks=["full_planning", "step_planning"],
            models=["random", "alpha"],
            images={"size_px": 128, "layout": "separate"},
            limits={"max_concurrency": 3},
            steps={"physics": "off", "max_steps": 4},
        )
        with monkeypatch.context() as earlier:
            read_earlier(earlier)
            assert run("out", "--yes") == 1
        server.faults, server.answers = Faults(), 10**6
        yield server


def planned(workspace: Workspace) -> RunPlan:
    loaded = load_suite(workspace.root / "suite.yaml", data_dir=workspace.root)
    return make_plan(loaded, load_models(workspace.root / "models.yaml"))


def newest(workspace: Workspace, folder: str) -> dict[str, Raw]:
    """The newest record of every sample, but for what differs between two runs."""
    lines = by_sample(workspace.records(workspace.root / folder))
    return {sample: {**line, "read_again": False} for sample, line in lines.items()}


def spent(workspace: Workspace) -> float:
    """What the cost limit counts of the run."""
    plan = planned(workspace)
    found = held_run(workspace.out, plan.manifest, plan.earlier)
    assert found is not None
    with RunStore(workspace.out, plan.going_on(found), plan.sample_ids()) as store:
        return store.standing.limit_usd


def test_it_goes_on_as_if_todays_readers_had_begun_it_and_pays_nothing_twice(
    begun: Stopping, workspace: Workspace, capsys: pytest.CaptureFixture[str]
) -> None:
    plan, earlier = planned(workspace), read_manifest(workspace.out)
    stored = (workspace.out / "records.jsonl").read_bytes()
    before, usd = newest(workspace, "out"), spent(workspace)
    anew = begun_anew(plan, workspace.out, earlier)
    assert {before[sample]["model"] for sample in anew} == {"random", "alpha"}
    assert call("score", "out") == 0
    files = workspace.files()
    capsys.readouterr()
    assert run("out", "--dry-run") == 0
    said = capsys.readouterr().out
    assert f"(readers {EARLIER}, now {READER_VERSION}): they are read again before" in said
    done = len([s for s in before if s not in anew and "/alpha/" in s])
    assert re.search(rf"^ alpha +litellm +10 +{done} ", said, re.MULTILINE)
    assert workspace.files() == files

    assert run("out", "--yes") == 0
    said = " ".join(capsys.readouterr().out.split())
    assert f"{len(before) - len(anew)} records read again" in said
    assert "All 20 samples are done" in said
    assert (workspace.out / "records.jsonl").read_bytes().startswith(stored)
    # Turns of which nobody knows how they were read came from the cache.
    assert max(Counter(begun.answered).values()) == 1
    now = read_manifest(workspace.out)
    assert now.versions == {**earlier.versions, "readers": str(READER_VERSION)}
    assert (now.identities[0], now.created) == (earlier.identity, earlier.created)
    assert now.identity == now.identities[1] == plan.manifest.identity
    assert call("score", "out") == 0
    paid = 1.04 * (len(begun.answered) - 22)
    assert spent(workspace) == pytest.approx(usd + paid)

    requests = len(begun.seen)
    assert run("out", "--yes") == run("fresh", "--yes") == 0
    assert len(begun.seen) == requests
    made = newest(workspace, "out")
    assert made == newest(workspace, "fresh")
    assert any(made[sample]["scores"] != line["scores"] for sample, line in before.items())


@pytest.mark.usefixtures("begun")
def test_killed_at_any_write_it_is_a_run_of_one_reader_and_ends_alike(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = planned(workspace)
    shutil.copytree(workspace.out, workspace.root / "whole")
    assert run("whole", "--yes") == 0
    whole = newest(workspace, "whole")
    before = load_run(workspace.out).records
    monkeypatch.setattr(taking_on, "_AT_ONCE", 6)
    writes = 0

    def dying(write: Callable[..., None], at: int) -> Callable[..., None]:
        def written(*args: Any) -> None:
            nonlocal writes
            writes += 1
            if writes == at and isinstance(args[0], AppendFile):
                # What a kill in the middle of a write leaves.
                with args[0]._path.open("ab") as file:
                    file.write(b'{"sample": "full_pl')
            if writes == at:
                raise Killed
            write(*args)

        return written

    kills = 0
    while True:
        writes, kills = 0, kills + 1
        with monkeypatch.context() as dies, contextlib.suppress(Killed):
            dies.setattr(AppendFile, "append", dying(AppendFile.append, kills))
            dies.setattr(RunStore, "take_on", dying(RunStore.take_on, kills))
            found = held_run(workspace.out, plan.manifest, plan.earlier)
            assert found is not None
            asyncio.run(taking_on.take_on(plan, workspace.out, found, lambda _: None))
            break
        assert load_run(workspace.out).records.equals(before)
    assert kills > 5
    assert run("out", "--yes") == 0
    assert newest(workspace, "out") == whole


@pytest.mark.usefixtures("begun")
def test_the_same_command_finds_it_and_other_runs_are_refused_as_ever(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = planned(workspace)
    folder = workspace.root / "results" / f"trial-{plan.earlier[0][:8]}"
    assert plan.folder_in(folder.parent).name == f"trial-{plan.manifest.identity[:8]}"
    folder.parent.mkdir()
    shutil.copytree(workspace.out, folder)
    assert plan.folder_in(folder.parent) == folder
    with pytest.raises(StoreError, match="holds another run"):
        run("out", "--yes", "--limit", 2)
    assert call("run", "suite.yaml", "--no-report", "--yes") == 0
    assert plan.folder_in(folder.parent) == folder
    read_earlier(monkeypatch)
    with pytest.raises(StoreError, match=f"by readers {READER_VERSION}, this version has"):
        run(folder, "--yes")


def test_a_page_of_questions_that_an_earlier_version_wrote_brings_its_answers(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    workspace.write_suite()
    loaded = load_suite(workspace.root / "suite.yaml", data_dir=workspace.root)
    person = Person("eve", None, "I agree.")
    with monkeypatch.context() as earlier:
        read_earlier(earlier)
        exported = plan_sitting(loaded, person, None).manifest.identity
    plan = plan_sitting(loaded, person, None)
    answer = {"number": 2, "picks": [0, 3], "took_s": 4.5}
    content = {"format": 1, "run": exported, "model": person.model}
    content |= {"consent": person.consent_sha256, "agreed": "2026-01-02T03:04Z"}
    file = workspace.root / "answers.json"
    file.write_text(json.dumps(content | {"answers": [answer]}), encoding="utf-8")
    assert read_answers(file, plan, person)[2].took_s == 4.5
    file.write_text(json.dumps(content | {"run": "0" * 64, "answers": [answer]}))
    with pytest.raises(DataError, match="is of another sitting"):
        read_answers(file, plan, person)
