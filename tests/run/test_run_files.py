"""The files of a run folder: appended whole, read whole, each prompt once."""

from __future__ import annotations

import errno
import hashlib
import json
import os
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.config.models import ModelConfig
from phyblock.config.suite import load_suite
from phyblock.errors import StoreError
from phyblock.models import Image, Message
from phyblock.records.files import PromptLines, TurnLines, collect_turns
from phyblock.records.manifest import Manifest
from phyblock.run.plan import make_plan
from phyblock.run.store import AppendFile, PromptFile, RunStore, read_prompts
from tests.servers.chassis import Running
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import Workspace

REPLY = {
    "text": "Move(1)",
    "usage": {"prompt_tokens": 1, "completion_tokens": None},
    "cost_usd": None,
    "cached": False,
}
values = st.dictionaries(st.text(max_size=5), st.text(max_size=5) | st.integers(), max_size=4)


@given(st.lists(st.lists(values, max_size=3), max_size=5))
def test_what_is_appended_is_what_is_read(
    tmp_path_factory: pytest.TempPathFactory, batches: list[list[dict[str, Any]]]
) -> None:
    path = tmp_path_factory.mktemp("files") / "lines.jsonl"
    file = AppendFile(path)
    for batch in batches:
        file.append(batch)
    file.close()
    lines = path.read_bytes().splitlines() if path.exists() else []
    assert [json.loads(line) for line in lines] == [line for batch in batches for line in batch]


def test_a_full_disk_is_an_error_that_leaves_whole_lines() -> None:
    file = AppendFile(Path("/dev/full"))
    with pytest.raises(StoreError, match="No space left on device"):
        file.append([{"a": 1}])
    file.close()


@pytest.mark.parametrize("call", ["fstat", "write", "fsync"])
def test_a_disk_that_fails_at_any_call_leaves_what_was_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: str
) -> None:
    file = AppendFile(tmp_path / "lines.jsonl")
    file.append([{"a": 1}])

    def fail(*_: object) -> None:
        raise OSError(errno.ESTALE, os.strerror(errno.ESTALE))

    with monkeypatch.context() as patch:
        # No disk here fails so on demand; one over a network does.
        patch.setattr(os, call, fail)
        with pytest.raises(StoreError, match="Stale file handle"):
            file.append([{"a": 2}])
    assert (tmp_path / "lines.jsonl").read_text() == '{"a":1}\n'
    file.append([{"a": 3}])
    file.close()
    assert (tmp_path / "lines.jsonl").read_text() == '{"a":1}\n{"a":3}\n'


GROUPED: dict[str, ModelConfig] = {
    "b": ModelConfig(id="x/b", groups=("all",), image_detail="low"),
    "a": ModelConfig(id="x/a", groups=("all",)),
}


def test_a_run_of_a_group_is_the_run_of_its_models(workspace: Workspace) -> None:
    def manifest(models: list[str], *only: str) -> Manifest:
        workspace.write_suite(models=models)
        loaded = load_suite(workspace.root / "suite.yaml", data_dir=workspace.root)
        return make_plan(loaded, GROUPED, only=only).manifest

    plain = manifest(["oracle", "b", "a"])
    for grouped in (manifest(["oracle", "group:all"]), manifest(["oracle"], "oracle", "group:all")):
        assert grouped.identity == plain.identity
        assert [model.name for model in grouped.models] == ["oracle", "b", "a"]
    assert manifest(["oracle", "group:all"]).suite["models"] == ["oracle", "b", "a"]
    told = [model.model_extra or {} for model in plain.models]
    assert [extra.get("image_detail") for extra in told] == [None, "low", None]


def test_a_run_is_on_disk_with_its_name_before_anything_is_asked(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    workspace.write_suite(models=["oracle"])
    plan = make_plan(load_suite(workspace.root / "suite.yaml", data_dir=workspace.root), {})
    synced: list[tuple[str, set[str]]] = []
    fsync = os.fsync

    def notes(number: int) -> None:
        names = {path.name for path in workspace.out.iterdir()}
        synced.append((os.readlink(f"/proc/self/fd/{number}"), names))
        fsync(number)

    monkeypatch.setattr(os, "fsync", notes)
    with RunStore(workspace.out, plan.manifest, plan.sample_ids()) as store:
        (manifest, _), (folder, there) = synced
        assert manifest.endswith(".part")
        assert folder == str(workspace.out)
        assert "run.yaml" in there
        store.records.append([{"a": 1}])
        store.records.append([{"a": 2}])
    assert [path for path, _ in synced[2:]] == [folder] + [f"{folder}/records.jsonl"] * 2


def turn_lines(folder: Path, *numbers: int) -> None:
    lines = [{"sample": "s", "turn": n, "reply": {**REPLY, "text": f"Move({n})"}} for n in numbers]
    text = "".join(json.dumps(line) + "\n" for line in lines)
    (folder / "turns.jsonl").write_text(text, encoding="utf-8")


def test_turns_are_read_in_their_order_and_a_later_line_counts(tmp_path: Path) -> None:
    turn_lines(tmp_path, 0, 1, 0, 2)
    assert [turn.reply.text for turn in collect_turns(TurnLines(tmp_path))["s"]] == [
        "Move(0)",
        "Move(1)",
        "Move(2)",
    ]


def test_turns_of_samples_that_are_done_are_left_on_disk(tmp_path: Path) -> None:
    turn_lines(tmp_path, 0, 2)
    assert collect_turns(TurnLines(tmp_path), {"s"}) == {}


def test_a_turn_that_is_missing_is_an_error_at_the_next(tmp_path: Path) -> None:
    turn_lines(tmp_path, 0, 2)
    with pytest.raises(StoreError, match="is turn 2 of a sample of which 1"):
        collect_turns(TurnLines(tmp_path))


def test_a_turn_that_a_kill_cut_short_is_not_there(tmp_path: Path) -> None:
    turn_lines(tmp_path, 0, 1)
    path = tmp_path / "turns.jsonl"
    path.write_bytes(path.read_bytes()[:-9])
    lines = TurnLines(tmp_path)
    assert len(list(lines)) == 1
    assert lines.is_cut
    assert len(collect_turns(TurnLines(tmp_path))["s"]) == 1


def test_a_prompt_is_kept_once_without_its_pictures(tmp_path: Path) -> None:
    picture = Image(b"\x89PNG secret", "goal", 8, 8)
    messages = (Message("system", ("Be brief.",)), Message("user", (picture, "Which?")))
    path = tmp_path / "prompts.jsonl"
    for _ in range(2):
        known = {line.sha256 for _, line in PromptLines(tmp_path)}
        file = AppendFile(path)
        prompts = PromptFile(file, known)
        digests = {prompts.keep(messages) for _ in range(3)}
        file.close()
    (digest,) = digests
    assert len(path.read_text(encoding="utf-8").splitlines()) == 1
    assert "secret" not in path.read_text(encoding="utf-8")
    assert [message.fields() for message in read_prompts(tmp_path)[digest]] == [
        {"role": "system", "parts": ("Be brief.",)},
        {"role": "user", "parts": ({"image": "goal"}, "Which?")},
    ]


def test_every_record_names_a_prompt_that_is_there(tmp_path: Path, pictures_dir: Path) -> None:
    made = Workspace(tmp_path, pictures_dir)
    made.write_scenes()
    made.write_suite(models=["alpha", "oracle"])
    with Running(OpenAIChat()) as running:
        made.write_models(running.url, "alpha")
        assert made.run().code == 0
    prompts = read_prompts(made.out)
    sent = {record["prompt"]["messages"] for record in made.records() if record["prompt"]}
    assert sent == set(prompts) != set()
    for digest, messages in prompts.items():
        fields = [message.fields() for message in messages]
        canonical = json.dumps(fields, sort_keys=True, separators=(",", ":"))
        assert hashlib.sha256(canonical.encode()).hexdigest() == digest
    assert not (made.out / "turns.jsonl").exists()


@pytest.mark.parametrize("name", ["turns.jsonl", "prompts.jsonl"])
@pytest.mark.parametrize("stands_there", ["pipe", "device"])
def test_what_is_no_file_is_not_waited_for(
    workspace: Workspace, name: str, stands_there: str
) -> None:
    path = workspace.root / name
    if stands_there == "pipe":
        os.mkfifo(path)
    else:
        path.symlink_to("/dev/zero")
    lines = {"turns": TurnLines, "prompts": PromptLines}[path.stem]
    with pytest.raises(StoreError, match="is not a regular file"):
        list(lines(workspace.root))
