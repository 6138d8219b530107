"""Suites run on a renderer and a physics engine that are one module of tests each."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest
import yaml

from phyblock.cli.main import phyblock
from phyblock.data import read_builtin
from phyblock.errors import SpecError
from phyblock.report.compare import compare_runs
from phyblock.run.rescore import rescore
from phyblock.sim import PictureStyle, candidates_png, composite_png, goal_png
from phyblock.sim.question_pictures import question_png
from phyblock.sim.registry import ENGINES, installed_engines, physics_engine, told_engine
from phyblock.sim.site import state_picture
from phyblock.tables.load import load_run
from phyblock.tracks.step_planning.rules import StepRules
from phyblock.tracks.step_planning.track import StepPlanning
from phyblock.types import Physics
from tests.fork_server import Done
from tests.servers.chassis import Running
from tests.servers.openai_chat import OpenAIChat
from tests.sim.box_renderer import BOX_RENDERER
from tests.sim.still_engine import STILL_ENGINE
from tests.workspace import Raw, Workspace, candidates

OTHERS = {
    "PHYBLOCK_RENDERER": BOX_RENDERER,
    "PHYBLOCK_PHYSICS": STILL_ENGINE,
    "PYTHONPATH": str(Path(__file__).parents[2]),
}
STYLE = PictureStyle(128)
SMALL = ("--set", "images.size_px=128", "--set", "seeds=[0]", "--no-report")
DATA = ("--set", "dataset.path=./data")


def run(workspace: Workspace, suite: str, *args: str, env: dict[str, str] = OTHERS) -> Done:
    few = ("--models", "oracle", "--limit", "3", *SMALL, *DATA)
    return workspace.phyblock("run", suite, "--out", workspace.out, *few, *args, env=env)


def digest(png: bytes) -> str:
    return hashlib.sha256(png).hexdigest()


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


def test_full_shows_what_the_other_renderer_draws(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    with Running(OpenAIChat()) as running:
        workspace.write_models(running.url, "alpha")
        done = run(workspace, "full", "--models", "oracle,alpha")
    assert (done.code, done.err) == (0, "")
    records = workspace.records()
    assert len(records) == 6
    assert workspace.tables()["table1.csv"]
    monkeypatch.setenv("PHYBLOCK_RENDERER", BOX_RENDERER)
    drawn = {
        task.key: digest(
            composite_png(goal_png(task.scene, STYLE), candidates_png(task.candidates, STYLE))
        )
        for task in read_builtin(workspace.root / "data").tasks
    }
    for record in records:
        if record["model"] == "oracle":
            assert {score["fp"] + score["fn"] for score in record["scores"]} == {0}
            continue
        assert [image["sha256"] for image in record["prompt"]["images"]] == [drawn[record["key"]]]


def test_steps_let_blocks_go_in_the_other_engine_and_go_on_with_it_alone(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What tips over in PyBullet (see the laws of engines) stands where nothing falls."""
    workspace.write_scenes(unsteady_scene())
    strict = ("--set", "steps.physics=strict")
    done = run(workspace, "steps", *strict)
    assert (done.code, done.err) == (0, "")
    (oracle,) = workspace.records()
    assert oracle["ending"] == "completed"
    track = yaml.safe_load((workspace.out / "run.yaml").read_bytes())["tracks"]["step_planning"]
    assert track["physics"] == {"engine": "still", "still": "1"}

    with Running(OpenAIChat()) as running:
        workspace.write_models(running.url, "alpha")
        elsewhere = workspace.root / "seen"
        done = run(workspace, "steps", *strict, "--models", "alpha", "--out", str(elsewhere))
    assert (done.code, done.err) == (0, "")
    (alpha,) = workspace.records(elsewhere)
    monkeypatch.setenv("PHYBLOCK_RENDERER", BOX_RENDERER)
    (task,) = read_builtin(workspace.root / "data").tasks
    first = {i["label"]: i["sha256"] for i in alpha["turns"][0]["prompt"]["images"]}
    assert first["goal"] == digest(goal_png(task.scene, STYLE))
    empty = state_picture(task.scene, (), STYLE)
    assert first["current"] == digest(question_png(empty, STYLE))

    before = workspace.files()
    usual = physics_engine().name
    for variable in ("PHYBLOCK_RENDERER", "PHYBLOCK_PHYSICS"):
        rest = {name: value for name, value in OTHERS.items() if name != variable}
        done = run(workspace, "steps", *strict, env=rest)
        assert (done.code, "holds another run" in done.err) == (2, True), variable
        told = f"its blocks are let go in still 1, here in {usual}"
        assert (told in done.err) == (variable == "PHYBLOCK_PHYSICS")
    assert workspace.files() == before


def test_runs_in_two_engines_are_scored_anywhere_and_never_compared(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What fell is read from the records, whichever engine is here now."""
    monkeypatch.chdir(workspace.root)
    monkeypatch.setenv("PHYBLOCK_CACHE", str(workspace.cache))
    workspace.write_scenes(unsteady_scene())
    usual_name = told_engine()
    suite = ("--models", "oracle", *SMALL, *DATA, "--set", "steps.physics=strict")
    usual, still = workspace.root / "usual", workspace.root / "still"
    endings = {}
    for out, word in ((usual, None), (still, STILL_ENGINE)):
        if word is not None:
            monkeypatch.setenv("PHYBLOCK_PHYSICS", word)
        phyblock.main(["run", "steps", "--out", str(out), *suite], standalone_mode=False)
        manifest = yaml.safe_load((out / "run.yaml").read_bytes())
        (record,) = map(json.loads, (out / "records.jsonl").read_text().splitlines())
        assert record["engine"] == manifest["engine"]
        endings[manifest["engine"]] = record["ending"]
    assert endings == {usual_name: "collapsed", "still 1": "completed"}

    scored = rescore(usual, None, None, None)
    assert (scored / "records.jsonl").read_text() == (usual / "records.jsonl").read_text()
    runs = [load_run(out, texts=False) for out in (usual, still)]
    with pytest.raises(SpecError, match="in another physics engine"):
        compare_runs(*runs, ())


def test_an_unknown_engine_is_refused_before_anything_is_made(workspace: Workspace) -> None:
    done = run(workspace, "steps", env={**OTHERS, "PHYBLOCK_PHYSICS": "bullet"})
    assert done.code == 2
    assert done.errors == [
        "error: PHYBLOCK_PHYSICS: is not known\n    found: bullet\n"
        f"    allowed: {', '.join(ENGINES)}, or module:factory"
    ]
    assert not workspace.out.exists()


@pytest.mark.parametrize("physics", ["off", "settle", "strict"])
def test_a_step_run_in_pybullet_is_told_as_it_always_was(
    physics: Physics, monkeypatch: pytest.MonkeyPatch
) -> None:
    """So that runs from before there was a choice of engines go on."""
    if physics != "off" and "pybullet" not in installed_engines():
        pytest.skip("PyBullet is not installed")
    monkeypatch.setenv("PHYBLOCK_PHYSICS", "pybullet")
    track = StepPlanning(StepRules(physics=physics))
    assert track.identity() == {"prompt": None, "pictures": None}
