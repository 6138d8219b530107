"""A run of all three tracks with its report, small enough to be made for every test session."""

from __future__ import annotations

import json
from pathlib import Path

from tests.vqa_set import questions, write_questions
from tests.workspace import Raw, Workspace

HOSTILE = (
    "<script>window.hacked = 1</script><img src=x onerror='window.hacked = 2'>"
    "</pre></script><!--<script>\u2028'\\');window.hacked = 3//\ud83d\n"
    "Step1: Move block with index 1"
)
MARKUP = """# Plan
Look [here](javascript:window.hacked=4) and ![x](http://127.0.0.1/p.png): **first** `3`.

> <b onmouseover="window.hacked=5">quote</b>

1. Move block with index 9. It is green.
2. Move block with index 3

| block | why |
|---|---|
| 3 | *base* |
"""
MARKUP_SAMPLE = "full_planning/oracle/t5/s1"
HOSTILE_SAMPLE = "full_planning/random/t3/s0"
SUBTASKS = ("SH", "OR", "AD")


def make_run(root: Path, pictures: Path) -> Workspace:
    """Two baselines on five scenes and six questions, in all tracks, with two seeds.

    One reply says `HOSTILE`, one `MARKUP`, which plans 9, 3; one is missing.
    """
    workspace = Workspace(root, pictures)
    workspace.write_scenes()
    write_questions(root / "questions", questions(per_subtask=2, subtasks=SUBTASKS))
    workspace.write_suite(
        tracks=["full_planning", "vqa", "step_planning"],
        vqa={"path": "./questions", "subtasks": list(SUBTASKS)},
        steps={"physics": "off"},
        seeds=[0, 1],
    )
    done = workspace.run()
    assert done.code == 0, done.err
    rewrite(workspace.out)
    done = workspace.phyblock("report", workspace.out)
    assert done.code == 0, done.err
    assert done.out.splitlines()[-1] == "out/report.html"
    return workspace


def rewrite(folder: Path) -> None:
    """Put a hostile reply, Markdown and a missing reply into the records of a run."""
    path = folder / "records.jsonl"
    lines = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    for record in lines:
        if record["sample"] == HOSTILE_SAMPLE:
            record["reply"]["text"] = record["reply"]["reasoning"] = HOSTILE
            record["parse"]["rule"] = HOSTILE
        if record["sample"] == MARKUP_SAMPLE:
            record["reply"]["text"] = MARKUP
            record["parse"]["plan"] = [9, 3]
            for score in record["scores"]:
                if score.get("placed"):
                    score["placed"], score["why"] = [None, 0], ["shape_not_in_gt", None]
        if record["sample"] == "full_planning/random/t4/s0":
            record.update(reply=None, outcome="missing", scores=[], parse=None)
    path.write_text("".join(json.dumps(record) + "\n" for record in lines), encoding="utf-8")


def many(records: list[Raw], model: str, copies: int) -> list[Raw]:
    """Copies of a model's records, as those of ten models on further scenes."""
    made = []
    for copy in range(copies):
        name, suffix = f"{model}-{copy % 10}", f"-{copy // 10}"
        for record in records:
            if record["model"] == model:
                key = record["key"] + suffix
                sample = f"{record['track']}/{name}/{key}/s{record['seed']}"
                about = {"sample": sample, "model": name, "key": key, "scene": key}
                made.append({**record, **about})
    return made
