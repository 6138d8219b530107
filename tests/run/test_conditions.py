"""Whole runs that ask in other ways: shuffled, blind, with another goal, and varied."""

import hashlib

import yaml

from phyblock.data.scenes import read_builtin
from phyblock.sim.pictures import PictureStyle, candidates_png, goal_png
from phyblock.tracks.base import presented
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import plan_text

STYLE = PictureStyle(size_px=128)
SEEDS = (0, 1)


def tasks_of(workspace):
    return {task.key: task for task in read_builtin(workspace.root / "data").tasks}


def overall_f1(workspace):
    """By model, under setting A; plans with the matcher of the headline."""
    rows = workspace.rows("estimates")
    wanted = {"measure": "f1", "cell": "overall", "setting": "A"}
    return {
        row["model"]: float(row["value"])
        for row in rows
        if wanted.items() <= row.items() and row["matcher"] != "paper"
    }


def test_a_model_that_looks_is_right_in_every_order(workspace):
    tasks = tasks_of(workspace)
    answers = {}
    for one in (presented(task, seed, "shuffled") for task in tasks.values() for seed in SEEDS):
        pictures = (goal_png(one.scene, STYLE), candidates_png(one.candidates, STYLE))
        plan = [one.candidates.index_of(block.look) for block in one.scene.blocks]
        answers[tuple(hashlib.sha256(png).hexdigest() for png in pictures)] = plan_text(*plan)
    suite = {"images": {"size_px": 128, "layout": "separate"}, "candidates": {"order": "shuffled"}}
    # It knows goals and grids by the digests of their pictures.
    sighted = OpenAIChat(say=lambda seen: answers[seen.pictures])
    with workspace.served(sighted, "alpha", "beta", seeds=list(SEEDS), **suite):
        done = workspace.completed()
    assert sighted.requests == 20
    assert "[candidates shuffled]" in done.out
    assert set(overall_f1(workspace).values()) == {1.0}
    check_scored_again(workspace)
    # All models were shown the same order, in whose numbers they answered.
    records = workspace.records()
    assert len(records) == 20
    for record in records:
        task, plan = tasks[record["scene"]], record["parse"]["plan"]
        order = presented(task, record["seed"], "shuffled").order
        assert record["shown"] == {"order": list(order), "blind": False}
        looks = [task.candidates[order[n - 1]].look for n in plan]
        assert looks == [block.look for block in task.scene.blocks]
        assert all((s["fp"], s["fn"]) == (0, 0) for s in record["scores"])
        assert record["prompt"]["images"][1]["label"] == "candidates"


def check_scored_again(workspace):
    """Stored replies are read as they were asked for: in the numbers that were shown."""
    first, again = (
        [record["scores"] for record in workspace.records(folder)]
        for folder in (workspace.out, workspace.scored())
    )
    assert first == again


def test_episodes_are_shuffled_and_blind_as_well(workspace):
    models = ["oracle", "first-pose", "all-candidates", "goal-blind"]
    workspace.write_suite(
        tracks=["step_planning"],
        models=models,
        levels=[3],
        seeds=list(SEEDS),
        candidates={"order": "shuffled"},
        steps={"physics": "off", "blind": True},
    )
    done = workspace.completed()
    assert "candidates shuffled, blind]" in " ".join(done.out.split())
    f1 = overall_f1(workspace)
    assert f1["oracle"] == 1.0 > f1["all-candidates"]
    assert "The strongest baseline here that never sees the goal is" in done.out
    tasks = tasks_of(workspace)
    for record in workspace.records():
        order = presented(tasks[record["scene"]], record["seed"], "shuffled").order
        assert record["shown"] == {"order": list(order), "blind": True}
        plan = record["parse"]["plan"]
        if record["model"] == "all-candidates":
            assert plan == list(range(1, len(plan) + 1))
    workspace.does("show", workspace.out, "oracle/t3/s1")


def test_blind_baselines_are_scored_beside_models_without_being_named(workspace):
    workspace.write_suite(models=["oracle"], levels=[4])
    workspace.completed()
    assert {record["model"] for record in workspace.records()} == {"oracle"}
    workspace.write_yaml("models.yaml", {"again": {"replay": str(workspace.out)}})
    workspace.out = workspace.root / "again"
    suite = yaml.safe_load(workspace.write_suite(models=["again"], levels=[4]).read_text())
    del suite["baselines"]
    workspace.write_yaml("suite.yaml", suite)
    done = workspace.completed()
    models = [record["model"] for record in workspace.records()]
    assert models == ["again", "goal-blind", "random"]
    assert "0 of 1 model is shown to be above goal-blind" in done.out
    # A run of baselines alone has those that it names.
    workspace.write_yaml("suite.yaml", {**suite, "models": ["random"]})
    workspace.out = workspace.root / "alone"
    workspace.completed()
    assert {record["model"] for record in workspace.records()} == {"random"}
