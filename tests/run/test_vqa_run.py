"""Whole runs of the VQA track against a local server: pictures, modes, tables, bad input."""

from __future__ import annotations

import hashlib
import json
import re
from collections import Counter
from typing import Any

import pytest
from PIL import Image as PillowImage

from phyblock.data.questions import read_questions
from phyblock.data.scenes import read_builtin
from phyblock.domain.question import LETTERS, Question
from phyblock.sim.pictures import PictureStyle
from phyblock.sim.question_pictures import question_png
from tests.fork_server import Done
from tests.servers.chassis import Running, Seen
from tests.servers.openai_chat import OpenAIChat
from tests.vqa_set import questions, vqa_suite, write_questions
from tests.workspace import Raw, Workspace

FEW = ["SH", "VP", "OR", "AD"]


def a_cube(seen: Seen) -> str:
    """The letter of the cube wherever it stands; else A."""
    found = re.search(r"^([A-D])\. cube$", str(seen.parts[-1]), re.MULTILINE)
    return f"It looks like a cube.\n\nAnswer: {found[1] if found else 'A'}"


def run_with(
    workspace: Workspace,
    server: OpenAIChat,
    *args: str,
    models: tuple[str, ...] = ("alpha",),
    seeds: tuple[int, ...] = (0,),
    **fields: Any,
) -> Done:
    write_questions(workspace.root / "questions")
    with Running(server) as running:
        workspace.write_models(running.url, *models, transport="direct")
        workspace.write_suite(
            **{**vqa_suite(**fields), "models": list(models), "seeds": list(seeds)}
        )
        return workspace.run(*args)


def pictures_of(workspace: Workspace) -> dict[str, tuple[Question, dict[str, str]]]:
    """By question, the digest of each of its pictures by label, drawn here."""
    scenes = read_builtin(workspace.root / "data")
    found = read_questions(workspace.root / "questions", scenes)
    style = PictureStyle(size_px=128)
    return {
        task.key: (
            task.question,
            {
                picture.label: hashlib.sha256(question_png(picture, style)).hexdigest()
                for picture in task.question.pictures
            },
        )
        for task in found.tasks
    }


def shown(seen: Seen) -> list[tuple[str, str]]:
    """Caption and digest of each picture in the order in which they arrived."""
    parts = seen.parts[:-1]
    pairs = [(parts[i], parts[i + 1]) for i in range(0, len(parts), 2)]
    for caption, picture in pairs:
        assert isinstance(caption, str)
        assert isinstance(picture, tuple)
        assert picture[0] == "image/png"
    return [(str(caption), picture[1]) for caption, picture in pairs]


def test_pictures_arrive_in_order_each_with_its_caption(workspace: Workspace) -> None:
    server = OpenAIChat(say=a_cube)
    done = run_with(workspace, server, subtasks=FEW, per_subtask=2)
    assert (done.code, done.err) == (0, "")
    drawn = pictures_of(workspace)
    by_text = {question.text: (question, labels) for question, labels in drawn.values()}
    assert server.requests == 8
    for seen in server.seen:
        found = re.search(r"^Question: (.*)$", str(seen.parts[-1]), re.MULTILINE)
        assert found is not None
        question, labels = by_text[found[1]]
        captions = {
            "scene": "First picture:" if len(labels) > 1 else "Picture:",
            "block": "Second picture, one block by itself:",
            **{letter: f"Picture {letter}:" for letter in LETTERS},
        }
        order = [label for label in ("scene", "block", *LETTERS) if label in labels]
        assert shown(seen) == [(captions[label], labels[label]) for label in order]
        assert len(order) == {"SH": 1, "VP": 5, "OR": 4, "AD": 2}[question.subtask]
    for record in workspace.records():
        question = drawn[record["question"]["id"]][0]
        assert record["answer"]["right"] == question.answer_letters
        assert record["answer"]["correct"] == (
            record["answer"]["given"] == record["answer"]["right"]
        )
        assert record["outcome"] == ("parse_failure" if question.subtask == "OR" else "ok")


def test_pictures_of_official_files_are_sent_byte_for_byte(workspace: Workspace) -> None:
    folder = workspace.root / "questions"
    folder.mkdir()
    entry = {
        "scene_id": "t1",
        "question": "What comes next?",
        "options": ["<img1>", "<img2>", "<img3>", "<img4>"],
        "answer": "D",
    }
    (folder / "PD.json").write_text(json.dumps([entry]), encoding="utf-8")
    digests = {}
    for name in ("t1", *(f"pd-001/img{i}" for i in range(1, 5))):
        path = folder / "images" / f"{name}.png"
        path.parent.mkdir(parents=True, exist_ok=True)
        PillowImage.new("RGB", (40, 30), (8 * len(digests), 90, 120)).save(path)
        digests[name] = hashlib.sha256(path.read_bytes()).hexdigest()
    server = OpenAIChat(say=lambda _: "D")
    with Running(server) as running:
        workspace.write_models(running.url, "alpha", transport="direct")
        fields = vqa_suite(format="official", circular=True)
        workspace.write_suite(**{**fields, "models": ["alpha"]})
        done = workspace.run()
    assert (done.code, done.err) == (0, "")
    first, *others = digests.values()
    sent = [tuple(digest for _, digest in shown(seen)) for seen in server.seen]
    turned = {(first, *others[by:], *others[:by]) for by in range(4)}
    assert len(sent) == len(turned) == 4
    assert set(sent) == turned
    right = {record["answer"]["right"] for record in workspace.records()}
    assert right == set(LETTERS)


def test_circular_and_blind_a_question_counts_once_and_only_if_all_rotations_are_right(
    workspace: Workspace,
) -> None:
    server = OpenAIChat(say=a_cube)
    done = run_with(
        workspace, server, circular=True, blind=True, subtasks=["SH", "CO"], per_subtask=3
    )
    assert (done.code, done.err) == (0, "")
    assert server.requests == 24
    made = {one["id"]: one for one in questions()}
    records = workspace.records()
    assert Counter(record["question"]["rotation"] for record in records) == dict.fromkeys(
        range(4), 6
    )
    is_cube = {
        name: made[name]["options"][LETTERS.index(made[name]["answer"])] == "cube"
        for name in {record["question"]["id"] for record in records}
    }
    assert all(
        record["answer"]["correct"] == is_cube[record["question"]["id"]] for record in records
    )
    cells = accuracies(workspace, "accuracy")
    for subtask in ("SH", "CO"):
        right = [held for name, held in is_cube.items() if name.startswith(subtask.lower())]
        assert float(cells[subtask]["value"]) == pytest.approx(sum(right) / 3, abs=1e-6)
        assert cells[subtask]["n"] == "3"
    assert "circular" in done.out
    assert "[circular, blind]" in workspace.tables()["table2.tex"].decode().replace(
        "{", ""
    ).replace("}", "")


def accuracies(workspace: Workspace, measure: str) -> dict[str, Raw]:
    rows = workspace.rows("estimates")
    return {row["cell"]: row for row in rows if row["measure"] == measure}
