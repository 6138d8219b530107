"""`phyblock questions reword`: from wordings that a model wrote to a run that asks them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from phyblock.cli.main import phyblock
from phyblock.data import read_builtin, read_questions
from phyblock.errors import DataError
from phyblock.making.questions.rewording import read_wordings, reword
from tests.making.cli.test_questions_write import GOOD, QUESTION, SCENE, Writer, sees_negations
from tests.servers.chassis import Running
from tests.servers.openai_chat import OpenAIChat
from tests.vqa_set import vqa_suite, write_questions
from tests.workspace import Raw, Workspace

ASKED = "The blue block: what shape has it?"
COLOR: Raw = QUESTION | {
    "id": "co-001",
    "subtask": "CO",
    "wording": "co-1",
    "question": "What is the color of the topmost block?",
    "options": ["red", "blue", "green", "yellow"],
    "evidence": {"slots": {"block": "topmost block"}},
}
LINE: Raw = {"wording": "sh-m1", "subtask": "SH", "template": GOOD, "accepted": True}


def wordings_file(folder: Path, *lines: Raw) -> Path:
    path = folder / "found.jsonl"
    path.write_text("".join(json.dumps(line) + "\n" for line in lines), encoding="utf-8")
    return path


def a_set(workspace: Workspace, *questions: Raw) -> None:
    workspace.write_scenes(SCENE)
    write_questions(workspace.root / "questions", questions)


def vqa(workspace: Workspace, *words: object) -> Result:
    places = ("--questions", workspace.root / "questions", "--data", workspace.root / "data")
    return CliRunner().invoke(phyblock, ["questions", *map(str, (*words, *places))])


def command(workspace: Workspace, out: str, *args: object) -> Result:
    root = workspace.root
    places = (root / "found.jsonl", "--out", root / out, "--jobs", 1)
    return vqa(workspace, "reword", *places, *args)


def lines_of(folder: Path) -> list[Raw]:
    text = (folder / "questions.jsonl").read_text(encoding="utf-8")
    return [json.loads(line) for line in text.splitlines()]


def test_what_a_model_wrote_is_asked_by_a_run(workspace: Workspace) -> None:
    a_set(workspace, QUESTION, COLOR)
    with Running(Writer([GOOD], sees_negations)) as running:
        models = workspace.write_models(running.url, "writer", transport="direct")
        how = ("--models-file", models, "--model", "writer", "--no-cache", "--subtasks", "SH")
        done = vqa(workspace, "write", *how, "--out", workspace.root / "found.jsonl")
        assert "1 paraphrase, 1 accepted" in done.output
    done = command(workspace, "new", "--add")
    assert "1 question in further wordings beside 2 questions as before: " in done.output
    server = OpenAIChat()
    with Running(server) as running:
        workspace.write_models(running.url, "alpha", transport="direct")
        workspace.write_suite(**vqa_suite(path="./new") | {"models": ["alpha", "oracle"]})
        assert workspace.run().code == 0
    sent = [str(seen.parts[-1]) for seen in server.seen]
    assert sum(ASKED in text for text in sent) == 1
    assert len(sent) == 3
    answers = {
        record["question"]["id"]: record["answer"]["correct"]
        for record in workspace.records()
        if record["model"] == "oracle"
    }
    assert answers == {"sh-001": True, "sh-001-m1": True, "co-001": True}


def test_a_set_in_new_wordings_alone_verifies_and_comes_out_the_same(workspace: Workspace) -> None:
    a_set(workspace, QUESTION, COLOR)
    wordings_file(workspace.root, LINE, LINE | {"wording": "sh-m2", "accepted": False})
    assert command(workspace, "one").exit_code == 0
    (line,) = lines_of(workspace.root / "one")
    assert (line["id"], line["question"], line["wording"]) == ("sh-001-m1", ASKED, "sh-m1")
    assert line["answer"] == QUESTION["answer"]
    assert command(workspace, "one", "--replace").exit_code == 0
    places = ["--data", str(workspace.root / "data"), "--jobs", "1"]
    again = CliRunner().invoke(
        phyblock, ["questions", "verify", str(workspace.root / "one"), *places]
    )
    assert (again.exit_code, "all answers derived again" in again.output) == (0, True)


def test_a_question_that_cannot_be_derived_again_is_left_out(workspace: Workspace) -> None:
    a_set(workspace, QUESTION, QUESTION | {"id": "sh-002", "answer": "A"})
    wordings_file(workspace.root, LINE)
    done = command(workspace, "new")
    assert done.exit_code == 0
    assert "left out: sh-002-m1: the answer is B, not A" in done.output
    assert [line["id"] for line in lines_of(workspace.root / "new")] == ["sh-001-m1"]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"template": 7}, "template: is no text"),
        ({"template": "What shape is it?"}, "cannot be used: its slots are none"),
        ({"template": "What is the shape of the {block}?"}, "cannot be used: it is not new"),
        ({"wording": "zz-m1"}, "wording: is of no known kind"),
        ({"wording": "sh-1"}, "wording: is used already"),
        ({"accepted": "yes"}, "accepted: is neither true nor false"),
        ({"accepted": False}, "holds no accepted wording"),
    ],
)
def test_a_line_that_cannot_be_used_is_named(
    changes: dict[str, Any], said: str, tmp_path: Path
) -> None:
    with pytest.raises(DataError) as error:
        read_wordings(wordings_file(tmp_path, LINE | changes))
    assert said in str(error.value)


def test_all_problems_of_a_file_are_named_at_once(tmp_path: Path) -> None:
    path = wordings_file(tmp_path, LINE, LINE, {"wording": "sh-m3"})
    path.write_text(path.read_text(encoding="utf-8") + "{broken\n", encoding="utf-8")
    with pytest.raises(DataError) as error:
        read_wordings(path)
    where = [problem.where.removeprefix(f"{path}:") for problem in error.value.problems]
    assert where == ["2", "3", "3", "4:2"]
    for content in (b"\xff\n", None):
        if content is None:
            path.unlink()
        else:
            path.write_bytes(content)
        with pytest.raises(DataError):
            read_wordings(path)


def test_which_wording_is_drawn_depends_on_seed_and_question_alone(workspace: Workspace) -> None:
    templates = (GOOD, "Which shape has the {block}?", "Name the shape of the {block}.")
    lines = [LINE | {"wording": f"sh-m{n}", "template": t} for n, t in enumerate(templates, 1)]
    wordings = read_wordings(wordings_file(workspace.root, *lines))
    a_set(workspace, *({**QUESTION, "id": f"sh-{n:03d}"} for n in range(1, 13)))
    scenes = read_builtin(workspace.root / "data")
    questions = [t.question for t in read_questions(workspace.root / "questions", scenes).tasks]
    drawn = reword(questions, wordings, 0)
    assert reword(questions[::-1], wordings, 0) == drawn
    assert {question.wording for question in drawn.values()} == {"sh-m1", "sh-m2", "sh-m3"}
    assert reword(questions, wordings, 1) != drawn
