"""Step planning from end to end: with faults, killed and gone on, in either physics engine."""

from __future__ import annotations

import contextlib
import json
import random
import signal
import time
from pathlib import Path
from typing import Any

import pytest
import yaml

from phyblock.errors import SpecError
from phyblock.results.compare import compare_runs
from phyblock.results.load import load_run
from phyblock.run.rescore import rescore
from phyblock.sim.engine import ENGINES, described_engine, installed_engines
from tests.servers.chassis import ISSUE_MIX, Faults, Running, Seen
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


def pictures(seen: Seen) -> list[str]:
    return [part[1] for part in seen.parts if not isinstance(part, str)]


def on_disk(workspace: Workspace, name: str) -> list[dict[str, Any]]:
    """The whole lines of a file of the run, if it is there yet."""
    with contextlib.suppress(FileNotFoundError):
        lines = (workspace.out / name).read_bytes().split(b"\n")[:-1]
        return [json.loads(line) for line in lines]
    return []


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
        goals = {tuple(pictures(one)[:2]) for one in mine}
        assert len(goals) == 1
        operations: list[str] = []
        world: list[int] = []
        current: dict[tuple[int, ...], str] = {}
        for one, turn in zip(mine, record["turns"], strict=True):
            labels = [image["label"] for image in turn["prompt"]["images"]]
            assert labels == ["goal", "candidates", "current"]
            assert [image["sha256"] for image in turn["prompt"]["images"]] == pictures(one)
            assert told_history(one) == operations
            assert current.setdefault(tuple(world), pictures(one)[2]) == pictures(one)[2]
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


@pytest.mark.parametrize(
    ("kills", "seeds", "physics"),
    [(2, 2, "off"), pytest.param(12, 16, "settle", marks=pytest.mark.slow)],
)
def test_a_killed_run_goes_on_in_the_middle_of_episodes(
    workspace: Workspace, kills: int, seeds: int, physics: str
) -> None:
    """No answered turn is asked again, cache or not, and records are those of a quiet run."""
    draw = random.Random(kills)
    with Running(StepAgent(Faults(latency_s=0.03))) as running:
        server = running.server
        prepare(workspace, running.url, seeds=list(range(seeds)), steps={"physics": physics})
        middle = 0
        for _ in range(kills):
            target = len(server.seen) + draw.randrange(3, 15 * seeds // kills)
            with workspace.start("--no-cache") as process:
                while process.poll() is None and len(server.seen) < target:
                    time.sleep(0.002)
                time.sleep(draw.random() / 20)
                process.kill()
                process.communicate()
            assert process.returncode == -signal.SIGKILL
            while server.at_once:
                time.sleep(0.02)
            kept = [call for call in on_disk(workspace, "calls.jsonl") if call.get("reply")]
            finished = {record["sample"] for record in on_disk(workspace, "records.jsonl")}
            middle += len({turn["sample"] for turn in kept} - finished)
            answered = {turn["reply"]["reasoning"] for turn in kept}
            asked = len(server.seen)
            assert len({one.sample for one in server.seen} - answered) <= AT_ONCE * kills
            running_total = (asked, answered)
        assert middle > 0, "no kill fell into an episode"
        done = workspace.run("--no-cache")
        assert (done.code, done.err) == (0, "")
        asked, answered = running_total
        assert answered.isdisjoint(one.sample for one in server.seen[asked:])
        killed = by_sample(workspace.records())

        workspace.out = workspace.root / "quiet"
        assert workspace.run("--no-cache").code == 0
        quiet = by_sample(workspace.records())
    assert killed == quiet


@pytest.mark.parametrize(("mode", "outcome"), [("length", "truncated"), ("filtered", "refusal")])
def test_an_episode_of_which_no_reply_is_whole_is_no_parse_failure(
    workspace: Workspace, mode: str, outcome: str
) -> None:
    with Running(StepAgent(Faults(mode=mode))) as running:
        prepare(workspace, running.url)
        assert workspace.run(*FEW).code == 0
    assert {record["outcome"] for record in workspace.records()} == {outcome}


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"tracks": ["full_planning", "step_planning"], "models": ["repeat"]}, "has no rule for"),
        ({"models": ["majority"]}, "has no rule for step_planning"),
        ({"steps": {"max_steps": 0}}, "steps.max_steps"),
    ],
)
def test_what_cannot_be_played_is_said(
    workspace: Workspace, fields: dict[str, Any], message: str
) -> None:
    prepare(workspace, "http://nowhere", **fields)
    done = workspace.run("--dry-run")
    assert (done.code, len(done.errors)) == (2, 1)
    assert message in done.errors[0]


def test_a_goal_that_is_not_drawn_is_no_match_for_states_that_are(
    workspace: Workspace, official_checkout: Path
) -> None:
    official = {"format": "official", "path": str(official_checkout)}
    prepare(workspace, "http://nowhere", dataset=official, images={"source": "dataset"})
    done = workspace.run("--dry-run")
    assert (done.code, len(done.errors)) == (2, 1)
    assert "step_planning draws its own pictures" in done.errors[0]
    assert "images.source=render" in done.errors[0]


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

    scored = rescore(usual, None, None, None)
    assert (scored / "records.jsonl").read_text() == (usual / "records.jsonl").read_text()
    runs = [load_run(out) for out in (usual, other)]
    with pytest.raises(SpecError, match="physics: cannot be compared"):
        compare_runs(*runs, ())


def test_an_unknown_engine_is_refused_before_anything_is_made(workspace: Workspace) -> None:
    args = ("--out", workspace.out, "--models", "oracle", *SMALL, *DATA)
    done = workspace.phyblock("run", "steps", *args, env={"PHYBLOCK_PHYSICS": "bullet"})
    assert done.code == 2
    assert done.errors == [
        "error: PHYBLOCK_PHYSICS: is not known\n    found: bullet\n"
        f"    allowed: {', '.join(ENGINES)}"
    ]
    assert not workspace.out.exists()
