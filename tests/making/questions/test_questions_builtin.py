"""The built-in 2,200 questions: complete, even, about scenes that are there, derived again."""

from __future__ import annotations

import hashlib
import itertools
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from phyblock.data import QuestionSet, read_builtin, read_questions
from phyblock.data.questions import StoredQuestion
from phyblock.domain import LETTERS, SUBTASKS, Subtask
from phyblock.making.questions.audit import duplicates_of
from phyblock.making.questions.question_files import question_card
from phyblock.making.questions.question_production import (
    PER_SUBTASK,
    as_question,
    make_questions,
    problem_of,
    scene_drafts,
)
from phyblock.making.workers import open_workers
from phyblock.resources import bundled
from phyblock.sim.engine import other_engine
from phyblock.sim.question_pictures import mark_pixel

FOLDER = bundled("benchmarks", "data", "phyblock-vqa")
DATA = read_builtin(bundled("benchmarks", "data", "phyblock-400"))
SCENES = {task.scene.id: task.scene for task in DATA.tasks}
SEED = 0
"""That of the command in the set's card."""
SAMPLE = slice(7, None, 50)


@pytest.fixture(scope="module")
def built_in() -> QuestionSet:
    return read_questions(FOLDER, DATA)


def test_all_subtasks_are_whole(built_in: QuestionSet) -> None:
    assert Counter(task.question.subtask for task in built_in.tasks) == PER_SUBTASK
    assert len(built_in.tasks) == 2200
    assert not duplicates_of([task.question for task in built_in.tasks])


def test_every_letter_is_right_about_as_often(built_in: QuestionSet) -> None:
    for subtask in SUBTASKS:
        answers = [t.question.answer for t in built_in.tasks if t.question.subtask == subtask]
        if subtask == "OR":
            assert len(set(answers)) > 12
            continue
        shares = [answers.count((index,)) / len(answers) for index in range(len(LETTERS))]
        assert 0.22 <= min(shares) <= max(shares) <= 0.28


def test_the_files_are_those_of_the_checksums() -> None:
    for line in (FOLDER / "SHA256SUMS").read_text(encoding="utf-8").splitlines():
        digest, name = line.split("  ")
        assert hashlib.sha256((FOLDER / name).read_bytes()).hexdigest() == digest


def test_a_sample_of_the_answers_is_derived_again(built_in: QuestionSet) -> None:
    for task in built_in.tasks[SAMPLE]:
        assert problem_of(task.question) is None, task.key


def test_the_right_place_is_apart_from_the_others_as_often_as_any(built_in: QuestionSet) -> None:
    ranks: Counter[int] = Counter()
    for question in (t.question for t in built_in.tasks if t.question.subtask == "AD"):
        shown = question.pictures[0]
        places = np.array([mark_pixel(shown, mark.position_m) for mark in shown.marks])
        apart = np.linalg.norm(places[:, None] - places, axis=2).sum(axis=1)
        ranks[int((apart < apart[question.answer[0]]).sum())] += 1
    assert ranks.keys() == set(range(len(LETTERS)))
    assert max(ranks.values()) <= 17


def test_a_place_that_is_not_marked_is_found_out(built_in: QuestionSet) -> None:
    question = next(t.question for t in built_in.tasks if t.question.subtask == "AD")
    scene, block = question.pictures
    bare = replace(question, pictures=(replace(scene, marks=scene.marks[1:]), block))
    assert problem_of(bare) == "no place A is marked on a block"


@pytest.mark.slow
def test_all_answers_are_derived_again(built_in: QuestionSet) -> None:
    problems = {task.key: problem_of(task.question) for task in built_in.tasks}
    assert {key: problem for key, problem in problems.items() if problem} == {}


@pytest.mark.slow
def test_fifty_corrupted_answers_of_all_subtasks_are_found(built_in: QuestionSet) -> None:
    found = 0
    for number, task in enumerate(built_in.tasks[3::44]):
        question = task.question
        if question.subtask == "OR":
            wrong = (*question.answer[1:], question.answer[0])
        else:
            wrong = ((question.answer[0] + 1 + number % 3) % len(LETTERS),)
        found += problem_of(replace(question, answer=wrong)) is not None
    assert found == 50


@pytest.mark.slow
@pytest.mark.parametrize("subtask", ["CO", "SI", "OR"])
def test_a_subtask_made_by_the_command_of_the_card_has_the_same_bytes(subtask: Subtask) -> None:
    """Subtasks come out alike alone and with others; these three are the quickest."""
    wanted = {subtask: PER_SUBTASK[subtask]}
    with open_workers() as workers:
        made = list(make_questions(list(SCENES.values()), wanted, SEED, workers))
    lines = [StoredQuestion.of(one, SCENES[one.scene.id]).as_json() for one in made]
    assert lines == shipped_lines(subtask)


@pytest.mark.slow
@pytest.mark.skipif(bool(other_engine()), reason="the set is made with the default simulators")
@pytest.mark.parametrize("subtask", SUBTASKS)
def test_shipped_lines_are_among_those_that_their_scenes_give(
    built_in: QuestionSet, subtask: Subtask
) -> None:
    """A few of each subtask, of those too that take minutes to make whole."""
    lines = shipped_lines(subtask)
    asked = [task.question for task in built_in.tasks if task.question.subtask == subtask]
    for question, line in list(zip(asked, lines, strict=True))[9::40]:
        original = SCENES[question.scene.id]
        background = question.pictures[0].background
        assert background is not None
        made = (
            as_question(question.id, subtask, draft, places, background)
            for draft in scene_drafts((subtask, SEED, original))
            for places in itertools.permutations(range(len(LETTERS)))
        )
        assert line in (StoredQuestion.of(one, original).as_json() for one in made), question.id


def test_the_card_is_made_from_these_questions(built_in: QuestionSet) -> None:
    shipped = (FOLDER / "CARD.md").read_text(encoding="utf-8")
    made_by = shipped.split("\n\n    ", 1)[1].splitlines()[0]
    asked = [task.question for task in built_in.tasks]
    if not other_engine():
        assert question_card(FOLDER.name, "phyblock-400", asked, made_by) == shipped


def shipped_lines(subtask: Subtask) -> list[str]:
    text = (FOLDER / "questions.jsonl").read_text(encoding="utf-8")
    return [line for line in text.splitlines() if f'"subtask": "{subtask}"' in line]
