"""Static subtasks: sound, even, the same in any processes, and found when they are corrupted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.data import read_builtin, read_questions
from phyblock.data.questions import StoredQuestion
from phyblock.domain import LETTERS, Question, Scene, Subtask
from phyblock.errors import DataError, StoreError
from phyblock.making.questions.audit import referents
from phyblock.making.questions.picture_view import ELEVATIONS_DEG, NAMED
from phyblock.making.questions.question_files import check_place, write_questions
from phyblock.making.questions.question_production import (
    MAKERS,
    PER_SUBTASK,
    make_questions,
    problem_of,
)
from phyblock.making.questions.selection import BALANCE, even_letters
from phyblock.making.questions.wording import WORDINGS
from phyblock.making.workers import open_workers
from phyblock.resources import bundled
from phyblock.types import BACKGROUNDS

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


@given(st.integers(0, 200), st.integers(0, 2**32 - 1))
def test_every_letter_is_right_about_as_often(count: int, seed: int) -> None:
    letters = Counter(even_letters(count, np.random.default_rng(seed)))
    assert letters.total() == count
    for index in range(len(LETTERS)):
        # In hundredths, since 0.28 of 150 is no whole number in floating point.
        low, high = (round(100 * share) * count for share in BALANCE)
        assert low // 100 <= letters[index] <= -(-high // 100)


def test_views_and_backgrounds_are_drawn_for_each_question(questions: list[Question]) -> None:
    views = [question.pictures[0].view_deg for question in questions]
    assert len({azimuth // 30 for azimuth, _ in views}) == 12
    assert all(low <= elevation <= high for _, elevation in views for low, high in [ELEVATIONS_DEG])
    assert Counter(q.pictures[0].background for q in questions).keys() == set(BACKGROUNDS)


def test_named_blocks_show_in_the_picture_of_the_question(questions: list[Question]) -> None:
    shown = [share for question in questions for share in referents(question).values()]
    assert len(shown) > len(questions)
    assert min(shown) >= NAMED


def test_what_depends_on_the_view_is_told_for_the_view() -> None:
    """Seen from the other side, in front is behind and left is right."""
    # Stored ones: which are drawn anew, and how many, is another matter on another Python.
    stored = read_questions(bundled("benchmarks", "data", "phyblock-vqa"), DATA).tasks
    corners = [task.question for task in stored if task.question.wording.startswith("rp-corner")]
    problems = [str(problem_of(_from_behind(question))) for question in corners]
    # From behind a block that is named may hide; where none does, another answer is right.
    others = ["the answer is" in problem for problem in problems]
    hidden = ["less than 40% of themselves" in problem for problem in problems]
    assert [one != other for one, other in zip(others, hidden, strict=True)] == [True] * len(
        problems
    )
    assert sum(others) > len(others) / 2


def _from_behind(question: Question) -> Question:
    (picture,) = question.pictures
    azimuth, elevation = picture.view_deg
    behind = replace(picture, view_deg=((azimuth + 180) % 360, elevation))
    return replace(question, pictures=(behind,))


def test_scenes_are_counted_over_in_a_dozen_wordings_and_more() -> None:
    wordings = Counter(name.split("-")[0] for name in WORDINGS)
    for subtask in ("oc", "lc", "tc", "vp"):
        assert wordings[subtask] >= 12


def test_heights_are_asked_for_above_the_ground() -> None:
    for name, template in WORDINGS.items():
        if any(word in template for word in ("high", "low")) and name.startswith("rp-"):
            assert "ground" in template or "same height" in template or "Leave heights" in template
            assert "picture" not in template or "Leave heights" in template


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
        if "-all-" in question.wording:
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
    assert [line.split("  ")[1] for line in sums] == [
        "CARD.md",
        "questions.jsonl",
        "VERSION",
    ]
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


def test_too_few_scenes_are_told_for_all_subtasks_at_once() -> None:
    """Before any is drafted, where no scene could give so many; else when all were drafted."""
    with pytest.raises(DataError) as told:
        made(SCENES[:1], ("OC", "OR", "AD"))
    assert [problem.where for problem in told.value.problems] == ["OR", "AD"]
    with pytest.raises(DataError, match="OC: the scenes give no more than") as told:
        made(SCENES[:1], ("OC", "CO", "NU"))
    short = [problem.where for problem in told.value.problems]
    assert "OC" in short
    assert len(short) > 1


def test_colors_are_drawn_where_the_kit_would_tell(questions: list[Question]) -> None:
    originals = {scene.id: scene for scene in SCENES}
    recolored = Counter(
        q.subtask
        for q in questions
        if "colors" in StoredQuestion.of(q, originals[q.scene.id]).fields()
    )
    for subtask in ("SH", "CO", "SI"):
        assert recolored[subtask] == COUNT
    assert recolored["NU"] == 0


def test_wordings_are_templates_with_their_slots() -> None:
    for name, template in WORDINGS.items():
        subtask = name.split("-")[0].upper()
        assert subtask in MAKERS
        assert template[-1] in "?."
