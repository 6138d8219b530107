"""Runs and questions in the formats of other tools, as these read them."""

import ast
import base64
import csv
import io
import json
from itertools import product

import pandas as pd
import pytest
from PIL import Image as PillowImage

from phyblock.domain.question import LETTERS, is_picture_option
from phyblock.integrations import files
from phyblock.results.load import load_run
from phyblock.results.tables import export_frame, write_csv
from tests.web.factory import LEVELS, asked, manifest, record, score, write_run
from tests.workspace import csv_rows, write_lines


@pytest.fixture
def folder(tmp_path):
    records = []
    for (place, scene), seed in product(enumerate(LEVELS), (0, 1)):
        scores = [score(place, 1, 1), score(place, 0, 1, setting="B")]
        records.append(record("alpha", scene, seed, scores, prompt_tokens=100))
    records[0]["prompt"] = {"template": "x", "version": "1", "images": [], "messages": "d1"}
    records[1] = record("alpha", "000", 1, [score(0, 0, 4)], outcome="missing")
    records += [asked(1, "SH", "A", 0), asked(1, "SH", "B", 1)]
    records.append(record("beta", "000", 0, outcome="api_error"))
    facts = manifest(suite={"tracks": ["full_planning", "vqa"]})
    made = write_run(tmp_path / "run", records, facts)
    prompt = {"role": "user", "parts": ["Look at", {"image": "goal"}]}
    write_lines(made / "prompts.jsonl", [{"sha256": "d1", "messages": [prompt]}])
    return made


def test_rows_hold_what_was_asked_answered_and_counted(folder):
    frame = export_frame(load_run(folder)).set_index("sample")
    assert len(frame) == 13
    wanted = {"tp_a": 2, "fp_a": 1, "fn_a": 1, "tp_b": 2, "plan": [1], "prompt_tokens": 100}
    wanted["reply"] = "Move block with index 1"
    assert frame.loc["full_planning/alpha/002/s0", [*wanted]].to_dict() == wanted
    assert frame.loc["full_planning/alpha/000/s0", "prompt"] == "Look at\n[picture: goal]"
    assert pd.isna(frame.loc["full_planning/alpha/000/s1", "reply"])
    answer = frame.loc["vqa/alpha/sh-1/s1", ["question_subtask", "answer_given"]]
    assert answer.tolist() == ["SH", "B"]
    assert frame.loc["full_planning/beta/000/s0", "error"] == "busy"


def test_csv_parquet_and_datasets_come_back_as_the_same_rows(folder, tmp_path):
    run = load_run(folder)
    frame, (csv,) = export_frame(run), write_csv(run, tmp_path)
    parquet, _ = files.write_parquet(tmp_path / "hf", "records", frame)
    from_csv, from_parquet = pd.read_csv(csv), pd.read_parquet(parquet)
    assert from_csv["sample"].tolist() == from_parquet["sample"].tolist()
    assert from_csv["tp_a"].fillna(-1).tolist() == from_parquet["tp_a"].fillna(-1).tolist()
    assert json.loads(from_csv["levels"][0]) == list(from_parquet["levels"][0]) == [1, 2]
    rows = loaded(parquet, tmp_path, "train")
    assert rows.column_names == list(frame.columns)
    assert rows["sample"][:] == frame["sample"].tolist()
    assert (rows["levels"][0], rows["tp_a"][2:4]) == ([1, 2], [1, 1])
    assert (rows["tp_a"][-3:], rows["answer_correct"][-2:]) == ([None] * 3, [True, False])


def loaded(parquet, folder, split):
    """The rows of a file as the package datasets reads them."""
    datasets = pytest.importorskip("datasets", reason="the package datasets is not installed")
    cache = str(folder / "cache")
    return datasets.load_dataset(str(parquet.parent), cache_dir=cache, split=split)


def test_a_tsv_file_is_as_vlmevalkit_reads_it(question_set, towers, tmp_path):
    out, asked_of = tmp_path / "out", str(question_set.root)
    (file,) = files.write_vlmevalkit(out, asked_of, str(towers.root), None)
    csv.field_size_limit(10**8)
    rows = csv_rows(file, delimiter="\t")
    asked = {task.key: task.question for task in question_set.tasks}
    # Its multiple choice cannot score an order.
    choices = [key for key, question in asked.items() if len(question.answer) == 1]
    assert [row["index"] for row in rows] == choices
    assert len(choices) < len(asked)
    for row in rows:
        question = asked[row["index"]]
        assert row["answer"] == question.answer_letters
        assert (row["category"], row["l2-category"]) == (question.subtask, question.category)
        # VLMEvalKit takes lists in brackets apart, and anything else for one picture.
        several = row["image"].startswith("[")
        coded = ast.literal_eval(row["image"]) if several else [row["image"]]
        names = ast.literal_eval(row["image_path"]) if several else [row["image_path"]]
        assert len(coded) == len(names) == len(question.pictures)
        assert len(set(names)) == len(names)
        for data in coded:
            assert len(data) > 64
            with PillowImage.open(io.BytesIO(base64.b64decode(data))) as picture:
                assert picture.size == (512, 512)
        for letter, option in zip(LETTERS, question.options, strict=True):
            if is_picture_option(option):
                place = int(row[letter].removeprefix("Picture ")) - 1
                assert names[place] == f"{question.id}-{letter}.png"
            else:
                assert row[letter] == option


def test_a_hugging_face_dataset_has_questions_scenes_and_pictures(question_set, towers, tmp_path):
    out, asked_of = tmp_path / "questions", str(question_set.root)
    parquet, _ = files.write_questions(out, asked_of, str(towers.root), None)
    rows = loaded(parquet, tmp_path, "test")
    assert rows["id"][:] == [task.key for task in question_set.tasks]
    for row, task in zip(rows, question_set.tasks, strict=True):
        assert row["answer"] == task.question.answer_letters
        assert row["options"] == list(task.question.options)
        assert [image.size for image in row["images"]] == [(512, 512)] * len(row["labels"])
    parquet, card = files.write_scenes(tmp_path / "scenes", str(towers.root), None)
    rows = loaded(parquet, tmp_path, "test")
    assert "configs:" in card.read_text("utf-8")
    assert [json.loads(one)["id"] for one in rows["scene"]] == rows["id"][:]
    assert len(rows) == len((towers.root / "scenes.jsonl").read_text("utf-8").splitlines())
    assert {rows[0][name].size for name in ("goal", "candidates")} == {(512, 512)}
