"""The files of a run folder: appended whole, read whole, each prompt once."""

import errno
import hashlib
import json
import os
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.config.suite import load_suite
from phyblock.errors import StoreError
from phyblock.records.files import BatchLines, CallLines, PromptLines, RecordLines, read_prompts
from phyblock.records.record import Call, Reply
from phyblock.run.plan import make_plan
from phyblock.run.store import AppendFile, Progress, RunStore
from tests.servers.openai_chat import OpenAIChat

values = st.dictionaries(st.text(max_size=5), st.text(max_size=5) | st.integers(), max_size=4)


@given(st.lists(st.lists(values, max_size=3), max_size=5))
def test_what_is_appended_is_what_is_read(tmp_path_factory, batches):
    path = tmp_path_factory.mktemp("files") / "lines.jsonl"
    file = AppendFile(path)
    for batch in batches:
        file.append(batch)
    file.close()
    lines = path.read_bytes().splitlines() if path.exists() else []
    assert [json.loads(line) for line in lines] == [line for batch in batches for line in batch]


CHANGES = {
    "removed": Path.unlink,
    "truncated": lambda path: path.write_bytes(b""),
    "replaced": lambda path: (path.rename(f"{path}.old"), path.write_bytes(b'{"a":1}\n')),
    "grown": lambda path: path.write_bytes(path.read_bytes() * 2),
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_file_that_somebody_changes_meanwhile_is_not_written_on(tmp_path, change):
    path = tmp_path / "records.jsonl"
    file = AppendFile(path)
    file.append([{"a": 1}])
    file.check()
    CHANGES[change](path)
    left = path.read_bytes() if path.exists() else None
    with pytest.raises(StoreError, match="was removed, replaced or changed"):
        file.append([{"a": 2}])
    with pytest.raises(StoreError, match="was removed, replaced or changed"):
        file.check()
    file.close()
    assert (path.read_bytes() if path.exists() else None) == left


@pytest.mark.parametrize("lines", [RecordLines, CallLines, PromptLines, BatchLines])
@pytest.mark.parametrize(
    ("line", "said"),
    [(b"\0" * 40, "zero bytes"), (b"\0" * 40 + b"\n", "zero bytes"), (b"{}\r\n", "CR LF")],
)
def test_zero_bytes_and_foreign_line_ends_are_named(tmp_path, lines, line, said):
    read = lines(tmp_path)
    read.path.write_bytes(line)
    with pytest.raises(StoreError, match=rf"\.jsonl:1: is not a {read.noun}: it .*{said}"):
        list(read)


@pytest.mark.parametrize("call", ["fstat", "write", "fsync"])
def test_a_disk_that_fails_at_any_call_leaves_what_was_written(tmp_path, monkeypatch, call):
    file = AppendFile(tmp_path / "lines.jsonl")
    file.append([{"a": 1}])

    def fail(*_):
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


def test_a_run_is_on_disk_with_its_name_before_anything_is_asked(workspace, monkeypatch):
    workspace.write_suite(models=["oracle"])
    plan = make_plan(load_suite(workspace.root / "suite.yaml"), {})
    synced = []
    fsync = os.fsync

    def notes(number):
        names = {path.name for path in workspace.out.iterdir()}
        synced.append((os.readlink(f"/proc/self/fd/{number}"), names))
        fsync(number)

    monkeypatch.setattr(os, "fsync", notes)
    with closing(RunStore(workspace.out, plan.manifest, plan.sample_ids())) as store:
        (manifest, _), (folder, there) = synced
        assert manifest.endswith(".part")
        assert folder == str(workspace.out)
        assert "run.yaml" in there
        store.records.append([{"a": 1}])
        store.records.append([{"a": 2}])
    assert [path for path, _ in synced[2:]] == [folder] + [f"{folder}/records.jsonl"] * 2


cents = st.integers(0, 8)
samples = st.sampled_from(["s/1", "s/2", ""])
calls = st.tuples(samples, st.sampled_from("ab"), cents, st.booleans(), st.none() | cents)


@given(st.lists(calls, max_size=12))
def test_a_limit_counts_every_call_once_and_one_without_an_end_in_full(calls):
    progress, expected = Progress(), 0.0
    for number, (sample, model, most, is_ended, billed) in enumerate(calls):
        names = {"call": number, "model": model, "sample": sample, "key": f"k{number}", "run": "r"}
        line = Call(**names, most_usd=most)
        progress.add_call(line)
        if is_ended:
            reply = Reply(text=f"{number}")
            ended = {"ended": True, "billed_usd": billed, "reply": reply}
            progress.add_call(line.model_copy(update=ended))
            assert progress.replies[f"k{number}"] == reply
        expected += (billed or 0) if is_ended else most
    unanswered = sum(not call[3] for call in calls)
    assert progress.calls == len(calls)
    assert len(progress.unanswered) == unanswered
    assert progress.unanswered_text.startswith(f"{unanswered} call" if unanswered else "")
    assert progress.limit_usd == expected


def test_every_record_names_a_prompt_that_is_there(workspace):
    with workspace.served(OpenAIChat(), models=["alpha", "oracle"]):
        workspace.completed()
    prompts = read_prompts(workspace.out)
    sent = {record["prompt"]["messages"] for record in workspace.records() if record["prompt"]}
    assert sent == set(prompts) != set()
    for digest, messages in prompts.items():
        fields = [message.fields() for message in messages]
        canonical = json.dumps(fields, sort_keys=True, separators=(",", ":"))
        assert hashlib.sha256(canonical.encode()).hexdigest() == digest


def test_tables_and_page_are_made_again_where_records_are_newer_or_they_are_not_there(workspace):
    workspace.write_suite()
    estimates = workspace.out / "tables" / "estimates.csv"

    def is_made(*, page=False):
        before = estimates.stat().st_mtime_ns if estimates.exists() else 0
        workspace.completed(page=page)
        return estimates.stat().st_mtime_ns != before

    assert is_made()
    assert not is_made()
    assert is_made(page=True)
    assert not is_made(page=True)
    assert not is_made()
    (workspace.out / "report.html").unlink()
    assert is_made(page=True)
    records = workspace.out / "records.jsonl"
    records.write_bytes(records.read_bytes() + records.read_bytes().splitlines(True)[-1])
    assert is_made(page=True)
