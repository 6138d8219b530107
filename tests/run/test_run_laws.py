"""Laws of runs: what must not matter does not, what is stored is enough, one process a folder."""

import errno
import hashlib
import json
import os
import random
import shutil
import subprocess
import sys
import threading
from collections import Counter
from contextlib import closing
from functools import partial
from pathlib import Path
from unittest import mock

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

import phyblock
from phyblock.data.base import VERSION_FILE, read_version
from phyblock.errors import DataError, SpecError, StoreError
from phyblock.records import files
from phyblock.records.files import read_manifest, read_prompts
from phyblock.records.record import Call, Reply
from phyblock.results.compare import check_pair, compare
from phyblock.results.estimates import Headline
from phyblock.results.load import load_run
from phyblock.run.store import AppendFile, Progress, RunStore
from tests.servers.chassis import Running
from tests.servers.openai_chat import OpenAIChat
from tests.web.factory import manifest, run_of
from tests.workspace import call, until

lines = st.dictionaries(st.text(max_size=5), st.text(max_size=5) | st.integers(), max_size=4)
cents = st.integers(0, 8)
samples = st.sampled_from(["s/1", "s/2", ""])
calls = st.tuples(samples, st.sampled_from("ab"), cents, st.booleans(), st.none() | cents)


@pytest.fixture(scope="module")
def finished(new_workspace):
    made = new_workspace()
    with made.served(OpenAIChat(), models=["alpha", "random", "oracle"], seeds=[0, 1, 2]):
        made.completed()
    return made


@pytest.fixture
def copy(finished, tmp_path):
    return finished.copied(tmp_path / "copy")


def scores(records):
    return {r["sample"]: {k: r[k] for k in ("outcome", "parse", "scores")} for r in records}


def texts_of(workspace):
    return {r["sample"]: (r["reply"] or {}).get("text") for r in workspace.records()}


def test_tables_follow_from_the_records_byte_for_byte(copy):
    path, tables = copy.out / "records.jsonl", copy.tables()
    kept = path.read_bytes(), (copy.out / "run.yaml").read_bytes()
    copy.does("score", "out", "--jobs", "1", fresh=True)
    assert (path.read_bytes(), (copy.out / "run.yaml").read_bytes()) == kept
    assert copy.tables() == tables
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    random.Random(3).shuffle(lines)
    path.write_text("".join(lines), encoding="utf-8")
    # Tables alone are made anew, in a process of another hash seed; then without the data.
    shutil.rmtree(copy.out / "tables")
    copy.completed(fresh=True)
    assert copy.tables() == tables
    shutil.rmtree(copy.out / "tables")
    (copy.root / "data").rename(copy.root / "elsewhere")
    copy.does("report", "out")
    assert copy.tables() == tables


def test_cached_replies_are_worth_the_same_and_other_rules_score_them_without_a_call(copy):
    # The server is gone: whatever is answered comes from the cache.
    first = scores(copy.records())
    whole, copy.out = copy.out, copy.root / "cached"
    said = copy.completed().out
    asked = [record for record in copy.records() if record["model"] == "alpha"]
    assert f"{len(asked)} came from the reply cache" in said
    assert {(r["reply"]["cached"], r["reply"]["attempts"]) for r in asked} == {(True, 0)}
    assert scores(copy.records()) == first
    cached, tables = copy.tables(), copy.tables(whole)
    for name in ("estimates.csv", "errors.csv", "errors.tex", "table1.csv", "table1.tex"):
        assert cached[name] == tables[name]
    texts = texts_of(copy)
    copy.out = copy.root / "official"
    copy.completed("--set", "parser=official", "--set", "scoring.matchers=[paper]")
    assert texts_of(copy) == texts
    assert {record["parse"]["parser"] for record in copy.records()} == {"official"}
    assert all(r["reply"]["cached"] for r in copy.records() if r["model"] == "alpha")
    assert "matcher paper" in copy.tables()["table1.tex"].decode()


def test_without_the_cache_it_is_neither_read_nor_written(copy):
    first = scores(copy.records())
    before = (copy.cache / "replies.sqlite").read_bytes()
    copy.out = copy.root / "uncached"
    with Running(OpenAIChat()) as running:
        copy.write_models(running.url, "alpha")
        assert "in the cache" not in copy.completed("--no-cache").out
        assert running.server.requests == 15
    assert scores(copy.records()) == first
    assert (copy.cache / "replies.sqlite").read_bytes() == before


def test_a_cut_last_line_is_dropped_and_its_sample_run_again(copy):
    path = copy.out / "records.jsonl"
    whole = path.read_bytes()
    path.write_bytes(whole[:-30])
    copy.completed()
    assert len(copy.records()) == 45
    assert path.read_bytes().startswith(whole[:-30].rpartition(b"\n")[0])
    assert load_run(copy.out).records["sample"].is_unique


def test_a_second_process_is_refused_and_the_first_goes_on(workspace):
    with workspace.served(OpenAIChat(holds=True)) as server:
        with workspace.start() as first:
            until(lambda: server.at_once)
            assert "out: is being written by another phyblock run" in workspace.refused()
            server.holds = False
            out, err = first.communicate()
        assert (first.returncode, err) == (0, "")
        assert "All 5 samples are done" in out
        assert server.requests == 5


def test_only_what_may_change_a_reply_makes_another_run(copy):
    labels = {"size_b": 7, "published": "GPT-4o", "price": {"input": 1.0, "output": 2.0}}
    copy.write_models("http://127.0.0.1:9", "alpha", transport="litellm", **labels)
    sets = ("--set", "limits.max_concurrency=1", "--set", "description=x")
    assert "All 45 samples are done" in copy.completed(*sets).out
    copy.write_models("http://127.0.0.1:9", "alpha", temperature=0.5)
    copy.completed("--models", "oracle")
    assert "found: different: models.alpha.params" in copy.refused("--models", "alpha")


@pytest.mark.parametrize("order", ["file", "shuffled"])
def test_more_models_and_seeds_go_on_in_the_folder_and_fewer_select_from_it(workspace, order):
    workspace.write_suite(models=["random"], seeds=[1, 0], candidates={"order": order})
    workspace.completed()
    before, lines = workspace.tables(), workspace.records()
    more = ("--models", "oracle,random", "--set", "seeds=[0,1,2]")
    assert "All 30 samples are done" in workspace.completed(*more).out
    assert workspace.records()[: len(lines)] == lines
    whole = workspace.tables()
    fewer = ("--set", "seeds=[0,1]", "--set", "settings=[B,A]", "--set", "name=x")
    said = workspace.completed(*fewer).out
    assert "All 10 samples are done" in said
    assert "Kept, but not shown: records of oracle. Name them with --models." in said
    for words in (["run", "suite.yaml", "--out", "out", "--no-report"], ["score", "out"]):
        workspace.does(*words)
        assert before.items() <= workspace.tables().items()
    assert "All 30 samples are done" in workspace.completed(*more).out
    assert len(workspace.records()) == 30
    assert workspace.tables() == whole


def test_a_folder_that_holds_no_record_is_free_for_the_mended_suite(workspace):
    template = workspace.root / "mine.j2"
    template.write_text("{% block user %}{{ wrong }}{% endblock %}", encoding="utf-8")
    with workspace.served(OpenAIChat(), prompt="mine.j2"):
        workspace.refused()
        template.write_text("{% block user %}right{% endblock %}", encoding="utf-8")
        workspace.completed()


@pytest.mark.parametrize("track", ["full_planning", "step_planning"])
def test_baselines_need_no_replies_kept_and_nothing_is_drawn_for_them(workspace, track):
    (workspace.cache / "replies.sqlite").mkdir()
    (workspace.cache / "pictures").unlink()
    workspace.write_suite(models=["random", "oracle"], tracks=[track])
    workspace.completed()
    found = Counter((record["outcome"], record["prompt"]) for record in workspace.records())
    assert found == {("ok", None): 10}
    assert not (workspace.cache / "pictures").exists()
    # What the pictures would be is a part of what the run is all the same.
    facts = yaml.safe_load((workspace.out / "run.yaml").read_text())
    assert len(facts["tracks"][track]["pictures"]) == 64


@pytest.mark.parametrize("text", ["", "0", "two", "-1", "1.5", "1" * 7, "²"])
def test_what_is_no_version_is_refused(tmp_path, text):
    (tmp_path / VERSION_FILE).write_text(text, encoding="utf-8")
    with pytest.raises(DataError, match=r"VERSION: holds no version\n.*\n.*whole number from 1"):
        read_version(tmp_path)


def test_runs_on_two_versions_are_not_mixed(workspace):
    workspace.write_suite(levels=[1])
    workspace.completed()
    workspace.completed()
    (workspace.root / "data" / VERSION_FILE).write_text("2\n", encoding="utf-8")
    assert "dataset.version (1, now 2)" in workspace.refused()
    older, workspace.out = workspace.out, workspace.root / "newer"
    workspace.completed()
    assert [read_manifest(path).dataset.version for path in (older, workspace.out)] == [1, 2]
    with pytest.raises(SpecError, match=r"dataset\.version: cannot be compared"):
        compare(load_run(older), load_run(workspace.out), ["oracle"])


def test_answers_to_two_versions_of_questions_are_not_mixed():
    runs = [run_of([], manifest(tracks={"vqa": {"questions": digest}})) for digest in "ab"]
    with pytest.raises(SpecError, match=r"tracks.vqa.questions: cannot be .*\n.*found: b"):
        check_pair(runs[1], runs[0], [], "vqa", Headline(runs[0], "vqa").measure)


def test_scores_can_be_made_where_the_data_set_has_moved(copy):
    shutil.move(copy.root / "data", copy.root / "moved")
    manifest = copy.out / "run.yaml"
    lost = manifest.read_text(encoding="utf-8").replace("root: ", "root: /nowhere")
    manifest.write_text(lost, encoding="utf-8")
    assert copy.phyblock("score", "out", "--jobs", "1").code == 2
    copy.does("score", "out", "--jobs", "1", "--data", "moved")


# The files of a run folder: appended whole, read whole, each prompt once.


@given(st.lists(st.lists(lines, max_size=3), max_size=5))
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
    for work in (partial(file.append, [{"a": 2}]), file.check):
        with pytest.raises(StoreError, match="was removed, replaced or changed"):
            work()
    file.close()
    assert (path.read_bytes() if path.exists() else None) == left


@pytest.mark.parametrize("name", ["RecordLines", "CallLines", "PromptLines", "BatchLines"])
@pytest.mark.parametrize("line", [b"\0" * 40, b"\0" * 40 + b"\n", b"{}\r\n"])
def test_zero_bytes_and_foreign_line_ends_are_named(tmp_path, name, line):
    read = getattr(files, name)(tmp_path)
    read.path.write_bytes(line)
    said = "CR LF" if b"\r" in line else "zero bytes"
    with pytest.raises(StoreError, match=rf"\.jsonl:1: is not a {read.noun}: it .*{said}"):
        list(read)


@pytest.mark.parametrize("call", ["fstat", "write", "fsync"])
def test_a_disk_that_fails_at_any_call_leaves_what_was_written(tmp_path, call):
    file = AppendFile(tmp_path / "lines.jsonl")
    file.append([{"a": 1}])

    # No disk here fails so on demand; one over a network does.
    gone = OSError(errno.ESTALE, os.strerror(errno.ESTALE))
    with (
        mock.patch.object(os, call, side_effect=gone),
        pytest.raises(StoreError, match="Stale file handle"),
    ):
        file.append([{"a": 2}])
    assert (tmp_path / "lines.jsonl").read_text() == '{"a":1}\n'
    file.append([{"a": 3}])
    file.close()
    assert (tmp_path / "lines.jsonl").read_text() == '{"a":1}\n{"a":3}\n'


def test_a_run_is_on_disk_with_its_name_before_anything_is_asked(workspace, monkeypatch):
    workspace.write_suite(models=["oracle"])
    plan = workspace.plan(None)
    synced, fsync = [], os.fsync

    def notes(number):
        names = {path.name for path in workspace.out.iterdir()}
        synced.append((os.readlink(f"/proc/self/fd/{number}"), names))
        fsync(number)

    monkeypatch.setattr(os, "fsync", notes)
    with closing(RunStore(workspace.out, plan.manifest, plan.sample_ids())) as store:
        (manifest, _), (folder, there) = synced
        found = (manifest.endswith(".part"), folder, "run.yaml" in there)
        assert found == (True, str(workspace.out), True)
        store.records.append([{"a": 1}])
        store.records.append([{"a": 2}])
    assert [path for path, _ in synced[2:]] == [folder] + [f"{folder}/records.jsonl"] * 2


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
    found = (progress.calls, len(progress.unanswered), progress.limit_usd)
    assert found == (len(calls), unanswered, expected)
    assert progress.unanswered_text.startswith(f"{unanswered} call" if unanswered else "")


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


# The path of one sample: the modules that it goes through, and those it imports.

ROOT = Path(phyblock.__file__).parent
IMPORTED = """
import atexit, sys
from phyblock.cli.main import main
names = lambda: [name for name in sys.modules if name.partition(".")[0] == "phyblock"]
atexit.register(lambda: print("modules", *names(), file=sys.stderr))
main()
"""


def test_one_sample_goes_through_few_modules(inside):
    """From the arrival of the second request to that of the third: the end of one sample and the
    beginning of the next, in every thread.
    """
    inside.write_suite(models=["alpha"], levels=[2, 3], settings=["A"])
    entered = set()

    def profile(frame, event, _):
        if event == "call" and len(server.seen) == 2:
            entered.add(frame.f_code.co_filename)

    with Running(server := OpenAIChat()) as running:
        inside.write_models(running.url, "alpha", max_concurrency=1)
        threading.setprofile(profile)
        sys.setprofile(profile)
        try:
            call("run", "suite.yaml", "--out", "out")
        finally:
            sys.setprofile(None)
            threading.setprofile(None)
    assert server.requests == 4
    modules = {Path(name).relative_to(ROOT) for name in entered if name.startswith(str(ROOT))}
    assert Path("models/model.py") in modules
    assert len(modules) <= 20, " ".join(sorted(map(str, modules)))


def test_one_sample_of_a_baseline_imports_few_modules(workspace):
    workspace.write_suite(models=["random"], levels=[2], settings=["A"])
    command = [sys.executable, "-c", IMPORTED, "run", "suite.yaml", "--limit", "1", "--out", "out"]
    options = {"capture_output": True, "text": True, "check": True}
    done = subprocess.run(command, cwd=workspace.root, env=workspace.env, **options)
    modules = done.stderr.rpartition("modules ")[2].split()
    assert "phyblock.tracks.full_planning" in modules
    assert len(modules) <= 100, sorted(modules)
