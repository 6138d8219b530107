"""A bundle of a run: scored again elsewhere it says the same; changed, it is refused."""

import io
import json
import re
import shutil
import signal
import stat
import struct
import subprocess
import sys
import warnings
import zipfile

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock import bundle
from phyblock.bundle import ABOUT, MEMBERS, bundle_run, opened_bundle, unpack
from phyblock.errors import DataError, StoreError
from phyblock.records.files import MANIFEST, RECORDS, Manifest, known_records
from phyblock.run.manifest import portable_manifest
from phyblock.text import hex_digest
from tests.data.broken import with_value
from tests.servers.openai_chat import OpenAIChat
from tests.web.factory import manifest, record
from tests.workspace import SCENES, Workspace, questions, write_questions


@pytest.fixture(scope="module")
def made(new_workspace):
    """A model and a baseline in three tracks, and the bundle of the run beside it."""
    workspace, subtasks = new_workspace(*SCENES[:3]), ["SH", "OR"]
    write_questions(workspace.root / "questions", questions(per_subtask=2, subtasks=subtasks))
    tracks = {"tracks": ["full_planning", "vqa", "step_planning"], "steps": {"physics": "off"}}
    tracks["vqa"] = {"path": "./questions", "subtasks": subtasks}
    with workspace.served(OpenAIChat(), models=["random", "alpha"], **tracks):
        workspace.completed()
    workspace.does("bundle", "out")
    return workspace


def folders(made):
    return [made.root / "data", made.root / "questions"]


def contents(made, folder):
    folder.mkdir()
    unpack(made.out / "bundle.zip", folder)
    return {name: (folder / name).read_bytes() for name in MEMBERS}


def forged(made, folder, change):
    """A bundle whose author changed records or manifest and made the digests of them anew."""
    found = contents(made, folder)
    records = [json.loads(line) for line in found[RECORDS].splitlines()]
    manifest = yaml.safe_load(found[MANIFEST])
    change(records, manifest)
    text = "".join(json.dumps(r, ensure_ascii=False, separators=(",", ":")) + "\n" for r in records)
    files = {MANIFEST: yaml.safe_dump(manifest, sort_keys=False).encode(), RECORDS: text.encode()}
    path = folder.with_suffix(".zip")
    path.write_bytes(archive(*with_digests(files, json.loads(found[ABOUT])).items()))
    return path


def archive(*members):
    file = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as made:
        warnings.simplefilter("ignore")
        for name, data in members:
            made.writestr(name, data)
    return file.getvalue()


def with_digests(files, about):
    digests = {name: hex_digest(data) for name, data in files.items()}
    return {**files, ABOUT: json.dumps({**about, "files": digests}).encode()}


def test_a_bundle_verifies_elsewhere_and_holds_nothing_of_this_machine(made, tmp_path):
    held = contents(made, tmp_path / "held")
    assert not any(str(made.root).encode() in data for data in held.values())
    assert b"messages" not in held[MANIFEST]
    elsewhere = Workspace(tmp_path / "elsewhere", tmp_path / "pictures")
    for folder in folders(made):
        shutil.copytree(folder, elsewhere.root / folder.name)
    shutil.copy(made.out / "bundle.zip", elsewhere.root / "b.zip")
    done = elsewhere.does("verify", "b.zip", "--data", "data", "--data", "questions")
    assert "20 of 20 expected samples." in done.out
    assert "What was sent" in done.out
    for data, lacking in ((["--data", "data"], "questions questions"), ([], "data set data")):
        done = elsewhere.phyblock("verify", "b.zip", *data)
        assert (done.code, "Traceback" in done.err) == (2, False)
        assert done.err.startswith("error: b.zip: data.")
        assert f"needs the {lacking}, which a bundle does not hold" in done.err


def test_a_run_without_its_data_is_bundled_to_the_same_bytes(made, tmp_path):
    moved = tmp_path / "moved"
    shutil.copytree(made.out, moved)
    text = (moved / MANIFEST).read_text(encoding="utf-8")
    (moved / MANIFEST).write_text(text.replace(str(made.root), "/gone"), encoding="utf-8")
    path = bundle_run(moved, tmp_path / "b.zip")
    assert path.read_bytes() == (made.out / "bundle.zip").read_bytes()


def test_samples_that_were_left_out_are_counted(made, tmp_path):
    shutil.copytree(made.out, tmp_path / "run")
    lines = (tmp_path / "run" / RECORDS).read_text(encoding="utf-8").splitlines(keepends=True)
    (tmp_path / "run" / RECORDS).write_text("".join(lines[1:]), encoding="utf-8")
    bundle_run(tmp_path / "run", made.root / "less.zip")
    done = made.does("verify", "less.zip", "--data", "data", "--data", "questions")
    assert "19 of 20 expected samples: the run is not complete" in done.out


def put(place, value, track=""):
    """A change of one value: in the first record of the baseline in a track, or the manifest."""

    def change(records, manifest):
        mine = (n for n, r in enumerate(records) if (r["track"], r["model"]) == (track, "random"))
        if track:
            number = next(mine)
            records[number] = with_value(records[number], place, value)
        else:
            manifest |= with_value(manifest, place, value)

    return change


def _answer(records, _):
    wrong = next(r for r in records if r["track"] == "vqa" and not r["answer"]["correct"])
    wrong["answer"] = {**wrong["answer"], "given": wrong["answer"]["right"], "correct": True}


def _turn(records, _):
    turns = (turn for r in records if r["track"] == "step_planning" for turn in r["turns"])
    next(t for t in turns if t["outcome"] != "placed").update(outcome="placed", placed=0)


def _asked_about_less(records, manifest):
    del records[1:]
    manifest["items"] = {"full_planning": 1, "vqa": 0, "step_planning": 0}
    manifest["scenes"] = 1


def _no_models(records, manifest):
    manifest["models"] = []
    records.clear()


FORGED = {
    "score": (put("scores.0.tp", 4, "full_planning"), "does not verify"),
    "answer": (_answer, RECORDS),
    "turn": (_turn, RECORDS),
    "twice": (lambda records, _: records.append(records[0]), "jsonl:21: does not verify"),
    "less": (_asked_about_less, "items, scenes"),
    "subtask": (put("question.subtask", "CO", "vqa"), RECORDS),
    "level": (put("levels", [4], "full_planning"), RECORDS),
    "parents": (put("parents", ["t1", "t2"], "full_planning"), RECORDS),
    "plan": (put("parse.plan", [1], "full_planning"), RECORDS),
    "no-plan": (put("suite.levels.0", [1]), re.escape("suite.levels")),
    "no-models": (_no_models, "models"),
}


@pytest.mark.parametrize("name", FORGED)
def test_what_does_not_follow_from_the_replies_is_refused(made, tmp_path, name):
    change, said = FORGED[name]
    path = forged(made, tmp_path / "forged", change)
    with pytest.raises(StoreError, match=f"forged.zip.*{said}"), opened_bundle(path, folders(made)):
        pytest.fail("it was taken")


def test_what_is_not_changed_is_made_here_to_the_byte(made, tmp_path):
    """Forgeries are refused for what was changed, not for how they are made."""
    path = forged(made, tmp_path / "forged", lambda *_: None)
    with opened_bundle(path, folders(made)) as found:
        held = contents(made, tmp_path / "was")
        assert (found.folder / RECORDS).read_bytes() == held[RECORDS]


def test_data_are_never_looked_for_where_a_bundle_says(made, tmp_path):
    path = forged(made, tmp_path / "forged", put("dataset.root", "/proc"))
    with pytest.raises(DataError, match="which a bundle does not hold"), opened_bundle(path, []):
        pytest.fail("it was taken")


SOUND = with_digests(
    {name: f"{name} holds this\n".encode() * 50 for name in (MANIFEST, RECORDS)}, {"format": 1}
)
LESS = [(name, data) for name, data in SOUND.items() if name != RECORDS]


_FILE = io.BytesIO()
with zipfile.ZipFile(_FILE, "w") as _made:
    for _name in MEMBERS:
        bundle.add(_made, _name, [SOUND[_name].decode()])
PACKED = _FILE.getvalue()
FLAGS_AT = PACKED.index(b"PK\1\2") + 8
SIZE = struct.pack("<L", len(SOUND[RECORDS]))
LINK = zipfile.ZipInfo(RECORDS)
LINK.external_attr = (stat.S_IFLNK | 0o777) << 16
HOSTILE = {
    "empty": lambda: b"",
    "text": lambda: b"hello\n" * 100,
    "out of the folder": lambda: archive(*SOUND.items(), ("../../evil", b"x")),
    "absolute": lambda: archive(*LESS, ("/tmp/evil", b"x")),
    "folder": lambda: archive(*LESS, (f"{RECORDS}/", b"")),
    "twice": lambda: archive(*SOUND.items(), (RECORDS, b"x")),
    "link": lambda: archive(*LESS, (LINK, b"/etc/passwd")),
    "bomb": lambda: archive(*LESS[:1], (RECORDS, b"x"), (ABOUT, bytes(2**24))),
    "larger than it says": lambda: PACKED.replace(SIZE, struct.pack("<L", 7)),
    "encrypted": lambda: PACKED[:FLAGS_AT] + b"\1" + PACKED[FLAGS_AT + 1 :],
    "lacks one": lambda: archive(*LESS),
    "changed": lambda: archive(*LESS, (RECORDS, b"other")),
    "no digests": lambda: archive(*LESS[:1], (RECORDS, b"other"), (ABOUT, b"[]")),
    "other format": lambda: archive(*with_digests(SOUND, {"format": 2}).items()),
    "deep": lambda: archive(*LESS[:1], (RECORDS, b"other"), (ABOUT, b"[" * 9000)),
    "lists too much": lambda: PACKED[:-10] + struct.pack("<L", 2**31) + PACKED[-6:],
    "large archive": lambda: PACKED[:-22] + b"PK\6\7" + bytes(16) + PACKED[-22:],
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_a_hostile_archive_is_refused_and_writes_nothing_elsewhere(tmp_path, kind):
    path, folder = tmp_path / "b.zip", tmp_path / "a" / "b" / "c"
    folder.mkdir(parents=True)
    path.write_bytes(HOSTILE[kind]())
    assert path.read_bytes() != PACKED
    with pytest.raises(StoreError, match=re.escape(str(path))):
        unpack(path, folder)
    written = {p.relative_to(tmp_path).as_posix() for p in tmp_path.rglob("*") if p.is_file()}
    assert written <= {"b.zip", *(f"a/b/c/{name}" for name in MEMBERS)}
    assert all(p.stat().st_size < 2**21 and not p.is_symlink() for p in folder.iterdir())


@settings(max_examples=80)
@given(at=st.integers(0, len(PACKED) - 1), byte=st.integers(0, 255), cut=st.booleans())
def test_a_bundle_that_was_cut_or_changed_is_refused_or_holds_the_same(
    tmp_path_factory, at, byte, cut
):
    folder = tmp_path_factory.mktemp("changed")
    rest = b"" if cut else bytes([byte]) + PACKED[at + 1 :]
    (folder / "b.zip").write_bytes(PACKED[:at] + rest)
    try:
        unpack(folder / "b.zip", folder)
    except StoreError:
        return
    assert not cut
    assert {name: (folder / name).read_bytes() for name in MEMBERS} == SOUND


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("/srv/models/Qwen2-VL", "Qwen2-VL"),
        ("hosted_vllm//srv/models/Qwen2-VL/", "hosted_vllm/Qwen2-VL"),
        ("hosted_vllm/~/Qwen", "hosted_vllm/Qwen"),
        ("D:\\models\\Qwen", "Qwen"),
        ("openai/gpt-4o", "openai/gpt-4o"),
        ("hosted_vllm/Qwen/Qwen2-VL", "hosted_vllm/Qwen/Qwen2-VL"),
    ],
)
def test_of_what_one_machine_knows_the_ends_of_paths_stay(before, after):
    """Failed requests keep their kind alone; what is sent to a model stays as it is."""
    params = {"stop": ["/no_think", "/a/b"], "extra_body": {"path": "/v1/x"}}
    fields = manifest(models=["alpha"])
    served = {"kind": "litellm", "served_at": ["http://10.0.0.5:8000/v1"], "id": before}
    fields["models"][0] |= served | {"params": params}
    found = portable_manifest(one := Manifest.model_validate(fields))
    (model,) = found.models
    assert (model.id, model.fields()["params"], model.served_at) == (after, params, ())
    assert found.identity == one.identity
    line = record(outcome="api_error")
    line["error"] |= {"message": "POST http://10.0.0.5:8000/v1/chat: open '/scratch/bob/keys.txt'"}
    failed = bundle.portable(known_records().validate_python(line))
    assert json.loads(failed.as_json()) == {**line, "error": {**line["error"], "message": ""}}
    named = bundle.portable(known_records().validate_python(record(provider_model=before)))
    assert named.reply.provider_model == after


def test_a_bundle_that_is_killed_leaves_nothing_behind(made, tmp_path):
    """Killed once all is packed, before it is put in its place."""
    code = (
        "import os, signal, sys, phyblock.bundle as bundle\n"
        "from pathlib import Path\n"
        "bundle.files.write_named = lambda *_: os.kill(os.getpid(), signal.SIGKILL)\n"
        "bundle.bundle_run(Path(sys.argv[1]), Path(sys.argv[2]))\n"
    )
    for name in ("scratch", "out"):
        (tmp_path / name).mkdir()
    env = made.env | {"TMPDIR": str(tmp_path / "scratch")}
    command = [sys.executable, "-c", code, str(made.out), str(tmp_path / "out" / "b.zip")]
    assert subprocess.run(command, env=env, check=False).returncode == -signal.SIGKILL
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]
