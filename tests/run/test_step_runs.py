"""Step planning from end to end: with faults, killed and gone on, in either physics engine."""

from __future__ import annotations

import json
from typing import Any

import pytest
import yaml

from phyblock.errors import SpecError
from phyblock.results.compare import compare_runs
from phyblock.results.load import load_run
from phyblock.run.rescore import rescore
from phyblock.sim.engine import ENGINES, described_engine, installed_engines
from tests.servers.chassis import ISSUE_MIX, Faults, Running
from tests.servers.step_agent import StepAgent, said, told_history
from tests.workspace import Raw, Workspace, call, candidates

AT_ONCE = 4
FEW = ("--limit", "3")
VOLATILE = ("time", "latency_s", "attempts", "cached", "run")


def prepare(workspace: Workspace, url: str, **fields: Any) -> None:
    workspace.write_models(url, "alpha")
    suite = {
        "tracks": ["step_planning"],
        "models": ["alpha"],
        "images": {"size_px": 128, "layout": "separate"},
        "limits": {"max_concurrency": AT_ONCE, "max_attempts": 8},
        "steps": {"physics": "off"},
        **fields,
    }
    workspace.write_suite(**suite)


def stable(value: Any) -> Any:
    """A record without what differs between two runs of the same replies."""
    if isinstance(value, dict):
        return {k: stable(v) for k, v in value.items() if k not in VOLATILE}
    return [stable(v) for v in value] if isinstance(value, list) else value


def by_sample(records: list[dict[str, Any]]) -> dict[str, Any]:
    return {record["sample"]: stable(record) for record in records}


def test_the_server_sees_goal_candidates_current_picture_and_history(workspace: Workspace) -> None:
    with Running(StepAgent()) as running:
        prepare(workspace, running.url)
        assert workspace.run().code == 0
        seen = running.server.seen
    records = workspace.records()
    assert sum(len(record["turns"]) for record in records) == len(seen)
    answers = {one.sample: one for one in seen}
    for record in records:
        mine = [answers[turn["reply"]["reasoning"]] for turn in record["turns"]]
        assert all(isinstance(part, tuple) for one in mine for part in one.parts[:3])
        assert all(isinstance(one.parts[3], str) for one in mine)
        assert {len(one.parts) for one in mine} == {4}
        goals = {one.pictures[:2] for one in mine}
        assert len(goals) == 1
        operations: list[str] = []
        world: list[int] = []
        current: dict[tuple[int, ...], str] = {}
        for one, turn in zip(mine, record["turns"], strict=True):
            labels = [image["label"] for image in turn["prompt"]["images"]]
            assert labels == ["goal", "candidates", "current"]
            assert [image["sha256"] for image in turn["prompt"]["images"]] == [*one.pictures]
            assert told_history(one) == operations
            assert current.setdefault(tuple(world), one.pictures[2]) == one.pictures[2]
            assert turn["reply"]["text"] == said(one)
            move = turn["parse"]["move"]
            operations.append(f"Move({move})" if move else "(no operation)")
            world = turn["world"]
        assert len(set(current.values())) == len(current)


def test_faults_change_nothing(workspace: Workspace) -> None:
    found = []
    for faults in (Faults(), ISSUE_MIX):
        with Running(StepAgent(Faults(**{**vars(faults), "retry_after": "0"}))) as running:
            prepare(workspace, running.url)
            workspace.out = workspace.root / f"out{len(found)}"
            assert workspace.run("--no-cache", *FEW).code == 0
            found.append(by_sample(workspace.records()))
    assert found[0] == found[1]


SMALL = ("--set", "images.size_px=128", "--set", "seeds=[0]", "--no-report")
DATA = ("--set", "dataset.path=./data")


def unsteady_scene() -> Raw:
    """A plank that tips off its post until the second weight is on."""
    places = [("cube", [0, 0, 0.025], 0), ("cuboid3", [0, 0, 0.0625], 90)]
    places += [("cube", [0, 0.07, 0.1], 0), ("cube", [0, -0.07, 0.1], 0)]
    depends = [[0], [1], [2], [2]]
    blocks = [
        {
            "order": order,
            "type": block_type,
            "color": "red",
            "layer": min(order, 3),
            "depend": depends[order - 1],
            "position": position,
            "euler": [0, 0, turn],
        }
        for order, (block_type, position, turn) in enumerate(places, 1)
    ]
    plank = {"type": "cuboid3", "color": "red", "euler": [0, 0, 90], "required": 1}
    cubes = {**candidates()[0], "required": 3}
    others = [{**one, "required": 0} for one in candidates()[1:15]]
    named = {"id": "beam", "levels": [3], "parents": ["beam"]}
    return {**named, "blocks": blocks, "candidates": [cubes, plank, *others]}


@pytest.mark.skipif(len(installed_engines()) < 2, reason="one engine is installed")
def test_runs_in_two_engines_are_scored_anywhere_and_never_compared(
    inside: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Falls are read from the records, whichever engine is here now."""
    workspace = inside
    workspace.write_scenes(unsteady_scene())
    suite = ("--models", "oracle", *SMALL, *DATA, "--set", "steps.physics=strict")
    usual, other = (workspace.root / name for name in ENGINES)
    endings, names = {}, []
    for out in (usual, other):
        monkeypatch.setenv("PHYBLOCK_PHYSICS", out.name)
        names.append(described_engine())
        call("run", "steps", "--out", out, *suite)
        manifest = yaml.safe_load((out / "run.yaml").read_bytes())
        (record,) = map(json.loads, (out / "records.jsonl").read_text().splitlines())
        assert record["engine"] == manifest["engine"]
        endings[manifest["engine"]] = record["ending"]
    assert endings == dict.fromkeys(names, "collapsed")

    asked = (usual / "records.jsonl").read_text()
    rescore(usual)
    assert (usual / "records.jsonl").read_text() == asked
    runs = [load_run(out) for out in (usual, other)]
    with pytest.raises(SpecError, match="physics: cannot be compared"):
        compare_runs(*runs, ())


@pytest.mark.parametrize(("mode", "outcome"), [("length", "truncated"), ("filtered", "refusal")])
def test_an_episode_of_which_no_reply_is_whole_is_no_parse_failure(
    workspace: Workspace, mode: str, outcome: str
) -> None:
    with Running(StepAgent(Faults(mode=mode))) as running:
        prepare(workspace, running.url)
        assert workspace.run(*FEW).code == 0
    assert {record["outcome"] for record in workspace.records()} == {outcome}
