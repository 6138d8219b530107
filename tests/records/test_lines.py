"""Lines of data and of records: written again as they are, refused where they are damaged."""

import contextlib
import json
import os
import re
from pathlib import Path

import jsonschema
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from phyblock.data.questions import StoredQuestion
from phyblock.data.scenes import StoredScene
from phyblock.errors import DataError, StoreError
from phyblock.records import files
from phyblock.records.files import RecordLines, known_records, newest_starts
from phyblock.records.record import Reply, Usage, validated
from phyblock.results.load import load_run
from tests.data import broken
from tests.data.broken import DAMAGED, lines_before, sound_scene
from tests.documents import SCHEMAS
from tests.fuzz.strategies import sound_question
from tests.shipped import DATA, TASKS, built_in_questions
from tests.web.factory import JSON, manifest
from tests.workspace import problem_of

SCENES, QUESTIONS = (
    (DATA / name).read_text(encoding="utf-8").splitlines()
    for name in ("phyblock-400/scenes.jsonl", "phyblock-vqa/questions.jsonl")
)


def test_shipped_scenes_and_questions_are_written_byte_for_byte():
    assert [StoredScene.of(task.scene, task.candidates).as_json() for task in TASKS] == SCENES
    originals = {task.key: task.scene for task in TASKS}
    asked = (task.question for task in built_in_questions().tasks)
    written = [StoredQuestion.of(one, originals[one.scene.id]).as_json() for one in asked]
    assert written == QUESTIONS


@pytest.mark.parametrize(
    ("kind", "raw"), [(StoredScene, sound_scene()), (StoredQuestion, sound_question())]
)
def test_a_line_may_say_its_version_and_none_is_from_the_future(kind, raw):
    for line in (raw, {**raw, "format": 1}):
        assert json.loads(validated(kind, line, "here").as_json()) == line
    problem = problem_of(DataError, validated, kind, {**raw, "format": 2}, "here")
    assert (problem.field, problem.found, problem.allowed) == ("format", "2", "1")


def schema(name):
    return jsonschema.Draft202012Validator(
        json.loads((SCHEMAS / f"{name}.schema.json").read_text(encoding="utf-8"))
    )


SHIPPED = {"scene": SCENES[::25], "question": QUESTIONS[::25], "record": lines_before()}


@pytest.mark.parametrize("name", SHIPPED)
def test_the_schemas_take_what_is_shipped(name):
    found = schema(name)
    for line in SHIPPED[name]:
        found.validate(json.loads(line))


BROKEN = {
    "shape": ("scene", sound_scene(), "blocks.0.type", "ball"),
    "order": ("scene", sound_scene(), "blocks.0.order", 0),
    "position": ("scene", sound_scene(), "blocks.0.position", [0, 0]),
    "levels": ("scene", sound_scene(), "levels", [1, 3]),
    "no candidates": ("scene", sound_scene(), "candidates", []),
    "name": ("scene", sound_scene(), "id", "../x"),
    "view": ("question", sound_question(), "pictures.0.view", [45, 0]),
    "label": ("question", sound_question(), "pictures.0.label", "E"),
    "framed": ("question", sound_question(), "pictures.0.framed", False),
    "color": ("question", sound_question(), "colors.1", "pink"),
    "field": ("question", sound_question(), "pictures.0.widthout", [1]),
}


@pytest.mark.parametrize(("name", "raw", "at", "value"), BROKEN.values(), ids=BROKEN)
def test_the_schemas_refuse_what_the_models_refuse(name, raw, at, value):
    changed = broken.with_value(raw, at, value)
    assert schema(name).is_valid(raw)
    assert not schema(name).is_valid(changed)
    with pytest.raises(DataError):
        validated(StoredScene if name == "scene" else StoredQuestion, changed, "here")


numbers = st.none() | st.integers(-(10**40), 10**40)
amounts = st.none() | st.floats()


def folder_with(path, *held):
    """A run folder with these lines, of a run that they belong to."""
    suite = manifest(models=["random"], seeds=[0])
    (path / "run.yaml").write_text(yaml.safe_dump(suite), encoding="utf-8")
    (path / "records.jsonl").write_bytes(b"".join(line + b"\n" for line in held))
    return path


def whole(line):
    record = known_records().validate_json(line, strict=True)
    return json.dumps(record.fields(), ensure_ascii=False, separators=(",", ":")).encode()


@pytest.mark.parametrize("line", lines_before(), ids=["plan", "episode", "choice"])
def test_lines_of_the_first_version_are_written_again_byte_for_byte(line):
    assert whole(line) == line


@given(st.dictionaries(st.text("xyz", min_size=1, max_size=3), JSON, max_size=3))
def test_what_no_model_declares_is_kept(more):
    record = broken.plan_record() | more
    line = json.dumps(record, ensure_ascii=False, separators=(",", ":")).encode()
    assert whole(line) == line


@pytest.mark.parametrize("name", DAMAGED)
def test_a_damaged_line_is_named_with_its_field(tmp_path, name):
    line, field, says = DAMAGED[name]
    sound = lines_before()[0]
    problem = problem_of(StoreError, load_run, folder_with(tmp_path, sound, line, sound))
    assert problem.where.startswith(f"{tmp_path / 'records.jsonl'}:2")
    assert problem.message.startswith("is not a record")
    assert problem.hint
    assert says in str(problem)
    assert problem.field == field or not field


@given(st.binary(max_size=40), st.integers(0, 2469), st.integers(0, 40))
def test_any_bytes_are_read_or_refused(tmp_path_factory, noise, start, length):
    sound = lines_before()[0]
    damaged = sound[:start] + noise.replace(b"\n", b" ") + sound[start + length :]
    folder = folder_with(tmp_path_factory.mktemp("run"), damaged, sound)
    found = []
    with contextlib.suppress(StoreError):
        found += [record for _, record in RecordLines(folder)]
    assert len(found) in (0, 2)
    json.dumps([record.fields() for record in found], ensure_ascii=False).encode()


@pytest.mark.parametrize("name", ["deep", "many-digits", "word", "nan"])
def test_only_what_a_kill_cut_short_is_passed_over(tmp_path, name):
    folder = folder_with(tmp_path, lines_before()[0], DAMAGED[name][0])
    os.truncate(folder / "records.jsonl", (folder / "records.jsonl").stat().st_size - 1)
    with pytest.raises(StoreError, match=r"records\.jsonl:2"):
        list(RecordLines(folder))


def test_a_line_without_end_is_refused_and_not_taken_for_a_cut_one(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "_LONGEST_LINE_BYTES", 3000)
    folder = folder_with(tmp_path, lines_before()[0], b'"' + b"x" * 5000, lines_before()[0])
    found = RecordLines(folder)
    with pytest.raises(StoreError, match=r"records\.jsonl:2: is longer than"):
        list(found)
    assert not found.is_cut


@pytest.mark.parametrize("make", [os.mkfifo, Path.mkdir])
def test_what_is_no_file_is_refused(tmp_path, make):
    make(tmp_path / "records.jsonl")
    with pytest.raises(StoreError, match=r"is not a regular file|Is a directory"):
        list(RecordLines(tmp_path))


def test_a_sample_is_taken_from_its_last_line(tmp_path):
    first, last = lines_before()[0], broken.record_with("reply.text", "later")
    records = RecordLines(folder_with(tmp_path, first, last))
    starts = newest_starts(records)
    assert list(starts.values()) == [len(first) + 1]
    (newest,) = records.at(starts.values())
    assert newest.reply.text == "later"


@given(
    st.text(st.characters(exclude_categories=()), max_size=9), numbers, numbers, amounts, amounts
)
def test_whatever_was_paid_for_is_stored_and_read(text, sent, said, cost, billed):
    usage = Usage().model_copy(update={"prompt_tokens": sent, "completion_tokens": said})
    paid = {"text": text, "usage": usage, "cost_usd": cost, "billed_usd": billed}
    kept = Reply(text="").model_copy(update=paid).storable()
    again = Reply.model_validate_json(json.dumps(kept.fields()), strict=True)
    assert again == kept
    # Only what no file could hold is replaced, character for character.
    assert kept.text == re.sub("[\ud800-\udfff]", "\ufffd", text)
    assert kept.usage.completion_tokens in (said, None)
    assert kept.cost_usd in (cost, None)


@pytest.mark.parametrize("name", ["huge-number", "number-for-text", "word", "score", "track"])
def test_the_schema_refuses_damaged_records(name):
    assert not schema("record").is_valid(json.loads(DAMAGED[name][0]))
