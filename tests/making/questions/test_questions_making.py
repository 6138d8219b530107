"""Static subtasks: sound, even, the same in any processes, and found when they are corrupted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from phyblock.datasets import read_builtin, read_questions
from phyblock.domain import LETTERS, Question, Scene, Subtask
from phyblock.errors import DataError, StoreError
from phyblock.records.question import StoredQuestion
from phyblock.resources import bundled
from phyblock_making.questions.makers import MAKERS
from phyblock_making.questions.question_files import check_place, write_questions
from phyblock_making.questions.question_production import PER_SUBTASK, make_questions
from phyblock_making.questions.rederiving import problem_of
from phyblock_making.questions.wording import WORDINGS
from phyblock_making.workers import open_workers

DATA = read_builtin(bundled("benchmarks", "data", "phyblock-400"))
SCENES = tuple(task.scene for task in DATA.tasks)[3::20]
STATIC: tuple[Subtask, ...] = ("SH", "CO", "SI", "NU", "RP", "AP", "RD", "RR", "OC", "LC", "TC")
COUNT = 8


def made(
    scenes: Sequence[Scene], subtasks: Sequence[Subtask], seed: int = 0, jobs: int = 1
) -> list[Question]:
    with open_workers(jobs) as workers:
        return list(make_questions(scenes, dict.fromkeys(subtasks, COUNT), seed, workers))


@pytest.fixture(scope="module")
def questions() -> list[Question]:
    return made(SCENES, STATIC)


def test_there_are_2200_questions_in_16_subtasks() -> None:
    assert sum(PER_SUBTASK.values()) == 2200
    assert set(PER_SUBTASK) == set(MAKERS)


def test_every_answer_is_derived_again(questions: list[Question]) -> None:
    assert Counter(q.subtask for q in questions) == dict.fromkeys(STATIC, COUNT)
    assert [problem_of(question) for question in questions] == [None] * len(questions)


def test_letters_are_dealt_evenly(questions: list[Question]) -> None:
    for subtask in STATIC:
        letters = Counter(q.answer_letters for q in questions if q.subtask == subtask)
        assert letters == dict.fromkeys(LETTERS, COUNT // 4)


def test_no_question_stands_twice(questions: list[Question]) -> None:
    told = [(q.scene, q.text, frozenset(q.options)) for q in questions]
    assert len(set(told)) == len(told)
    assert len({question.id for question in questions}) == len(questions)


def test_fifty_corrupted_answers_are_found(questions: list[Question]) -> None:
    spoiled = [replace(q, answer=((q.answer[0] + 1 + i % 3) % 4,)) for i, q in enumerate(questions)]
    assert len(spoiled) > 50
    problems = [problem_of(question) for question in spoiled[:50]]
    assert all(problem is not None and "the answer is" in problem for problem in problems)


def test_a_text_or_a_scene_that_was_changed_is_found(questions: list[Question]) -> None:
    for question in questions:
        worded = replace(question, text=question.text.replace("the ", "a "))
        if worded.text != question.text:
            assert problem_of(worded) is not None
    for question in questions:
        if question.subtask in ("OC", "LC", "TC"):
            fewer = question.scene.blocks[:1]
            picture = replace(question.pictures[0], blocks=fewer)
            assert problem_of(replace(question, pictures=(picture,))) is not None


def test_options_without_the_right_one_are_found(questions: list[Question]) -> None:
    for question in questions:
        options = list(question.options)
        options[question.answer[0]] = "the purple ball"
        assert problem_of(replace(question, options=tuple(options))) is not None


def test_lines_read_back_as_the_questions(questions: list[Question], tmp_path: Path) -> None:
    originals = {scene.id: scene for scene in SCENES}
    write_questions(tmp_path / "q", questions, originals, "phyblock-400", "phyblock vqa generate")
    read = [task.question for task in read_questions(tmp_path / "q", DATA).tasks]
    assert read == questions
    sums = (tmp_path / "q" / "SHA256SUMS").read_text(encoding="utf-8").splitlines()
    assert [line.split("  ")[1] for line in sums] == ["CARD.md", "questions.jsonl"]
    card = (tmp_path / "q" / "CARD.md").read_text(encoding="utf-8")
    assert f"| TC | type counting | {COUNT} |" in card
    with pytest.raises(StoreError, match="holds questions already"):
        check_place(tmp_path / "q", replace=False)


def test_the_processes_change_nothing_and_the_seed_does() -> None:
    originals = {scene.id: scene for scene in SCENES}

    def lines(seed: int, jobs: int) -> list[str]:
        found = made(SCENES[:12], ("CO", "RP"), seed, jobs)
        return [
            StoredQuestion.of(question, originals[question.scene.id]).as_json()
            for question in found
        ]

    assert lines(1, 1) == lines(1, 2) != lines(2, 1)


def test_too_few_scenes_are_told() -> None:
    with pytest.raises(DataError, match="OC: the scenes give no more than"):
        made(SCENES[:3], ("OC",))


def test_colors_are_drawn_where_the_kit_would_tell(questions: list[Question]) -> None:
    originals = {scene.id: scene for scene in SCENES}
    recolored = Counter(
        q.subtask
        for q in questions
        if "colors" in StoredQuestion.of(q, originals[q.scene.id]).fields()
    )
    for subtask in ("SH", "CO", "SI"):
        assert recolored[subtask] == COUNT
    for subtask in ("NU", "OC", "LC", "TC"):
        assert recolored[subtask] == 0


def test_wordings_are_templates_with_their_slots() -> None:
    for name, template in WORDINGS.items():
        subtask = name.split("-")[0].upper()
        assert subtask in MAKERS
        assert template[-1] in "?."
