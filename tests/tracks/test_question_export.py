from __future__ import annotations

import ast
import base64
import csv
import io
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from PIL import Image

from phyblock.data import QuestionSet, read_builtin, read_questions
from phyblock.domain import LETTERS, is_picture_option
from phyblock.errors import SpecError, StoreError
from phyblock.sim.pictures import PictureStyle
from phyblock.tracks.questions import QuestionPictures, export_questions
from tests.vqa_set import write_questions
from tests.workspace import Workspace


@pytest.fixture(scope="module")
def questions(tmp_path_factory: pytest.TempPathFactory) -> QuestionSet:
    root = tmp_path_factory.mktemp("export")
    scenes = read_builtin(Workspace(root, root / "pictures").write_scenes())
    return read_questions(write_questions(root / "questions"), scenes)


@pytest.fixture
def pictures(pictures_dir: Path) -> Iterator[QuestionPictures]:
    made = QuestionPictures(pictures_dir, PictureStyle(size_px=128), "images", shop=1)
    yield made
    made.close()


def rows_of(path: Path) -> list[dict[str, str]]:
    csv.field_size_limit(10**8)
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file, delimiter="\t"))


def test_tsv_files_are_as_vlmevalkit_reads_them(
    questions: QuestionSet, pictures: QuestionPictures, tmp_path: Path
) -> None:
    files = export_questions(questions.tasks, pictures, "vlmevalkit", tmp_path / "out")
    choice, ordering = (rows_of(file) for file in files)
    asked = {task.key: task.question for task in questions.tasks}
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
            with Image.open(io.BytesIO(base64.b64decode(data))) as picture:
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
    questions: QuestionSet, pictures: QuestionPictures, tmp_path: Path
) -> None:
    datasets = pytest.importorskip("datasets", reason="the package datasets is not installed")
    saved, parquet = export_questions(questions.tasks, pictures, "hf", tmp_path / "out")
    assert (saved, parquet) == (
        tmp_path / "out" / "dataset",
        tmp_path / "out" / "questions.parquet",
    )
    from_disk = datasets.load_from_disk(str(saved))
    loaded = datasets.load_dataset(
        str(tmp_path / "out"), cache_dir=str(tmp_path / "cache"), split="train"
    )
    for rows in (from_disk, loaded):
        assert rows["id"][:] == [task.key for task in questions.tasks]
        for row, task in zip(rows, questions.tasks, strict=True):
            assert row["answer"] == task.question.answer_letters
            assert row["options"] == list(task.question.options)
            assert [image.size for image in row["images"]] == [(128, 128)] * len(row["labels"])


def test_what_cannot_be_written_is_said(
    questions: QuestionSet,
    pictures: QuestionPictures,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(StoreError, match="cannot be written"):
        export_questions(questions.tasks, pictures, "vlmevalkit", tmp_path / "file" / "out")
    monkeypatch.setitem(sys.modules, "datasets", None)
    with pytest.raises(SpecError, match=r"phyblock\[hf\]"):
        export_questions(questions.tasks, pictures, "hf", tmp_path / "out")
