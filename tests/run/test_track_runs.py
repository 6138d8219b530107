"""Whole runs: of questions and of episodes, of all tracks that ask for JSON, in other ways, and of
another version.
"""

import hashlib
import itertools
import json
import re
import shutil
from collections import Counter
from dataclasses import replace
from functools import partial

import pytest
import yaml
from PIL import Image as PillowImage

from phyblock.data.scenes import read_builtin
from phyblock.domain.question import LETTERS
from phyblock.domain.scene import AssemblyTask, Candidate, CandidateSet, Scene
from phyblock.errors import InputError, SpecError, StoreError
from phyblock.parsing.answer import parse_move
from phyblock.parsing.plan import parse_plan
from phyblock.records.files import read_manifest
from phyblock.results.compare import compare
from phyblock.results.load import load_run
from phyblock.run import manifest, store
from phyblock.run.rescore import rescore
from phyblock.sim.engine import ENGINES, described_engine, installed_engines
from phyblock.sim.pictures import PictureStyle, candidates_png, goal_png
from phyblock.tracks import full_planning, step_planning
from phyblock.tracks.base import presented
from tests.servers.chassis import Faults, Running
from tests.servers.openai_chat import OpenAIChat, answered
from tests.sim.structures import counterweighted_beam
from tests.tracks.conftest import raw_of
from tests.workspace import call, plan_text, problem_of, questions, vqa_suite, write_questions

TRACKS = ["full_planning", "step_planning", "vqa"]
FORMAT = {"answer_format": "json_schema"}
PLANS = {"tracks": ["full_planning"], "seeds": list(range(40))}
STYLE = PictureStyle(size_px=128)
SEEDS = (0, 1)
EARLIER = 5


def schema_of(seen):
    return json.loads(str(seen.parts[-1]).splitlines()[-1])


def obedient(seen):
    """Answer in the schema of the prompt: alpha that alone, beta in a sentence."""
    schema = schema_of(seen)
    *_, key = schema["properties"]
    told = schema["properties"][key]
    value = told["items"]["enum"][:4] if told["type"] == "array" else told["enum"][0]
    text = json.dumps({"reasoning": "Step1: Move block with index 9", key: value})
    return text if seen.model == "alpha" else f"Here it is: {text}"


def rules(record):
    parses = [turn["parse"] for turn in record.get("turns", ())] or [record["parse"]]
    return {parse["rule"] for parse in parses}


def test_all_tracks_ask_and_read_by_the_schema(inside):
    write_questions(inside.root / "questions", questions(subtasks=["SH", "OR"], per_subtask=1))
    asked = vqa_suite() | {"tracks": TRACKS, "steps": {"physics": "off", "max_steps": 2}} | FORMAT
    inside.write_suite(models=["alpha", "beta", "random"], **asked)
    server = OpenAIChat(say=obedient)
    with Running(server) as running:
        base = {"api_base": f"{running.url}/v1"}
        entries = {name: {"id": f"hosted_vllm/{name}", **base} for name in ("alpha", "beta")}
        entries["beta"]["response_format"] = "never"
        inside.write_yaml("models.yaml", entries)
        assert call("run", "suite.yaml", "--out", "out", "--no-report", "--limit", 2) == 0
    for one in server.seen:
        sent = one.params.get("response_format")
        assert (sent is not None) == (one.model == "alpha")
        assert sent is None or sent["json_schema"]["schema"] == schema_of(one)
    records = inside.records()
    assert Counter(record["track"] for record in records) == dict.fromkeys(TRACKS, 6)
    for record in records:
        how = {"alpha": "response_format", "beta": "prompt"}.get(record["model"])
        assert (record.get("asked"), record["outcome"]) == (how, "ok")
        # Baselines are asked nothing, and read as any text is.
        assert (rules(record) == {"json"}) == (how is not None)
    plans = [r["parse"]["plan"] for r in records if r["track"] == "full_planning" and "asked" in r]
    assert plans == [[1, 2, 3, 4]] * 4
    for name in ("table1.tex", "table2.tex", "table3.tex"):
        assert "answers asked for as JSON" in inside.tables()[name].decode()

    # Under the other format it is another run; judged again it is the same.
    with pytest.raises(InputError, match="another run"):
        call("run", "suite.yaml", "--out", "out", "--limit", 2, "--set", "answer_format=text")
    assert call("score", "out", "--jobs", "1") == 0
    assert inside.records() == records

    # A recording is read in the form in which it was asked for.
    inside.write_yaml("models.yaml", {"alpha": {"replay": "./out"}})
    inside.write_suite(models=["alpha"])
    with pytest.raises(InputError, match="was made with answer_format: json_schema"):
        call("validate", "suite.yaml")
    inside.write_suite(models=["alpha"], **FORMAT)
    replayed = inside.root / "replayed"
    assert call("run", "suite.yaml", "--out", replayed, "--no-report", "--limit", 2) == 0
    assert {rule for r in inside.records(replayed) for rule in rules(r)} == {"json"}


def a_cube(seen):
    found = re.search(r"^([A-D])\. cube$", str(seen.parts[-1]), re.MULTILINE)
    return f"It looks like a cube.\n\nAnswer: {found[1] if found else 'A'}"


def test_pictures_of_official_files_are_sent_byte_for_byte(workspace):
    entry = {"scene_id": "t1", "question": "What comes next?", "answer": "D"}
    entry["options"] = ["<img1>", "<img2>", "<img3>", "<img4>"]
    folder = workspace.root / "questions"
    folder.mkdir()
    (folder / "PD.json").write_text(json.dumps([entry]), encoding="utf-8")
    digests = {}
    for name in ("t1", *(f"pd-001/img{i}" for i in range(1, 5))):
        path = folder / "images" / f"{name}.png"
        path.parent.mkdir(parents=True, exist_ok=True)
        PillowImage.new("RGB", (40, 30), (8 * len(digests), 90, 120)).save(path)
        digests[name] = hashlib.sha256(path.read_bytes()).hexdigest()
    fields = vqa_suite(format="official", circular=True)
    with workspace.served(OpenAIChat(say=lambda _: "D"), **fields) as server:
        workspace.completed()
    first, *others = digests.values()
    sent = Counter(seen.pictures for seen in server.seen)
    assert sent == Counter((first, *others[by:], *others[:by]) for by in range(4))
    assert {record["answer"]["right"] for record in workspace.records()} == set(LETTERS)


def test_circular_and_blind_a_question_counts_once_and_only_if_all_rotations_are_right(workspace):
    write_questions(workspace.root / "questions")
    asked = vqa_suite(circular=True, blind=True, subtasks=["SH", "CO"])
    with workspace.served(OpenAIChat(say=a_cube), **asked) as server:
        done = workspace.completed("--limit", "6")
    assert server.requests == 24
    records = workspace.records()
    turns = Counter(record["question"]["rotation"] for record in records)
    assert turns == dict.fromkeys(range(4), 6)
    asked = {record["question"]["id"] for record in records}
    is_cube = {
        one["id"]: one["options"][LETTERS.index(one["answer"])] == "cube"
        for one in questions()
        if one["id"] in asked
    }
    assert all(r["answer"]["correct"] == is_cube[r["question"]["id"]] for r in records)
    cells = {r["cell"]: r for r in workspace.rows("estimates") if r["measure"] == "accuracy"}
    for subtask in ("SH", "CO"):
        right = [held for name, held in is_cube.items() if name.startswith(subtask.lower())]
        assert float(cells[subtask]["value"]) == pytest.approx(sum(right) / 3, abs=1e-6)
        assert cells[subtask]["n"] == "3"
    assert "[circular, blind]" in " ".join(done.out.split())


def prepare(workspace, server, **fields):
    suite = {"tracks": ["step_planning"], "images": {"size_px": 128, "layout": "separate"}}
    suite |= {"limits": {"max_concurrency": 4, "max_attempts": 8}, "steps": {"physics": "off"}}
    return workspace.served(server, **suite | fields)


def stable(value):
    """A record without what differs between two runs of the same replies."""
    if isinstance(value, dict):
        volatile = ("time", "latency_s", "attempts", "cached", "run")
        return {k: stable(v) for k, v in value.items() if k not in volatile}
    return [stable(v) for v in value] if isinstance(value, list) else value


def by_sample(records):
    return {record["sample"]: stable(record) for record in records}


@pytest.mark.parametrize("fields", [PLANS, {"limit": 3}])
def test_faults_change_nothing_and_every_request_is_an_attempt(workspace, fields):
    found = []
    mix = {"429": 0.1, "500": 0.05, "reset": 0.02, "cut": 0.005, "empty": 0.005}
    for faults in (Faults(), Faults(mix, retry_after="0")):
        with prepare(workspace, OpenAIChat(faults, say=answered), **fields) as server:
            workspace.out = workspace.root / f"out{len(found)}"
            workspace.completed("--no-cache")
        records = workspace.records()
        assert all(record["outcome"] == "ok" or record["turns"] for record in records)
        asked = [turn for record in records for turn in record.get("turns", [record])]
        assert server.requests == sum(one["reply"]["attempts"] for one in asked)
        assert len(asked) == server.ended["ok"]
        found.append(by_sample(records))
    assert found[0] == found[1]
    assert server.requests > len(asked)


def unsteady_scene():
    """A plank that tips off its post until the second weight is on."""
    below = ((), (1,), (2,), (2,))
    beam = zip(counterweighted_beam(), below, (1, 2, 3, 3), strict=True)
    blocks = tuple(replace(one, depend=depend, layer=layer) for one, depend, layer in beam)
    looks = {one.look: Candidate(one.type, one.color, one.euler_deg) for one in blocks}
    scene = Scene("beam", (3,), blocks, ("beam",))
    return raw_of(AssemblyTask(scene, CandidateSet(tuple(looks.values()))))


@pytest.mark.skipif(len(installed_engines()) < 2, reason="one engine is installed")
def test_runs_in_two_engines_are_scored_anywhere_and_never_compared(inside, monkeypatch):
    """Falls are read from the records, whichever engine is here now."""
    inside.write_scenes(unsteady_scene())
    inside.write_suite(tracks=["step_planning"], models=["oracle"], steps={"physics": "strict"})
    usual, other = (inside.root / name for name in ENGINES)
    for out in (usual, other):
        monkeypatch.setenv("PHYBLOCK_PHYSICS", out.name)
        call("run", "suite.yaml", "--out", out, "--no-report")
        (record,) = inside.records(out)
        manifest = yaml.safe_load((out / "run.yaml").read_bytes())
        found = (record["engine"], manifest["engine"], record["ending"])
        assert found == (described_engine(), described_engine(), "collapsed")

    asked = (usual / "records.jsonl").read_text()
    rescore(usual)
    assert (usual / "records.jsonl").read_text() == asked
    with pytest.raises(SpecError, match="physics: cannot be compared"):
        compare(load_run(usual), load_run(other))


@pytest.mark.parametrize(("mode", "outcome"), [("length", "truncated"), ("filtered", "refusal")])
def test_an_episode_of_which_no_reply_is_whole_is_no_parse_failure(workspace, mode, outcome):
    with prepare(workspace, OpenAIChat(Faults(mode=mode)), limit=3):
        workspace.completed()
    assert {record["outcome"] for record in workspace.records()} == {outcome}


# Runs that ask in other ways: shuffled, blind, and varied.


def tasks_of(workspace):
    return {task.key: task for task in read_builtin(workspace.root / "data").tasks}


def overall_f1(workspace):
    """By model, under setting A; plans with the matcher of the headline."""
    wanted = {"measure": "f1", "cell": "overall", "setting": "A"}.items()
    rows = [row for row in workspace.rows("estimates") if wanted <= row.items()]
    return {row["model"]: float(row["value"]) for row in rows if row["matcher"] != "paper"}


def test_a_model_that_looks_is_right_in_every_order(workspace):
    tasks = tasks_of(workspace)
    answers = {}
    for task, seed in itertools.product(tasks.values(), SEEDS):
        one = presented(task, seed, "shuffled")
        pictures = (goal_png(one.scene, STYLE), candidates_png(one.candidates, STYLE))
        plan = [one.candidates.index_of(block.look) for block in one.scene.blocks]
        answers[tuple(hashlib.sha256(png).hexdigest() for png in pictures)] = plan_text(*plan)
    suite = {"images": {"size_px": 128, "layout": "separate"}, "candidates": {"order": "shuffled"}}
    # It knows goals and grids by the digests of their pictures.
    sighted = OpenAIChat(say=lambda seen: answers[seen.pictures])
    with workspace.served(sighted, "alpha", "beta", seeds=list(SEEDS), **suite):
        done = workspace.completed()
    assert sighted.requests == len(workspace.records()) == 20
    assert "[candidates shuffled]" in done.out
    assert set(overall_f1(workspace).values()) == {1.0}
    # Stored replies are read as they were asked for: in the numbers that were shown.
    scored = shutil.copytree(workspace.out, workspace.root / "scored")
    workspace.does("score", scored, "--jobs", "1")
    again = workspace.records(scored)
    assert [record["scores"] for record in again] == [r["scores"] for r in workspace.records()]
    # All models were shown the same order, in whose numbers they answered.
    for record in workspace.records():
        task, plan = tasks[record["scene"]], record["parse"]["plan"]
        order = presented(task, record["seed"], "shuffled").order
        assert record["shown"] == {"order": list(order), "blind": False}
        looks = [task.candidates[order[n - 1]].look for n in plan]
        assert looks == [block.look for block in task.scene.blocks]
        assert all((s["fp"], s["fn"]) == (0, 0) for s in record["scores"])
        assert record["prompt"]["images"][1]["label"] == "candidates"


def test_episodes_are_shuffled_and_blind_as_well(workspace):
    workspace.write_suite(
        tracks=["step_planning"],
        models=["oracle", "first-pose", "all-candidates", "goal-blind"],
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
    assert "0 of 1 model is shown to be above goal-blind" in workspace.completed().out
    models = [record["model"] for record in workspace.records()]
    assert models == ["again", "goal-blind", "random"]
    # A run of baselines alone has those that it names.
    workspace.write_yaml("suite.yaml", {**suite, "models": ["random"]})
    workspace.out = workspace.root / "alone"
    workspace.completed()
    assert {record["model"] for record in workspace.records()} == {"random"}


# Runs that another version judged: refused until they are scored, then gone on with.


class Stopping(OpenAIChat):
    """Takes no key any more once it has given so many answers; `answered` names their requests."""

    def __init__(self, answers):
        super().__init__(say=self.said)
        self.answers, self.answered = answers, []

    def said(self, seen):
        self.answered.append(seen.sample)
        if len(self.answered) >= self.answers:
            self.faults = Faults(mode="401")
        return answered(seen)


def run(out, *args):
    return call("run", "suite.yaml", "--out", out, "--no-report", "--yes", "--no-cache", *args)


def score(folder, *args):
    return call("score", folder, "--jobs", "1", *args)


def read_earlier(monkeypatch):
    """Read as readers of an earlier version, which did not read all numbers."""
    monkeypatch.setattr(manifest, "READER_VERSION", EARLIER)
    for module, read in ((full_planning, parse_plan), (step_planning, parse_move)):
        monkeypatch.setattr(module, read.__name__, partial(reads, read))


def reads(read, text, *rest):
    return read(re.sub(r"\(2\)|\(4\)|(?<=index )3", "?", text), *rest)


@pytest.fixture
def begun(inside, monkeypatch):
    """A run of two tracks that earlier readers began, stopped in the middle of episodes; the
    server, which answers again.
    """
    with Running(server := Stopping(22)) as running:
        inside.write_models(running.url, "alpha", max_tokens=100)
        inside.write_suite(
            tracks=["full_planning", "step_planning"],
            models=["random", "alpha"],
            images={"size_px": 128, "layout": "separate"},
            limits={"max_concurrency": 3},
            steps={"physics": "off", "max_steps": 4},
        )
        with monkeypatch.context() as earlier:
            read_earlier(earlier)
            assert run("out") == 1
        server.faults, server.answers = Faults(), 10**6
        yield server


def newest(workspace, folder):
    """The newest record of every sample, but for what differs between two runs."""
    return by_sample(workspace.records(workspace.root / folder))


def test_it_is_refused_until_it_is_scored_and_ends_as_if_begun_today(begun, workspace, capsys):
    before, earlier = newest(workspace, "out"), read_manifest(workspace.out)
    files = workspace.files()
    for args in ((), ("--dry-run",)):
        problem = problem_of(StoreError, run, "out", *args)
        assert "by another version" in str(problem)
        assert f"readers {EARLIER}" in problem.found
        assert problem.hint.startswith("phyblock score out first")
    assert workspace.files() == files
    answered = len(begun.answered)
    capsys.readouterr()
    assert score("out") == 0
    assert len(begun.answered) == answered
    scored = newest(workspace, "out")
    diverged = {name for name, one in scored.items() if one["error"] and not before[name]["error"]}
    assert f"in {len(diverged)} episodes this version would have asked" in capsys.readouterr().err
    assert {scored[name]["model"] for name in diverged} == {"random", "alpha"}
    assert any(scored[name]["scores"] != one["scores"] for name, one in before.items())
    now = read_manifest(workspace.out)
    assert (now.identity, now.created) == (earlier.identity, earlier.created)

    assert run("out") == 0
    assert max(Counter(begun.answered).values()) == 1, "a reply that still holds was asked again"
    assert len(begun.answered) > answered
    assert run("fresh") == 0
    assert newest(workspace, "out") == newest(workspace, "fresh")


@pytest.mark.usefixtures("begun")
def test_kills_processes_and_shards_end_in_the_same_records(workspace, monkeypatch):
    def records(name):
        return (workspace.root / name / "records.jsonl").read_bytes()

    for name in ("whole", "1", "2", "processes", "shards"):
        shutil.copytree(workspace.out, workspace.root / name)
    assert score("whole") == 0
    for writes in (1, 2):
        name, write, lives = str(writes), store.atomic_write, iter(range(writes - 1))

        def dying(*args, lives=lives, write=write, **options):
            if next(lives, None) is None:
                raise KeyboardInterrupt
            write(*args, **options)

        with monkeypatch.context() as dies:
            dies.setattr(store, "atomic_write", dying)
            with pytest.raises(KeyboardInterrupt):
                rescore(workspace.root / name)
        assert (records(name) == records("out")) == (writes == 1)
        with pytest.raises(StoreError, match="by another version"):
            run(name)
        assert score(name) == 0
        assert newest(workspace, name) == newest(workspace, "whole")
    assert run("2") == 0
    assert call("score", "processes", "--jobs", "2") == 0
    for shard in ("2/3", "1/3", "3/3"):
        assert score("shards", "--shard", shard) == 0
    assert records("processes") == records("shards") == records("whole")


@pytest.mark.usefixtures("begun")
def test_answers_of_a_shard_about_earlier_records_are_refused(workspace):
    assert score("out", "--shard", "1/1") == 0
    assert run("out") == 0
    before = newest(workspace, "out")
    with pytest.raises(StoreError, match="is not the record that was scored"):
        score("out", "--shard", "1/1")
    assert newest(workspace, "out") == before
    assert score("out") == 0
    assert newest(workspace, "out") == before
