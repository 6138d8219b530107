"""Runs whose replies an earlier version of the readers read, scored again under this one."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable

import pytest

from phyblock.parsing.text import READER_VERSION
from phyblock.records import read_manifest
from phyblock.report.compare import compare_runs
from phyblock.run.rescore import rescore
from phyblock.tables.load import load_run
from tests.vqa_set import write_questions
from tests.workspace import Raw, Workspace


@pytest.fixture
def told() -> list[str]:
    return []


@pytest.fixture
def earlier(workspace: Workspace, told: list[str]) -> Callable[[], list[Raw]]:
    """A run of two tracks that readers of an earlier version read: no answer, and in one episode
    another move than today; gives the records of scoring it again.
    """
    write_questions(workspace.root / "questions")
    asked = {"vqa": {"path": "./questions", "subtasks": ["SH", "OR"]}, "steps": {"physics": "off"}}
    workspace.write_suite(tracks=["step_planning", "vqa"], models=["oracle"], levels=[3], **asked)
    assert workspace.run("--no-report").code == 0
    manifest = workspace.out / "run.yaml"
    text, count = re.subn(rf"readers: '{READER_VERSION}'", "readers: '1'", manifest.read_text())
    assert count == 1
    manifest.write_text(text)
    lines = workspace.records()
    shutil.copy(workspace.out / "records.jsonl", workspace.root / "today.jsonl")
    for line in lines:
        if line["track"] == "vqa":
            answer = {**line["answer"], "given": None, "correct": False}
            unread = {"rule": None, "letters": None}
            line.update(outcome="parse_failure", parse=unread, answer=answer)
        else:
            # A field that came later.
            del line["parse"]["file_plan"]
    episode = next(line for line in lines if line["track"] == "step_planning")
    episode["turns"][0]["reply"]["text"] = "Next plan: Done"
    path = workspace.out / "records.jsonl"
    path.write_text("".join(json.dumps(line) + "\n" for line in lines), encoding="utf-8")

    def again() -> list[Raw]:
        return workspace.records(
            rescore(workspace.out, None, None, workspace.root / "again", tell=told.append)
        )

    return again


def test_answers_are_read_again_and_episodes_that_would_go_otherwise_stay(
    workspace: Workspace, earlier: Callable[[], list[Raw]], told: list[str]
) -> None:
    again = {line["sample"]: line for line in earlier()}
    stored = {line["sample"]: line for line in workspace.records()}
    today = map(json.loads, (workspace.root / "today.jsonl").read_text("utf-8").splitlines())
    answers = {line["sample"]: line for line in today if line["track"] == "vqa"}
    assert {line["outcome"] for line in answers.values()} == {"ok"}
    assert again == stored | answers
    assert read_manifest(workspace.root / "again").versions["readers"] == "1"
    (kept,) = told
    assert kept.startswith("Step planning: 1 episode of the run would go otherwise")


def test_answers_stay_as_they_were_read_where_the_questions_are_gone(
    workspace: Workspace, earlier: Callable[[], list[Raw]], told: list[str]
) -> None:
    shutil.rmtree(workspace.root / "questions")
    assert earlier() == workspace.records()
    assert told[0].startswith("VQA: replies stay as they were read: ")
    assert "holds no questions" in told[0]


def test_what_is_read_again_as_a_whole_is_of_this_version_and_a_comparison_names_both(
    workspace: Workspace, told: list[str]
) -> None:
    workspace.write_suite(models=["oracle"])
    assert workspace.run("--no-report").code == 0
    manifest = workspace.out / "run.yaml"
    manifest.write_text(
        manifest.read_text().replace(f"readers: '{READER_VERSION}'", "readers: '1'")
    )
    again = rescore(workspace.out, None, None, workspace.root / "again", tell=told.append)
    assert not told
    assert read_manifest(again).versions["readers"] == str(READER_VERSION)
    said = compare_runs(load_run(workspace.out), load_run(again)).how
    assert f"out by readers 1, again by readers {READER_VERSION}; phyblock score reads" in said
    assert "readers" not in compare_runs(load_run(again), load_run(again)).how
