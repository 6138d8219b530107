"""Two small runs and a bundle, of which sites are made."""

from __future__ import annotations

import json
from pathlib import Path

from tests.vqa_set import questions, write_questions
from tests.workspace import Workspace

SUBTASKS = ["SH", "OR"]
HOSTILE = "<img src=x onerror='window.hacked=1'>\"&"
HOSTILE_TEXT = "</pre></script><script>window.hacked = 2</script>\u2028'\\');window.hacked = 3//"


def make_runs(root: Path, pictures: Path) -> Workspace:
    """`first`: two baselines in four tracks; `later.zip`: a bundle of two in one of them."""
    workspace = Workspace(root, pictures)
    workspace.write_scenes()
    write_questions(root / "questions", questions(per_subtask=2, subtasks=SUBTASKS))
    fields = {"vqa": {"path": "./questions", "subtasks": SUBTASKS}, "seeds": [0]}
    tracks = ["full_planning", "vqa", "step_planning", "pose_planning"]
    workspace.write_suite(tracks=tracks, steps={"physics": "off"}, **fields)
    workspace.out = root / "first"
    assert workspace.run().code == 0
    workspace.write_suite(name="later", models=["random", "all-candidates"], seeds=[0, 1])
    workspace.out = root / "later"
    assert workspace.run().code == 0
    done = workspace.phyblock("bundle", "later", "--out", "later.zip")
    assert done.code == 0, done.err
    return workspace


def make_hostile(source: Path, folder: Path) -> Path:
    """A copy of a run whose model `random` and scene `t3` are called `HOSTILE`."""
    folder.mkdir()
    named = json.dumps(HOSTILE)[1:-1]
    for name in ("run.yaml", "records.jsonl"):
        text = (source / name).read_text(encoding="utf-8")
        if name == "run.yaml":
            text = text.replace("name: random", f'name: "{named}"')
        (folder / name).write_text(text, encoding="utf-8")
    lines = []
    for line in (source / "records.jsonl").read_text(encoding="utf-8").splitlines():
        record = json.loads(line)
        about = {"model": record["model"], "key": record["key"], "scene": record["scene"]}
        renamed = {"random": HOSTILE, "t3": HOSTILE}
        about = {name: renamed.get(value, value) for name, value in about.items()}
        record |= about
        record["sample"] = f"{record['track']}/{about['model']}/{about['key']}/s{record['seed']}"
        if record["model"] == HOSTILE:
            record["reply"]["text"] = record["reply"]["reasoning"] = HOSTILE_TEXT
        lines.append(json.dumps(record) + "\n")
    (folder / "records.jsonl").write_text("".join(lines), encoding="utf-8")
    return folder
