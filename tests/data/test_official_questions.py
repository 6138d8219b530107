"""Question files in the official form: what is read, and how each fault is said."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from phyblock.data import Dataset, read_builtin, read_official_questions
from phyblock.errors import DataError
from tests.workspace import Raw, Workspace

COLOR: Raw = {
    "scene_id": "t1",
    "question": "What is the color of the block on top?",
    "options": ["red", "blue", "green", "yellow"],
    "answer": "B",
}
NEXT: Raw = {
    "scene_id": "t2",
    "question": "What comes next?",
    "options": ["<img1>", "<img2>", "<img3>", "<img4>"],
    "answer": "<img3>",
}


@pytest.fixture(scope="module")
def scenes(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    root = tmp_path_factory.mktemp("official")
    return read_builtin(Workspace(root, root / "pictures").write_scenes())


def write(folder: Path, name: str, content: Any) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    text = content if isinstance(content, str) else json.dumps(content, indent=2)
    (folder / name).write_text(text, encoding="utf-8")
    return folder


def draw(folder: Path, *names: str) -> None:
    for name in names:
        path = folder / "images" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        Image.new("RGB", (8, 8), "red").save(path)


def problems(folder: Path, scenes: Dataset) -> list[str]:
    with pytest.raises(DataError) as caught:
        read_official_questions(folder, scenes)
    return [str(problem) for problem in caught.value.problems]


def test_texts_pictures_and_orders_are_read(tmp_path: Path, scenes: Dataset) -> None:
    write(tmp_path, "color.json", [COLOR, {**COLOR, "id": "mine", "answer": "blue"}])
    write(tmp_path, "PD.json", [NEXT])
    write(tmp_path, "Ordering.json", [{**NEXT, "answer": "CABD"}])
    draw(tmp_path, *(f"pd-001/img{i}.png" for i in range(1, 5)), "t1.png")
    draw(tmp_path, *(f"or-001/img{i}.jpg" for i in range(1, 5)))
    found = {task.key: task for task in read_official_questions(tmp_path, scenes).tasks}
    assert {name: task.question.subtask for name, task in found.items()} == {
        "pd-001": "PD", "or-001": "OR", "co-001": "CO", "mine": "CO"
    }  # fmt: skip
    assert found["co-001"].question.answer_letters == "B" == found["mine"].question.answer_letters
    assert found["co-001"].files == {"scene": tmp_path / "images" / "t1.png"}
    assert found["co-001"].question.pictures == ()
    assert found["pd-001"].question.answer_letters == "C"
    assert list(found["pd-001"].files) == list("ABCD")
    assert [p.label for p in found["pd-001"].question.pictures] == ["scene"]
    assert found["or-001"].question.answer == (2, 0, 1, 3)
    assert found["or-001"].question.pictures == ()


@pytest.mark.parametrize(
    ("answers", "letters"),
    [
        ([0, 1, 2, 3], "ABCD"),
        ([4, 1, 1, 2], "DAAB"),
        (["a", "(B)", "C.", "yellow"], "ABCD"),
    ],
)
def test_letters_texts_and_indices_are_answers(
    tmp_path: Path, scenes: Dataset, answers: list[object], letters: str
) -> None:
    write(tmp_path, "CO.json", [{**COLOR, "answer": answer} for answer in answers])
    found = read_official_questions(tmp_path, scenes).tasks
    assert "".join(task.question.answer_letters for task in found) == letters


FAULTS = [
    ({"answer": "E"}, "answer: is none of the options"),
    ({"answer": "purple"}, "answer: is none of the options"),
    ({"answer": 2}, "answer: is none of the options"),
    ({"options": ["red", "blue", "Red", "green"]}, r"options[2]: is the same as option A"),
    ({"options": ["red", "blue"]}, "options: are not four"),
    ({"scene_id": "t9"}, "scene_id: names no scene of the data set"),
    ({"question": " "}, "question: is no text"),
    ({"options": NEXT["options"]}, "options: the file is missing"),
    ({"id": "co-001"}, "id: is used at"),
]


@pytest.mark.parametrize(("change", "message"), FAULTS)
def test_each_fault_is_one_error_with_file_and_place(
    tmp_path: Path, scenes: Dataset, change: Raw, message: str
) -> None:
    write(tmp_path, "CO.json", [COLOR, {**COLOR, **change}])
    (problem,) = problems(tmp_path, scenes)
    assert problem.startswith(f"{tmp_path / 'CO.json'}[1]: {message}")


def test_indices_that_do_not_tell_where_they_begin_are_refused(
    tmp_path: Path, scenes: Dataset
) -> None:
    write(tmp_path, "CO.json", [{**COLOR, "answer": n} for n in (1, 2)])
    found = problems(tmp_path, scenes)
    assert len(found) == 2
    assert all("whether they begin at 0" in problem for problem in found)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("CO.json", "{", "is not valid JSON"),
        ("CO.json", '{"scene_id": 1}', "is not an array"),
        ("CO.json", "[3]", "is not an object"),
        ("nonsense.json", [COLOR], "names no subtask"),
        ("CO.jsonl", "{}", "holds no question files"),
        ("CO.json", [1] * 50_000, "more than 1,000 faults"),
    ],
)
def test_files_that_are_no_questions_are_said(
    tmp_path: Path, scenes: Dataset, name: str, content: object, message: str
) -> None:
    write(tmp_path, name, content)
    assert any(message in problem for problem in problems(tmp_path, scenes))
