"""Questions in the formats of other frameworks, as these read them."""

from __future__ import annotations

import ast
import base64
import csv
import io
from pathlib import Path

import pytest
from PIL import Image as PillowImage

from phyblock.data import Dataset, QuestionSet, read_builtin, read_questions
from phyblock.domain import LETTERS, is_picture_option
from phyblock.results.questions_export import export_questions
from tests.vqa_set import write_questions
from tests.workspace import Workspace


@pytest.fixture(scope="module")
def scenes(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    root = tmp_path_factory.mktemp("scenes")
    return read_builtin(Workspace(root, root / "pictures").write_scenes())


@pytest.fixture(scope="module")
def question_set(tmp_path_factory: pytest.TempPathFactory, scenes: Dataset) -> QuestionSet:
    return read_questions(write_questions(tmp_path_factory.mktemp("vqa") / "q"), scenes)


def rows_of(path: Path) -> list[dict[str, str]]:
    csv.field_size_limit(10**8)
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file, delimiter="\t"))


def test_tsv_files_are_as_vlmevalkit_reads_them(
    question_set: QuestionSet, scenes: Dataset, tmp_path: Path
) -> None:
    out, asked_of = tmp_path / "out", str(question_set.root)
    files = export_questions("vlmevalkit", out, asked_of, scenes, None, 128)
    choice, ordering = (rows_of(file) for file in files)
    asked = {task.key: task.question for task in question_set.tasks}
    assert {row["index"] for row in (*choice, *ordering)} == set(asked)
    assert len(choice) + len(ordering) == len(asked)
    for row in (*choice, *ordering):
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
                assert picture.size == (128, 128)
        for letter, option in zip(LETTERS, question.options, strict=True):
            if is_picture_option(option):
                place = int(row[letter].removeprefix("Picture ")) - 1
                assert names[place] == f"{question.id}-{letter}.png"
            else:
                assert row[letter] == option
    assert all(len(row["answer"]) == 1 for row in choice)
    assert all(len(row["answer"]) == 4 for row in ordering)


def test_a_hugging_face_dataset_has_questions_and_pictures(
    question_set: QuestionSet, scenes: Dataset, tmp_path: Path
) -> None:
    datasets = pytest.importorskip("datasets", reason="the package datasets is not installed")
    out, asked_of = tmp_path / "out", str(question_set.root)
    saved, parquet = export_questions("hf", out, asked_of, scenes, None, 128)
    assert (saved, parquet) == (out / "dataset", out / "questions.parquet")
    from_disk = datasets.load_from_disk(str(saved))
    loaded = datasets.load_dataset(
        str(tmp_path / "out"), cache_dir=str(tmp_path / "cache"), split="train"
    )
    for rows in (from_disk, loaded):
        assert rows["id"][:] == [task.key for task in question_set.tasks]
        for row, task in zip(rows, question_set.tasks, strict=True):
            assert row["answer"] == task.question.answer_letters
            assert row["options"] == list(task.question.options)
            assert [image.size for image in row["images"]] == [(128, 128)] * len(row["labels"])
