"""Whole runs with candidates shuffled, without the goal and with another one, at a local server."""

from __future__ import annotations

import csv
import hashlib
import io
import json
from typing import Any

import pytest
import yaml

from phyblock.data import AssemblyTask, read_builtin
from phyblock.sim.pictures import PictureStyle, candidates_png, goal_png
from phyblock.tracks.items import Presentation, shown_order
from tests.servers.chassis import Running, Seen
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import Raw, Workspace

STYLE = PictureStyle(size_px=128)
SEEDS = (0, 1)
APART = {"size_px": 128, "layout": "separate"}


class Sighted(OpenAIChat):
    """Plans rightly what it is shown: it knows goals and grids by the digests of their pictures."""

    def __init__(self, answers: dict[tuple[str, ...], str]) -> None:
        super().__init__()
        self._answers = answers

    def reply(self, seen: Seen, ending: str) -> dict[str, Any]:
        body = super().reply(seen, ending)
        body["choices"][0]["message"]["content"] = self._answers[pictures(seen)]
        return body


def pictures(seen: Seen) -> tuple[str, ...]:
    return tuple(part[1] for part in seen.parts if not isinstance(part, str))


def digest(png: bytes) -> str:
    return hashlib.sha256(png).hexdigest()


def plan_of(task: AssemblyTask) -> str:
    numbers = [task.candidates.index_of(block.look) for block in task.scene.blocks]
    return "\n".join(f"Step{i}: Move block with index {n}" for i, n in enumerate(numbers, 1))


def tasks_of(workspace: Workspace) -> dict[str, AssemblyTask]:
    return {task.key: task for task in read_builtin(workspace.root / "data").tasks}


def overall_f1(workspace: Workspace) -> dict[str, float]:
    """By model, under setting A; plans with the matcher of the headline."""
    rows = csv.DictReader(io.StringIO(workspace.tables()["estimates.csv"].decode()))
    wanted = {"measure": "f1", "cell": "overall", "setting": "A"}
    return {
        row["model"]: float(row["value"])
        for row in rows
        if wanted.items() <= row.items() and row["matcher"] != "paper"
    }


def test_a_model_that_looks_is_right_in_every_order(workspace: Workspace) -> None:
    tasks, showing = tasks_of(workspace), Presentation("shuffled")
    shown = [showing.of(task, seed) for task in tasks.values() for seed in SEEDS]
    answers = {
        (digest(goal_png(one.scene, STYLE)), digest(candidates_png(one.candidates, STYLE))): (
            plan_of(one)
        )
        for one in shown
    }
    workspace.write_suite(
        models=["alpha", "beta"],
        images=APART,
        seeds=list(SEEDS),
        candidates={"order": "shuffled"},
    )
    with Running(Sighted(answers)) as running:
        workspace.write_models(running.url, "alpha", "beta", transport="direct")
        done = workspace.run(page=True)
        assert (done.code, done.err) == (0, "")
        whole = workspace.records()
        path = workspace.out / "records.jsonl"
        path.write_text("".join(path.read_text().splitlines(keepends=True)[:7]))
        assert workspace.run().code == 0
        assert running.server.requests == 20
    check_records(whole, tasks)
    known = ("sample", "shown", "parse", "scores", "counts")
    assert sorted([[line[k] for k in known] for line in whole], key=str) == sorted(
        [[line[k] for k in known] for line in workspace.records()], key=str
    )
    assert "[candidates shuffled]" in done.out
    assert set(overall_f1(workspace).values()) == {1.0}
    check_scored_again(workspace)


def check_records(records: list[Raw], tasks: dict[str, AssemblyTask]) -> None:
    """Both numberings are there, and all models were shown the same order."""
    assert len(records) == 20
    for record in records:
        task, plan = tasks[record["scene"]], record["parse"]["plan"]
        order = shown_order(task, record["seed"])
        assert record["shown"] == {"order": list(order), "goal": record["scene"]}
        assert record["parse"]["file_plan"] == [order[n - 1] for n in plan]
        looks = [task.candidates[n].look for n in record["parse"]["file_plan"]]
        assert looks == [block.look for block in task.scene.blocks]
        assert all((s["fp"], s["fn"]) == (0, 0) for s in record["scores"])
        assert record["prompt"]["images"][1]["label"] == "candidates"


def check_scored_again(workspace: Workspace) -> None:
    """Stored replies are read in the numbers that were shown, by `score` and on the page."""
    scored = workspace.root / "scored"
    assert workspace.phyblock("score", workspace.out, "--out", scored).code == 0
    assert [r["scores"] for r in workspace.records(scored)] == [
        r["scores"] for r in workspace.records()
    ]
    sent = {i["sha256"][:24] for r in workspace.records() for i in r["prompt"]["images"]}
    beside = {path.stem for path in (workspace.out / "report" / "pictures").glob("*.png")}
    assert beside == sent


@pytest.mark.parametrize("control", ["blind", "wrong_image"])
def test_controls_change_the_goal_and_leave_the_candidates(
    workspace: Workspace, control: str
) -> None:
    tasks = tasks_of(workspace)
    grid = digest(candidates_png(tasks["t1"].candidates, STYLE))
    goals = {digest(goal_png(task.scene, STYLE)): name for name, task in tasks.items()}
    answers = {(goal, grid): plan_of(tasks[name]) for goal, name in goals.items()}
    with Running(Sighted({**answers, (grid,): "Step1: Move block with index 1"})) as running:
        workspace.write_models(running.url, "alpha", transport="direct")
        workspace.write_suite(
            models=["alpha"], images=APART, levels=[2, 3], full_planning={control: True}
        )
        done = workspace.run()
        assert (done.code, done.err) == (0, "")
        texts = {str(seen.parts[-1]) for seen in running.server.seen}
        sent = [pictures(seen) for seen in running.server.seen]
    words = {"blind": "blind", "wrong_image": "pictures of another scene"}[control]
    assert f"[{words}]" in " ".join(done.out.split())
    for record in workspace.records():
        goal = record["shown"]["goal"]
        if control == "blind":
            assert goal is None
        else:
            assert set(tasks[goal].scene.levels) == set(record["levels"])
            assert goal != record["scene"]
        assert record["shown"]["order"] == list(range(1, 17))
    assert all(images[-1] == grid for images in sent)
    assert {len(images) for images in sent} == {1 if control == "blind" else 2}
    assert all(("is not available" in text) == (control == "blind") for text in texts)


def test_episodes_are_shuffled_and_blind_as_well(workspace: Workspace) -> None:
    models = ["oracle", "first-pose", "all-candidates", "goal-blind"]
    workspace.write_suite(
        tracks=["step_planning"],
        models=models,
        levels=[3],
        seeds=list(SEEDS),
        candidates={"order": "shuffled"},
        steps={"physics": "off", "blind": True},
    )
    done = workspace.run()
    assert (done.code, done.err) == (0, "")
    assert "candidates shuffled, blind]" in " ".join(done.out.split())
    f1 = overall_f1(workspace)
    assert f1["oracle"] == 1.0 > f1["all-candidates"]
    assert "The strongest baseline that never sees the goal is" in done.out
    tasks = tasks_of(workspace)
    for record in workspace.records():
        order = shown_order(tasks[record["scene"]], record["seed"])
        assert record["shown"] == {"order": list(order), "goal": None}
        plan = record["parse"]["plan"]
        assert record["parse"]["file_plan"] == [order[n - 1] for n in plan]
        if record["model"] == "all-candidates":
            assert plan == list(range(1, len(plan) + 1))
    one = "oracle/t3/s1"
    assert (
        workspace.phyblock("show", workspace.out, one, "--gif", workspace.root / "x.gif").code == 0
    )


def test_blind_baselines_are_scored_beside_models_without_being_named(
    workspace: Workspace,
) -> None:
    workspace.write_suite(models=["oracle"], levels=[4])
    assert workspace.run().code == 0
    assert {record["model"] for record in workspace.records()} == {"oracle"}
    workspace.write_yaml("models.yaml", {"again": {"replay": str(workspace.out)}})
    workspace.out = workspace.root / "again"
    blind = ["goal-blind", "random"]
    workspace.write_suite(models=["again"], levels=[4])
    suite = yaml.safe_load((workspace.root / "suite.yaml").read_text())
    del suite["baselines"]
    workspace.write_yaml("suite.yaml", suite)
    done = workspace.run()
    assert (done.code, done.err) == (0, "")
    assert [record["model"] for record in workspace.records()] == ["again", *blind]
    assert "0 of 1 model is above goal-blind" in done.out


def test_a_recording_of_another_order_is_refused(workspace: Workspace) -> None:
    workspace.write_suite(models=["oracle"], candidates={"order": "shuffled"}, levels=[4])
    assert workspace.run().code == 0
    workspace.write_yaml("models.yaml", {"again": {"replay": str(workspace.out)}})
    again = ("run", "suite.yaml", "--out", workspace.root / "again", "--no-report")
    workspace.write_suite(models=["again"], levels=[4])
    done = workspace.phyblock(*again)
    assert done.code == 2
    assert "is a recording that was made with candidates.order: shuffled" in done.err
    workspace.write_suite(models=["again"], candidates={"order": "shuffled"}, levels=[4])
    assert workspace.phyblock(*again).code == 0
    (line,) = workspace.records(workspace.root / "again")
    (first,) = workspace.records()
    assert json.dumps(line["scores"]) == json.dumps(first["scores"])
