"""A reply is kept where it cannot be judged, and where one who waits for it is given up."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from phyblock.api import run_suite
from phyblock.cli.main import phyblock
from phyblock.errors import SimulationError
from phyblock.run.rescore import rescore
from phyblock.run.runner import to_its_end
from phyblock.sim import dynamics
from phyblock.tracks.pictures import Workshop
from phyblock.tracks.pose_planning import PosePlanning
from tests.run.killing import killed
from tests.workspace import SCENES, Workspace


def test_work_of_a_worker_that_was_killed_is_done_again_once(tmp_path: Path) -> None:
    async def work() -> None:
        assert await shop.work_out(partial(killed, tmp_path, 1)) == "done"
        with pytest.raises(SimulationError, match="killed twice"):
            await shop.work_out(partial(killed, tmp_path, 3))

    shop = Workshop(1)
    try:
        asyncio.run(work())
    finally:
        shop.close()


def test_what_must_be_done_is_done_though_nobody_waits() -> None:
    done = []

    async def work() -> str:
        await asyncio.sleep(0.05)
        done.append("work")
        return "record"

    async def wait() -> tuple[str, bool]:
        return await to_its_end(work())

    async def cancelled() -> tuple[str, bool]:
        waiting = asyncio.create_task(wait())
        for _ in range(3):
            await asyncio.sleep(0.01)
            waiting.cancel()
        return await waiting

    assert asyncio.run(cancelled()) == ("record", True)
    assert done == ["work"]
    assert asyncio.run(wait()) == ("record", False)


def test_a_reply_whose_judging_kills_workers_is_recorded_and_scored_later(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(workspace.root)
    monkeypatch.setenv("PHYBLOCK_CACHE", str(workspace.cache))
    monkeypatch.setattr(sys, "argv", ["phyblock"])
    workspace.write_suite(tracks=["pose_planning"], models=["oracle"], pose={"views": ["oblique"]})
    marks = workspace.root / "marks"
    marks.mkdir()
    whole = PosePlanning.judge_apart

    async def fatal(track: PosePlanning, item: Any, text: str | None, earlier: Any) -> Any:
        if text is not None and item.key == SCENES[0]["id"]:
            await track.work_out(partial(killed, marks, 2))
        return await whole(track, item, text, earlier)

    monkeypatch.setattr(PosePlanning, "judge_apart", fatal)
    run = ["run", "suite.yaml", "--out", "out", "--no-report", "--limit", "2"]
    phyblock.main(run, standalone_mode=False)
    lost, *others = sorted(workspace.records(), key=lambda record: record["scene"])
    assert lost["error"]["kind"] == "unjudged"
    assert lost["reply"]["text"].startswith("Step1")
    assert [record["outcome"] for record in others] == ["ok"]
    told = capsys.readouterr().out
    assert "1 answer could not be judged: phyblock score out tries again, without a call" in told
    assert "rejected" not in told
    with pytest.warns(UserWarning, match="1 answer could not be judged: phyblock score out"):
        run_suite("suite.yaml", out="out", limit=2)
    # A plan that takes too long is given up, in a worker or without one, and says so.
    monkeypatch.setattr(PosePlanning, "judge_apart", whole)
    monkeypatch.setattr(dynamics, "LONGEST_S", -1.0)
    kept = workspace.records(rescore(workspace.out, None, None, workspace.root / "slow"))
    given_up = next(record for record in kept if record["sample"] == lost["sample"])
    assert given_up["error"]["kind"] == "unjudged"
    assert "step 1 was not reached within -1 s" in given_up["error"]["message"]
    assert given_up["reply"] == lost["reply"]
    monkeypatch.undo()
    again = workspace.records(rescore(workspace.out, None, None, workspace.root / "again"))
    assert {record["outcome"] for record in again} == {"ok"}
    assert all(record["pose"]["completed"] and record["error"] is None for record in again)


def test_a_reply_that_is_being_judged_at_a_second_interrupt_is_recorded(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(workspace.root)
    monkeypatch.setenv("PHYBLOCK_CACHE", str(workspace.cache))
    monkeypatch.setattr(sys, "argv", ["phyblock"])
    workspace.write_suite(tracks=["pose_planning"], models=["oracle"], pose={"views": ["oblique"]})

    async def slow(track: PosePlanning, item: Any, text: str | None, _: Any) -> Any:
        for _ in range(2):
            os.kill(os.getpid(), signal.SIGINT)
            await asyncio.sleep(0.1)
        return track.judge(item, text)

    monkeypatch.setattr(PosePlanning, "judge_apart", slow)
    run = ["run", "suite.yaml", "--out", "out", "--no-report", "--limit", "1"]
    phyblock.main(run, standalone_mode=False)
    assert "(interrupted)" in capsys.readouterr().out
    assert [record["outcome"] for record in workspace.records()] == ["ok"]
