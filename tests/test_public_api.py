"""The public API: names, costs, the guide to it, and tasks, one by one, in any thread."""

import asyncio
import contextlib
import inspect
import itertools
import pickle
import re
import typing
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import version
from pathlib import Path

import pytest
from PIL import Image

import phyblock
from phyblock.api import _distinct
from phyblock.errors import SpecError
from phyblock.records.files import read_manifest, run_records
from phyblock.tracks.pictures import Workshop

NAMES = ["Episode", "PhyblockError", "Run", "Score", "Suite", "Task"]
NAMES += ["Tasks", "Turn", "__version__", "generate", "load_run", "load_suite", "render"]
NAMES += ["run_suite", "tasks", "verify"]
GUIDE = Path(__file__).parents[1] / "docs" / "python.md"
PNG = b"\x89PNG\r\n\x1a\n"


def test_public_names_are_these_and_completion_finds_them():
    assert phyblock.__all__ == NAMES
    assert set(phyblock.__all__) <= set(dir(phyblock))
    assert phyblock.__version__ == version("phyblock")
    for one in (getattr(phyblock, name) for name in phyblock.__all__):
        assert one.__doc__
        assert not inspect.isfunction(one) or "return" in typing.get_type_hints(one)
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        _ = phyblock.nothing


def test_the_guide_runs_and_every_object_shows_itself(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", GUIDE.read_text("utf-8"), re.DOTALL)
    assert len(blocks) == 5
    assert blocks[0].count("\n") < 25, "one screen"
    names = {}
    for block in blocks:
        exec(compile(block, str(GUIDE), "exec"), names)
    assert "levels[0]" in capsys.readouterr().out
    assert Image.open(tmp_path / "front.png").tobytes() == names["picture"].tobytes()
    assert names["picture"]._repr_png_().startswith(PNG)
    run = names["run"]
    assert "quick" in repr(names["suite"])
    assert "random" in run._repr_html_()
    assert set(run.estimates["model"]) == {"random", "goal-blind"}


def test_what_is_wrong_is_named():
    suite = phyblock.load_suite("quick", "limit=2")
    finite = phyblock.tasks("full_planning", limit=1)
    stream = phyblock.tasks("full_planning", split="train")
    playing = phyblock.tasks("step_planning", limit=1)[0]
    scene, other = finite[0].item, finite[0].track.dataset.tasks[0]
    wrong = {
        "there is no such suite": lambda: phyblock.load_suite("quik"),
        "load_suite: suite: is too short": lambda: phyblock.load_suite(""),
        "--set limit=0": lambda: phyblock.load_suite("quick", "limit=0"),
        "has no such task": lambda: phyblock.tasks("full_planning", limit=1)["l9"],
        "render: show": lambda: phyblock.render(scene, show="all"),
        "background is 'sea'": lambda: phyblock.render(scene, background="sea"),
        "size_px is 5": lambda: phyblock.render(scene, size_px=5),
        "tracks[0]: is not one of the choices": lambda: phyblock.tasks("full"),
        'split="test", vqa.path': lambda: phyblock.tasks("vqa", split="train"),
        "tasks: split: takes no data": lambda: phyblock.tasks("vqa", split="dev", data="x"),
        "tasks: limit": lambda: phyblock.tasks("vqa", limit=0),
        "levels[0]": lambda: phyblock.tasks("full_planning", levels=[7]),
        "generate: count": lambda: phyblock.generate(0),
        "verify: scene": lambda: phyblock.verify("x"),
        "run_suite: limit": lambda: phyblock.run_suite(suite, limit=0),
        "run_suite: models: has the wrong type": lambda: phyblock.run_suite(suite, models="random"),
        "run_suite: models: has too few items": lambda: phyblock.run_suite(suite, models=[]),
        "run_suite: out: is too short": lambda: phyblock.run_suite(suite, out=""),
        "found: true": lambda: phyblock.run_suite(suite, limit=True),
        "render: scene": lambda: phyblock.render(suite),
        "render: size_px": lambda: phyblock.render(scene, size_px=128.5),
        "render: view": lambda: phyblock.render(scene, view=["front"]),
        "load_suite: overrides": lambda: phyblock.load_suite("quick", "limit=1", "limit=2", 5),
        "first: is the place": lambda: phyblock.tasks("full_planning", first=1),
        "found: 2": lambda: phyblock.tasks("full_planning", split="dev", limit=1, first=2),
        "data: is not a data set": lambda: phyblock.tasks("full_planning", data=5),
        "data[0]: is not a scene": lambda: phyblock.tasks("full_planning", data=[1]),
        "data[1]: comes a second": lambda: phyblock.tasks("full_planning", data=[other, other]),
        "tracks: does not go": lambda: phyblock.tasks("full_planning", "tracks=[vqa]"),
        "takes texts": lambda: playing.episode().step(None),
        "reply: cannot be scored": lambda: playing.score(5),
        "by place": lambda: stream[:2],
        "found: -1": lambda: stream[-1],
        "found: None": lambda: finite[None],
    }
    for said, call in wrong.items():
        with pytest.raises(SpecError, match=re.escape(said)):
            call()


def test_nothing_is_spent_unasked_and_a_loop_may_run(workspace, monkeypatch):
    monkeypatch.chdir(workspace.root)
    monkeypatch.setenv("OPENAI_API_KEY", "sk-nobody")
    paid = {"id": "openai/gpt-4o", "api_base": "http://127.0.0.1:9/v1"}
    workspace.write_yaml("billed.yaml", {"paid": paid | {"price": {"input": 1, "output": 1}}})
    out = workspace.root / "paid"
    with pytest.raises(SpecError, match=r"was not confirmed(.|\n)*yes=True"):
        phyblock.run_suite("quick", models=["paid"], limit=1, out=out, models_file="billed.yaml")
    assert not out.exists()

    async def in_a_notebook():
        return phyblock.run_suite("quick", models=["random"], limit=2, out=out)

    run = asyncio.run(in_a_notebook())
    assert set(run.records["outcome"]) == {"ok"}


TRACKS = {"full_planning": "quick", "step_planning": "steps", "pose_planning": "pose", "vqa": "vqa"}
JUDGED = ("parse", "scores", "counts", "outcome", "levels", "parents", "n_blocks")


def judged(record):
    """Return what a judgement says, without what a run adds to it."""
    fields = record.model_dump()
    for turn in fields.get("turns", ()):
        del turn["reply"]
    own = ("pose", "answer", "ending", "outcomes", "turns", "question")
    return {name: fields[name] for name in (*JUDGED, *own) if name in fields}


@pytest.mark.parametrize("track", TRACKS)
def test_a_reply_is_worth_what_it_is_in_a_run(track, tmp_path):
    folder = tmp_path / "run"
    run = phyblock.run_suite(TRACKS[track], models=["random"], limit=4, out=folder)
    assert all(isinstance(name, str) for held in run.counts.values() for name in held)
    if track == "full_planning":
        assert {"tp", "fp", "fn"} < {*run.counts[track, "steps"]}
    records = [one for _, one in run_records(folder, read_manifest(folder))]
    for seed, of_seed in itertools.groupby(records, lambda one: one.seed):
        found = phyblock.tasks(track, seed=seed, limit=4)
        for record in of_seed:
            replies = [one.text for one in record.replies]
            score = found[record.item].score(replies if found[0].plays else replies[0])
            assert judged(score.record) == judged(record)


@pytest.mark.parametrize("track", TRACKS)
def test_a_task_asks_as_a_run_does(track):
    found = phyblock.tasks(track, limit=2)
    with contextlib.closing(Workshop()) as shop:
        for task in found:
            opened = type(task.track)(found.suite, task.track.dataset, 2, shop)
            ask = opened.start if task.plays else opened.request
            asked = ask(task.item, 0, {}, with_messages=True)
            request = asyncio.run(asked.request() if task.plays else asked)
            assert task.request().messages == request.messages
            assert task.messages()[-1]["role"] == "user"
            assert len(task.pictures) == str(task.messages()).count("data:image/png;base64,")


def test_the_rewards_of_an_episode_sum_to_its_score():
    task = phyblock.tasks("step_planning", "candidates.order=file", limit=2)[0]
    replies = ["Next plan: Move(1)", "I do not know.", *["Next plan: Move(2)"] * 40]
    episode, total, said = task.episode(), 0.0, 0
    while not episode.done:
        turn = episode.step(replies[said])
        total, said = total + turn.reward, said + 1
    score = task.score(replies)
    assert total == pytest.approx(score.value)
    assert episode.score().value == score.value
    assert score.errors == {"no_move": 1, "overflow": 3}
    with pytest.raises(SpecError, match="has ended"):
        episode.step("Next plan: Done")
    assert episode.reset() == task.messages()
    with pytest.raises(SpecError, match="is asked once"):
        phyblock.tasks("full_planning", limit=1)[0].episode()


def test_threads_and_processes_share_nothing():
    found = phyblock.tasks("full_planning", "images.size_px=128", levels=[1, 2], limit=6)
    reply = "Step1: Move block with index 1\nStep2: Move block with index 2"

    def both(n):
        task = found[n % len(found)]
        return task.score(reply).value, str(task.messages())

    alone = [both(n) for n in range(len(found))]
    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(both, range(48))) == alone * 8
    score = found[0].score(reply)
    assert pickle.loads(pickle.dumps(score)) == score


def test_streams_hold_no_scene_of_the_test_set_and_begin_anywhere():
    stream = phyblock.tasks("full_planning", split="train", levels=[1, 2], seed=5)
    first, again = (list(itertools.islice(stream, 3)) for _ in range(2))
    assert [one.key for one in first] == [one.key for one in again]
    later = phyblock.tasks("full_planning", split="train", levels=[1, 2], seed=5, first=2)
    assert next(iter(later)).key == first[2].key
    assert not {one.key for one in first} & {one.key for one in phyblock.tasks("full_planning")}
    (dev,) = phyblock.tasks("pose_planning", split="dev", levels=[1], seed=5, limit=1)
    assert not phyblock.verify(dev.item)
    assert first[0].score(None).outcome == "missing"
    with pytest.raises(TypeError, match="give a limit"):
        len(stream)


def test_finite_sets_hold_each_scene_once_and_have_slices():
    stream = phyblock.tasks("full_planning", split="train", levels=[1], seed=1)
    drawn = [one.key for one in itertools.islice(stream, 3)]
    assert drawn[2] == drawn[0], "the scene comes again"
    assert stream[1].key == drawn[1]
    finite = phyblock.tasks("full_planning", split="train", levels=[1], seed=1, limit=3)
    keys = [one.key for one in finite]
    assert (keys[:2], len(keys), len(finite)) == (drawn[:2], 3, 3)
    assert [one.key for one in finite[1:]] == keys[1:]
    with pytest.raises(SpecError, match="give 1 scenes"):
        _distinct(itertools.repeat(finite[0].track.dataset.tasks[0]), 2)
