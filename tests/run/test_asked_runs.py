"""Runs that ask for JSON."""

from __future__ import annotations

import json
import shutil
from collections import Counter

import pytest

from phyblock.errors import InputError
from tests.servers.chassis import Running, Seen
from tests.servers.openai_chat import OpenAIChat
from tests.vqa_set import questions, write_questions
from tests.workspace import Raw, Workspace, call

TRACKS = ["full_planning", "step_planning", "vqa"]
FORMAT = {"answer_format": "json_schema"}
RULE = "json"


def schema_of(seen: Seen) -> Raw:
    """The schema that a prompt ends with."""
    schema: Raw = json.loads(str(seen.parts[-1]).splitlines()[-1])
    return schema


def obedient(seen: Seen) -> str:
    """Answer in the schema of the prompt: alpha that alone, beta in a sentence."""
    schema = schema_of(seen)
    *_, key = schema["properties"]
    told = schema["properties"][key]
    value = told["items"]["enum"][:4] if told["type"] == "array" else told["enum"][0]
    text = json.dumps({"reasoning": "Step1: Move block with index 9", key: value})
    return text if seen.model == "alpha" else f"Here it is: {text}"


@pytest.fixture
def asked(inside: Workspace) -> tuple[Workspace, list[Seen]]:
    """A whole run of three tracks and three models, and what the server saw."""
    workspace = inside
    write_questions(workspace.root / "questions", questions(subtasks=["SH", "OR"], per_subtask=1))
    workspace.write_suite(
        tracks=TRACKS,
        models=["alpha", "beta", "random"],
        vqa={"path": "./questions"},
        steps={"physics": "off", "max_steps": 2},
        **FORMAT,
    )
    server = OpenAIChat(say=obedient)
    with Running(server) as running:
        base = {"api_base": f"{running.url}/v1"}
        entries = {name: {"id": f"hosted_vllm/{name}", **base} for name in ("alpha", "beta")}
        entries["beta"]["response_format"] = "never"
        workspace.write_yaml("models.yaml", entries)
        assert call("run", "suite.yaml", "--out", "out", "--no-report", "--limit", 2) == 0
    return workspace, server.seen


def rules(record: Raw) -> set[str | None]:
    parses = [turn["parse"] for turn in record.get("turns", ())] or [record["parse"]]
    return {parse["rule"] for parse in parses}


def test_all_tracks_ask_and_read_by_the_schema(
    asked: tuple[Workspace, list[Seen]], capsys: pytest.CaptureFixture[str]
) -> None:
    workspace, seen = asked
    for one in seen:
        sent = one.params.get("response_format")
        assert (sent is not None) == (one.model == "alpha")
        assert sent is None or sent["json_schema"]["schema"] == schema_of(one)
    records = workspace.records()
    assert Counter(record["track"] for record in records) == dict.fromkeys(TRACKS, 6)
    for record in records:
        how = {"alpha": "response_format", "beta": "prompt"}.get(record["model"])
        assert record.get("asked") == how
        assert record["outcome"] == "ok"
        # Baselines are asked nothing, and read as any text is.
        assert (rules(record) == {RULE}) == (how is not None)
    plans = [r["parse"]["plan"] for r in records if r["track"] == "full_planning" and "asked" in r]
    assert plans == [[1, 2, 3, 4]] * 4
    for name in ("table1.md", "table2.md", "table3.md"):
        assert "answers asked for as JSON" in workspace.tables()[name].decode()

    # Under the other format it is another run; judged again it is the same.
    capsys.readouterr()
    with pytest.raises(InputError, match="another run"):
        call("run", "suite.yaml", "--out", "out", "--limit", 2, "--set", "answer_format=text")
    assert call("score", "out") == 0
    again = workspace.records()
    judged = ("parse", "scores", "asked", "outcome", "turns", "answer")
    for one, other in zip(records, again, strict=True):
        assert [one.get(name) for name in judged] == [other.get(name) for name in judged]

    # A recording is read in the form in which it was asked for.
    lines = [json.dumps(r) for r in records if r["track"] == "full_planning"]
    (workspace.root / "recorded").mkdir()
    shutil.copy(workspace.out / "run.yaml", workspace.root / "recorded")
    (workspace.root / "recorded" / "records.jsonl").write_text("\n".join(lines) + "\n")
    workspace.write_yaml("models.yaml", {"alpha": {"replay": "./recorded"}})
    workspace.write_suite(models=["alpha"])
    with pytest.raises(InputError, match="was made with answer_format: json_schema"):
        call("validate", "suite.yaml")
    workspace.write_suite(models=["alpha"], **FORMAT)
    replayed = workspace.root / "replayed"
    assert call("run", "suite.yaml", "--out", replayed, "--no-report", "--limit", 2) == 0
    assert {rule for r in workspace.records(replayed) for rule in rules(r)} == {RULE}
