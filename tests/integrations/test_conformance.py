"""Every integration gives a reply the score that the scorer of plans gives it, to the last bit.

A framework that is not installed is skipped; docs/integrations.md says how each is installed.
"""

import asyncio
import itertools
import json
import os
import re
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

import phyblock
from phyblock.errors import SpecError
from phyblock.parsing.plan import parse_plan
from phyblock.scoring.plan import AssemblyScorer, Counts
from tests.servers.chassis import Running
from tests.servers.openai_chat import OpenAIChat
from tests.shipped import reply_texts

OVERRIDES = ("parser=official", "scoring.matchers=[paper]", "images.size_px=128")


def example(heading):
    """Return the Python of a section of the page about integrations."""
    page = (Path(__file__).parents[2] / "docs" / "integrations.md").read_text("utf-8")
    found = re.search(rf"## {heading}\n.*?```python\n(.*?)```", page, re.DOTALL)
    return found[1]


@pytest.fixture(scope="module")
def known(official_checkout):
    return phyblock.tasks("full_planning", *OVERRIDES, data=official_checkout)


@pytest.fixture(scope="module")
def expected(official_checkout, known):
    """F1 of every recorded reply, by the scorer alone."""
    scorers = {}
    found = {}
    for (model, key), text in reply_texts(official_checkout).items():
        item = known[key].item
        scorer = scorers.setdefault(key, AssemblyScorer(item.scene, item.candidates, ("A",)))
        plan = parse_plan(text, len(item.candidates), "official").plan
        (score,) = scorer.score(plan, ("paper",), None)
        found[model, key] = Counts(score["tp"], score["fp"], score["fn"]).f1 or 0.0
    assert len(found) == 3190
    return found


def check(checkout, expected, score):
    replies = reply_texts(checkout)
    assert {name: score(name[1], text) for name, text in replies.items()} == expected


def test_tasks(official_checkout, known, expected):
    check(official_checkout, expected, lambda key, text: known[key].score(text).value)


def test_inspect(official_checkout, known, expected):
    pytest.importorskip("inspect_ai", reason="inspect_ai is not installed")
    from inspect_ai.model import ModelName, ModelOutput
    from inspect_ai.scorer import Target
    from inspect_ai.solver import TaskState

    from phyblock.integrations.inspect_ai import phyblock_scorer

    scorer = phyblock_scorer(known)

    def score(key, text):
        output = ModelOutput.from_content("recorded", text)
        state = TaskState(ModelName("none/recorded"), key, 0, key, [], output=output)
        found = asyncio.run(scorer(state, Target("")))
        return float(found.value["f1"])

    check(official_checkout, expected, score)


def log_of_inspect(folder, track, *options):
    """Return the log of `inspect eval` with a scripted model."""
    pytest.importorskip("inspect_ai", reason="inspect_ai is not installed")
    with Running(OpenAIChat()) as running:
        call = f"""-m inspect_ai eval phyblock/{track} -T overrides=[images.size_px=128]
            --model openai/scripted --model-base-url {running.url}/v1 -M responses_api=false
            --log-format json --log-dir {folder}"""
        env = {**os.environ, "OPENAI_API_KEY": "sk-nobody"}
        words = [sys.executable, *call.split(), *options]
        subprocess.run(words, check=True, cwd=folder, env=env)
    (path,) = folder.glob("*.json")
    return json.loads(path.read_text("utf-8"))


@pytest.mark.parametrize("track", ["full_planning", "step_planning"])
def test_an_eval_of_inspect(track, tmp_path):
    log = log_of_inspect(tmp_path, track, "-T", "items=4")
    found = {one["name"]: one["metrics"] for one in log["results"]["scores"]}
    assert set(found) == {"f1", "success"}
    names = {name.partition("by_part_")[2] for name in found["f1"]}
    assert {"all", "all stderr", "level 3", "level 3 stderr"} <= names


@pytest.mark.parametrize(
    ("levels", "overrides"),
    [
        ("1,2", "images.size_px=128"),
        ("2", "images.size_px=128,limit=9"),
        ("[1,2]", '["seeds=[1]"]'),
    ],
)
def test_arguments_of_inspect(levels, overrides):
    pytest.importorskip("inspect_ai", reason="inspect_ai is not installed")
    from inspect_ai._cli.util import parse_cli_args

    from phyblock.integrations.inspect_ai import full_planning

    given = parse_cli_args([f"levels={levels}", f"overrides={overrides}", "items=4"])
    parts = {one.metadata["part"] for one in full_planning(**given).dataset}
    assert parts == {f"level {level}" for level in levels if level.isdecimal()}


def test_a_sample_of_inspect_that_a_limit_stops_keeps_its_replies(tmp_path):
    log = log_of_inspect(tmp_path, "step_planning", "-T", "items=1", "--turn-limit", "2")
    (sample,) = log["samples"]
    assert sample["limit"]["type"] == "turn"
    assert len(sample["store"]["replies"]) == 2
    score = sample["scores"]["phyblock_scorer"]
    assert score["metadata"]["outcome"] != "missing"


def test_verifiers(official_checkout, expected):
    pytest.importorskip("verifiers", reason="verifiers is not installed")
    import verifiers.v1 as vf
    from verifiers.v1.graph import MessageNode

    from phyblock.integrations.verifiers import VerifiersConfig, VerifiersTaskset

    config = VerifiersConfig(
        split="test", data=str(official_checkout), overrides=list(OVERRIDES), limit=None
    )
    by_key = {task.data.id: task for task in VerifiersTaskset(config)}

    def score(key, text):
        said = MessageNode(message=vf.AssistantMessage(content=text), sampled=True)
        trace = vf.Trace.model_construct(nodes=[said])
        return asyncio.run(by_key[key].value(trace))

    check(official_checkout, expected, score)
    assert VerifiersTaskset(VerifiersConfig(limit=None)).INFINITE
    stored = type(by_key["000"])(by_key["000"].data)
    assert stored.asked.key == "000"
    for limit in (3, None):
        drawn = VerifiersTaskset(VerifiersConfig(split="train", levels=[1], seed=2, limit=limit))
        for task in itertools.islice(drawn, 3):
            assert type(task)(task.data).asked.key == task.data.id


def test_openenv(official_checkout, known, expected):
    pytest.importorskip("openenv", reason="openenv is not installed")
    from phyblock.integrations.openenv import PhyBlockAction, PhyBlockEnvironment

    environment = PhyBlockEnvironment(known)

    def score(key, text):
        assert environment.reset(key=key).messages
        return float(environment.step(PhyBlockAction(text=text)).reward or 0.0)

    check(official_checkout, expected, score)
    with pytest.raises(RuntimeError, match="reset"):
        environment.step(PhyBlockAction(text=""))
    stream = phyblock.tasks("full_planning", split="train", levels=[1], seed=2)
    for source in (stream, known[:3]):
        keys = [one.key for one in itertools.islice(source, 3)]
        places = itertools.count()
        several = [PhyBlockEnvironment(source, places) for _ in keys]
        assert [one.reset().key for one in several] == keys
        assert several[0].reset(seed=1).key == keys[1]
    assert several[1].reset().key == keys[0]


@pytest.mark.parametrize("text", ["full_planning", "[1]", "{}"])
def test_tasks_of_an_environment(text, monkeypatch):
    pytest.importorskip("openenv", reason="openenv is not installed")
    from phyblock.integrations.openenv import tasks_of_environment

    monkeypatch.setenv("PHYBLOCK_TASKS", text)
    with pytest.raises(SpecError, match="PHYBLOCK_TASKS"):
        tasks_of_environment()
    given = {"track": "full_planning", "overrides": ["images.size_px=128"], "limit": 2}
    monkeypatch.setenv("PHYBLOCK_TASKS", json.dumps(given))
    assert len(tasks_of_environment()) == 2


def test_a_server_of_openenv(capsys):
    pytest.importorskip("openenv", reason="openenv is not installed")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    call = "-m uvicorn --factory phyblock.integrations.openenv:app --log-level error --port"
    with subprocess.Popen([sys.executable, *call.split(), str(port)]) as server:
        try:
            for _ in range(600):
                with socket.socket() as probe:
                    if probe.connect_ex(("127.0.0.1", port)) == 0:
                        break
                time.sleep(0.1)
            exec(example("OpenEnv").replace("localhost:8000", f"127.0.0.1:{port}"), {})
        finally:
            server.terminate()
    assert "'measure': 'f1'" in capsys.readouterr().out


def test_trl(official_checkout, known, expected):
    pytest.importorskip("datasets", reason="datasets is not installed")
    from phyblock.integrations.trl import dataset, reward

    worth = reward(known)

    def score(key, text):
        (found,) = worth(completions=[[{"role": "assistant", "content": text}]], key=[key])
        return found

    check(official_checkout, expected, score)
    names = {}
    exec(example("TRL"), names)
    first = names["tasks"][0]
    assert names["worth"](["Step 1: Move block with index 1"], [first.key]) == [
        first.score("Step 1: Move block with index 1").value
    ]
    rows = dataset(phyblock.tasks("full_planning", "images.size_px=128", limit=2))
    assert [part["type"] for part in rows[0]["prompt"][1]["content"]] == ["image", "text"]
    assert rows[0]["images"][0].size == (258, 128)
    with pytest.raises(ValueError, match="cannot be rows"):
        dataset(phyblock.tasks("step_planning", limit=2))


def test_lmms_eval(tmp_path):
    from phyblock.integrations import files

    written = files.write_lmms_eval(tmp_path, 4)
    assert {one.name for one in written} >= {"vqa.yaml", "vqa.jsonl", "utils.py"}
    for task in phyblock.tasks("vqa", limit=4):
        row = {"track": "vqa", "key": task.key}
        assert str(row).replace("'", '"') in (tmp_path / "vqa.jsonl").read_text("utf-8")
        for reply in ("Answer: A", "Answer: B", "I do not know."):
            assert files.process_results(row, [reply])["value"] == task.score(reply).value
        assert len(files.doc_to_visual(row)) == len(task.pictures)
        assert files.doc_to_text(row)
