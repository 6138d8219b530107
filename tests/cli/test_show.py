"""`phyblock show`: a sample of any track, as text and as moving pictures."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from PIL import Image

from phyblock.data.scenes import read_builtin
from phyblock.records.files import read_records
from phyblock.tracks.step_planning import EpisodeRecord, StepPlanning
from tests.servers.chassis import Running
from tests.servers.openai_chat import OpenAIChat
from tests.vqa_set import questions, vqa_suite, write_questions
from tests.workspace import Workspace

REPORT = StepPlanning.report()

SEESAW = {
    "id": "seesaw",
    "levels": [2],
    "parents": ["seesaw"],
    "blocks": [
        *(
            {"order": n, "type": "cube", "color": color, "layer": 1, "depend": [0],
             "position": [x, 0, 0.025], "euler": [0, 0, 0]}
            for n, color, x in ((1, "red", 0), (2, "blue", 0.11))
        ),
        {"order": 3, "type": "cuboid3", "color": "yellow", "layer": 2, "depend": [1],
         "position": [0.055, 0, 0.0625], "euler": [0, 0, 0]},
    ],
    "candidates": [
        {"type": t, "color": c, "euler": [0, 0, 0], "required": 1}
        for t, c in (("cube", "red"), ("cube", "blue"), ("cuboid3", "yellow"))
    ],
}  # fmt: skip


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory, pictures_dir: Path) -> Workspace:
    """A run of oracle and repeat; in some of eight seeds the oracle lets the bar fall."""
    workspace = Workspace(tmp_path_factory.mktemp("played"), pictures_dir)
    workspace.write_scenes(SEESAW)
    workspace.write_suite(
        tracks=["step_planning"],
        models=["oracle", "repeat"],
        seeds=list(range(8)),
        steps={"physics": "strict"},
    )
    assert workspace.run("--no-cache").code == 0
    return workspace


def test_an_episode_is_shown_step_by_step(played: Workspace) -> None:
    endings = {r["seed"]: r["ending"] for r in played.records() if r["model"] == "oracle"}
    assert set(endings.values()) == {"completed", "collapsed"}
    fallen = next(seed for seed, ending in endings.items() if ending == "collapsed")
    gif = played.root / "a" / "out.gif"
    done = played.phyblock("show", "out", f"oracle/seesaw/s{fallen}", "--gif", gif, "--size", "128")
    assert (done.code, done.err) == (0, "")
    assert "Collapsed" in done.out
    assert ["2.", "Move(3):", "Placed"] in [line.split()[:3] for line in done.out.splitlines()]
    assert "3 yellow cuboid3" in done.out
    with Image.open(gif) as frames:
        assert frames.n_frames == 4
        frames.seek(2)
        before = frames.convert("RGB").crop((262, 17, 390, 145)).tobytes()
        frames.seek(3)
        assert frames.convert("RGB").crop((262, 17, 390, 145)).tobytes() != before


def test_a_film_tells_the_outcome_of_each_step_and_the_end(played: Workspace) -> None:
    (task,) = read_builtin(played.root / "data").tasks
    for record in read_records(played.root / "out"):
        assert isinstance(record, EpisodeRecord)
        _, *frames, last = REPORT.film(record, task)
        for frame, outcome in zip(frames, record.outcomes, strict=True):
            heading = REPORT.heading("step", outcome)
            assert frame.caption.endswith("Done" if outcome == "done" else f": {heading}")
        turns = tuple(turn.model_copy(update={"outcome": "empty"}) for turn in record.turns)
        _, *unread, _ = REPORT.film(record.model_copy(update={"turns": turns}), None)
        assert all(frame.caption.endswith(": Empty") for frame in unread)
        assert last.caption.startswith(f"{record.progress[-1]} of 3 blocks placed; ended: ")


def test_a_plan_is_shown_from_its_prompt_to_its_verdicts(workspace: Workspace) -> None:
    with Running(OpenAIChat()) as running:
        workspace.write_models(running.url, "alpha")
        workspace.write_suite(models=["alpha"])
        assert workspace.run().code == 0
    record = next(one for one in workspace.records() if one["scene"] == "t3")
    done = workspace.phyblock("show", "out", "alpha/t3", env={"COLUMNS": "80"})
    assert (done.code, done.err) == (0, "")
    assert max(map(len, done.out.splitlines())) <= 80
    parts = ("\nPrompt (", "\nReply\n", "\nRead\n", "\n1. block ", " blocks placed\n")
    order = [done.out.index(text) for text in parts]
    assert order == sorted(order)
    assert record["reply"]["text"].splitlines()[0] in done.out
    assert " ".join(map(str, record["parse"]["plan"])) in done.out
    steps = re.findall(r"^\d+\. block (\d+): ", done.out, re.MULTILINE)
    assert steps == [str(candidate) for candidate in record["parse"]["plan"]]


def test_an_answer_is_shown_with_the_right_one(workspace: Workspace) -> None:
    write_questions(workspace.root / "questions", questions(per_subtask=2, subtasks=("SH", "CO")))
    workspace.write_suite(**vqa_suite())
    assert workspace.run("--models", "random").code == 0
    for record in workspace.records()[:4]:
        done = workspace.phyblock("show", "out", record["sample"])
        assert (done.code, done.err) == (0, "")
        verdict = "right" if record["answer"]["correct"] else "wrong: the answer is "
        assert f"\n{verdict}" in done.out
