"""A bundle of a run: scored again elsewhere it says the same; changed, it is refused."""

from __future__ import annotations

import json
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

from phyblock.bundle import ABOUT, MEMBERS, bundle_run, opened_bundle, unpack
from phyblock.errors import DataError, StoreError
from phyblock.records.files import RECORDS
from phyblock.records.manifest import MANIFEST
from phyblock.stable import hex_digest
from tests.bundle.test_bundle_archive import packed
from tests.servers.chassis import Running
from tests.servers.openai_chat import OpenAIChat
from tests.vqa_set import questions, write_questions
from tests.workspace import SCENES, Raw, Workspace

SUBTASKS = ["SH", "OR"]
Change = Callable[[list[Raw], Raw], None]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory, pictures_dir: Path) -> Workspace:
    """A model and a baseline in three tracks, and the bundle of the run beside it."""
    workspace = Workspace(tmp_path_factory.mktemp("bundled"), pictures_dir)
    workspace.write_scenes(*SCENES[:3])
    write_questions(workspace.root / "questions", questions(per_subtask=2, subtasks=SUBTASKS))
    workspace.write_suite(
        tracks=["full_planning", "vqa", "step_planning"],
        vqa={"path": "./questions", "subtasks": SUBTASKS},
        steps={"physics": "off"},
        seeds=[0],
        models=["random", "alpha"],
    )
    with Running(OpenAIChat()) as running:
        workspace.write_models(running.url, "alpha", price={"input": 0.0, "output": 0.0})
        done = workspace.run()
    assert done.code == 0, done.err
    done = workspace.phyblock("bundle", "out")
    assert done.code == 0, done.err
    return workspace


def folders(made: Workspace) -> list[Path]:
    return [made.root / "data", made.root / "questions"]


def contents(made: Workspace, folder: Path) -> dict[str, bytes]:
    folder.mkdir()
    unpack(made.out / "bundle.zip", folder)
    return {name: (folder / name).read_bytes() for name in MEMBERS}


def forged(made: Workspace, folder: Path, change: Change) -> Path:
    """A bundle whose author changed records or manifest and made the digests of them anew."""
    found = contents(made, folder)
    records = [json.loads(line) for line in found[RECORDS].splitlines()]
    manifest = yaml.safe_load(found[MANIFEST])
    change(records, manifest)
    text = "".join(json.dumps(r, ensure_ascii=False, separators=(",", ":")) + "\n" for r in records)
    (folder / RECORDS).write_text(text, encoding="utf-8")
    (folder / MANIFEST).write_text(yaml.safe_dump(manifest, sort_keys=False), encoding="utf-8")
    files = {name: (folder / name).read_bytes() for name in (MANIFEST, RECORDS)}
    digests = {name: hex_digest(data) for name, data in files.items()}
    about = json.dumps({**json.loads(found[ABOUT]), "files": digests})
    path = folder.with_suffix(".zip")
    path.write_bytes(packed({**files, ABOUT: about.encode()}))
    return path


def test_a_bundle_verifies_elsewhere_and_holds_nothing_of_this_machine(
    made: Workspace, tmp_path: Path
) -> None:
    held = contents(made, tmp_path / "held")
    assert not any(str(made.root).encode() in data for data in held.values())
    assert b"messages" not in held[MANIFEST]
    (tmp_path / "elsewhere").mkdir()
    elsewhere = Workspace(tmp_path / "elsewhere", tmp_path / "pictures")
    for folder in folders(made):
        shutil.copytree(folder, elsewhere.root / folder.name)
    shutil.copy(made.out / "bundle.zip", elsewhere.root / "b.zip")
    known = ("--data", "data", "--data", "questions")
    done = elsewhere.phyblock("verify", "b.zip", *known)
    assert done.code == 0, done.err
    assert "20 records of 2 models, scored again" in done.out
    done = elsewhere.phyblock("verify", "b.zip", "--data", "data")
    assert done.code == 2
    assert "needs the questions questions, which a bundle does not hold" in done.err
    done = elsewhere.phyblock("verify", "b.zip")
    assert "needs the data set data" in done.err
    assert "Traceback" not in done.err


def test_data_are_told_by_what_they_hold_whatever_their_names(
    made: Workspace, tmp_path: Path
) -> None:
    """Scenes and questions in one folder are found, and so are questions beside others of their
    name.
    """
    both, other = tmp_path / "both", tmp_path / "questions"
    shutil.copytree(made.root / "data", both)
    shutil.copytree(made.root / "questions", both, dirs_exist_ok=True)
    others = questions(per_subtask=3, subtasks=SUBTASKS)
    write_questions(other, others)
    bundle = made.out / "bundle.zip"
    with opened_bundle(bundle, [both]) as found:
        assert found.records == 20
    with opened_bundle(bundle, [other, *folders(made)]) as found:
        assert found.records == 20
    needs = pytest.raises(DataError, match="needs the questions questions")
    with needs, opened_bundle(bundle, [other, made.root / "data"]):
        pytest.fail("it was taken")


def test_a_run_without_its_data_is_bundled_to_the_same_bytes(
    made: Workspace, tmp_path: Path
) -> None:
    moved = tmp_path / "moved"
    shutil.copytree(made.out, moved)
    text = (moved / MANIFEST).read_text(encoding="utf-8")
    (moved / MANIFEST).write_text(text.replace(str(made.root), "/gone"), encoding="utf-8")
    path = bundle_run(moved, tmp_path / "b.zip")
    assert path.read_bytes() == (made.out / "bundle.zip").read_bytes()


def put(place: str, value: object, track: str = "", model: str = "random") -> Change:
    """A change of one value: in the first record of a track and model, or in the manifest."""

    def change(records: list[Raw], manifest: Raw) -> None:
        node: Any = of_track(records, track, model) if track else manifest
        *above, last = (int(part) if part.isdigit() else part for part in place.split("."))
        for part in above:
            node = node[part]
        node[last] = value

    return change


def test_a_bundle_that_is_killed_leaves_nothing_behind(made: Workspace, tmp_path: Path) -> None:
    """Killed once all is packed, before it is put in its place."""
    code = (
        "import os, signal, sys, phyblock.bundle as bundle\n"
        "from pathlib import Path\n"
        "pack = bundle.pack\n"
        "def packed(*args):\n"
        "    pack(*args)\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
        "bundle.pack = packed\n"
        "bundle.bundle_run(Path(sys.argv[1]), Path(sys.argv[2]))\n"
    )
    for name in ("scratch", "out"):
        (tmp_path / name).mkdir()
    env = made.env | {"TMPDIR": str(tmp_path / "scratch")}
    command = [sys.executable, "-c", code, str(made.out), str(tmp_path / "out" / "b.zip")]
    assert subprocess.run(command, env=env, check=False).returncode == -signal.SIGKILL
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def of_track(records: list[Raw], track: str, model: str = "random") -> Raw:
    return next(r for r in records if r["track"] == track and r["model"] == model)


def _score(records: list[Raw], _: Raw) -> None:
    score = of_track(records, "full_planning")["scores"][0]
    score["tp"], score["fp"] = score["tp"] + score["fp"], 0


def _answer(records: list[Raw], _: Raw) -> None:
    wrong = next(r for r in records if r["track"] == "vqa" and not r["answer"]["correct"])
    wrong["answer"] = {**wrong["answer"], "given": wrong["answer"]["right"], "correct": True}


def _turn(records: list[Raw], _: Raw) -> None:
    turns = (turn for r in records if r["track"] == "step_planning" for turn in r["turns"])
    next(t for t in turns if t["outcome"] != "placed").update(outcome="placed", placed=0)


def _asked_about_less(records: list[Raw], manifest: Raw) -> None:
    del records[1:]
    manifest["items"] = {"full_planning": 1, "vqa": 0, "step_planning": 0}
    manifest["scenes"] = 1


ZEROS = "0" * 64
FORGED: dict[str, Change] = {
    "score": _score,
    "answer": _answer,
    "turn": _turn,
    "twice": lambda records, _: records.append(records[0]),
    "less": _asked_about_less,
    "subtask": put("question.subtask", "CO", "vqa"),
    "level": put("levels", [4], "full_planning"),
    "parents": put("parents", ["t1", "t2"], "full_planning"),
    "plan": put("parse.plan", [1], "full_planning"),
    "prompt": put("prompt.messages", ZEROS, "full_planning", "alpha"),
    "template": put("prompt.version", ZEROS, "vqa", "alpha"),
    "first turn": put("turns.0.prompt.messages", ZEROS, "step_planning", "alpha"),
    "label": put("prompt.images.0.label", "answer", "vqa", "alpha"),
    "time": put("time", "9999-12-31T00:00:00+00:00", "full_planning"),
    "pictures": put("tracks.full_planning.pictures", ZEROS),
    "no prompt": put("tracks.full_planning.prompt", None),
    "created": put("created", "1999-12-31T00:00:00+00:00"),
}


@pytest.mark.parametrize("name", FORGED)
def test_what_does_not_follow_from_the_replies_is_refused(
    made: Workspace, tmp_path: Path, name: str
) -> None:
    path = forged(made, tmp_path / "forged", FORGED[name])
    with pytest.raises(StoreError) as caught, opened_bundle(path, folders(made)):
        pytest.fail("it was taken")
    assert str(path) in str(caught.value)
    assert "/run/" not in str(caught.value)


def test_samples_that_were_left_out_are_counted(made: Workspace, tmp_path: Path) -> None:
    """Anyone may leave out what went wrong and bundle the rest: then it is said."""
    copy = tmp_path / "run"
    shutil.copytree(made.out, copy)
    lines = (copy / RECORDS).read_text(encoding="utf-8").splitlines(keepends=True)
    (copy / RECORDS).write_text("".join(lines[1:]), encoding="utf-8")
    bundle_run(copy, made.root / "less.zip")
    known = ("--data", "data", "--data", "questions")
    done = made.phyblock("verify", "less.zip", *known)
    assert done.code == 0, done.err
    assert "19 of 20 expected samples: the run is not whole" in done.out
    done = made.phyblock("verify", "out/bundle.zip", *known)
    assert "20 of 20 expected samples." in done.out


def test_what_is_not_changed_is_made_here_to_the_byte(made: Workspace, tmp_path: Path) -> None:
    """Forgeries are refused for what was changed, not for how they are made."""
    path = forged(made, tmp_path / "forged", lambda *_: None)
    (tmp_path / "again").mkdir()
    unpack(path, tmp_path / "again")
    was = contents(made, tmp_path / "was")
    assert (tmp_path / "again" / RECORDS).read_bytes() == was[RECORDS]
    with opened_bundle(path, folders(made)) as found:
        told = " ".join(found.unverified)
    assert "Step planning: the prompts after the first of an episode." in told
    assert "The bytes of pictures" in told


def test_prompts_of_an_author_s_own_template_are_said_to_be_unverified(
    made: Workspace, tmp_path: Path
) -> None:
    own = put("tracks.vqa.prompt", {"name": "mine", "version": ZEROS})
    with opened_bundle(forged(made, tmp_path / "forged", own), folders(made)) as found:
        assert "VQA: the prompts, of a template that is not at hand." in found.unverified


def test_data_are_never_looked_for_where_a_bundle_says(made: Workspace, tmp_path: Path) -> None:
    def change(_: list[Raw], manifest: Raw) -> None:
        manifest["dataset"] |= {"root": "/proc", "name": "../../.."}

    path = forged(made, tmp_path / "forged", change)
    with pytest.raises(DataError, match="which a bundle does not hold"), opened_bundle(path):
        pytest.fail("it was taken")


def _models(records: list[Raw], manifest: Raw) -> None:
    manifest["models"] = []
    records.clear()


@pytest.mark.parametrize(
    ("change", "field"), [(put("suite.levels.0", [1]), "suite.levels"), (_models, "models")]
)
def test_a_manifest_that_names_no_plan_is_refused(
    made: Workspace, tmp_path: Path, change: Change, field: str
) -> None:
    path = forged(made, tmp_path / "forged", change)
    with pytest.raises(StoreError, match=re.escape(field)), opened_bundle(path, folders(made)):
        pytest.fail("it was taken")


def _changed_member(held: dict[str, bytes], name: str, old: bytes, new: bytes) -> dict[str, bytes]:
    assert old in held[name]
    return {**held, name: held[name].replace(old, new)}


@pytest.mark.parametrize(
    ("name", "old", "new", "said"),
    [
        (RECORDS, b'"seed":0', b'"seed":1', "files.records.jsonl"),
        (MANIFEST, b"name: trial", b"name: other", "files.run.yaml"),
        (ABOUT, b'"readers": ', b'"readers": 1e999, "x": ', "is no description"),
        (ABOUT, b'"format": 1', b'"format": 2', "format"),
        (ABOUT, b'"format": 1', b'"format": ' + b"9" * 400, "is no description of a bundle"),
        (MANIFEST, b"seeds:", b"seeds: &a [*a]\nx:", "run.yaml"),
    ],
)
def test_a_member_that_was_changed_is_named(
    made: Workspace, tmp_path: Path, name: str, old: bytes, new: bytes, said: str
) -> None:
    held: dict[str, Any] = contents(made, tmp_path / "held")
    path = tmp_path / "b.zip"
    path.write_bytes(packed(_changed_member(held, name, old, new)))
    with pytest.raises(StoreError) as caught, opened_bundle(path, folders(made)):
        pytest.fail("it was taken")
    assert said in str(caught.value)
