"""Subtasks with simulation and several pictures: one right option, told apart, found again."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import pytest

from phyblock.data import read_builtin
from phyblock.data.questions import StoredQuestion
from phyblock.domain import LETTERS, Question, Subtask
from phyblock.domain.blocks import COLORS
from phyblock.domain.scene import Scene
from phyblock.making.questions.counterfactual import OUTCOME_TEXTS
from phyblock.making.questions.pictured_drafts import LEAST_PIXELS
from phyblock.making.questions.question_production import make_questions, problem_of
from phyblock.making.workers import open_workers
from phyblock.resources import bundled
from phyblock.sim.contact import find_gaps
from phyblock.sim.question_pictures import is_inside, least_difference, seen

DATA = read_builtin(bundled("benchmarks", "data", "phyblock-400"))
SCENES: dict[str, Scene] = {task.scene.id: task.scene for task in DATA.tasks}
ASKED: dict[Subtask, tuple[str, ...]] = {
    "VP": ("l1-008-table", "l2-018-monument", "l2-016-car", "l1-003-gate"),
    "CF": ("l1-003-gate", "l2-063-recolored", "l2-051-recolored"),
    "PD": ("l2-016-car", "l2-042-recolored"),
    "OR": ("l3-011-stair", "l3-022-slide"),
}
"""Scenes that are quick to ask about, small ones most of them."""
HANGS_M = 0.004
WANTED: dict[Subtask, int] = {"VP": 3, "CF": 3, "PD": 2, "OR": 2}


def made(jobs: int = 1) -> list[Question]:
    with open_workers(jobs) as workers:
        return [
            question
            for subtask, names in ASKED.items()
            for question in make_questions(
                [SCENES[name] for name in names], {subtask: WANTED[subtask]}, 0, workers
            )
        ]


@pytest.fixture(scope="module")
def questions() -> list[Question]:
    return made()


def test_every_answer_is_derived_again(questions: list[Question]) -> None:
    assert Counter(question.subtask for question in questions) == WANTED
    assert [problem_of(question) for question in questions] == [None] * len(questions)


def test_every_other_answer_is_found_out(questions: list[Question]) -> None:
    for question in questions:
        turned = question.answer[1:] + question.answer[:1]
        wrong = turned if len(turned) > 1 else ((turned[0] + 1) % len(LETTERS),)
        assert problem_of(replace(question, answer=wrong)) is not None


def test_pictures_of_options_are_whole_and_told_apart(questions: list[Question]) -> None:
    for question in questions:
        options = [picture for picture in question.pictures if picture.label in LETTERS]
        assert all(map(is_inside, question.pictures))
        if options:
            assert len(options) == len(LETTERS)
            assert least_difference([seen(option) for option in options]) >= LEAST_PIXELS


def test_pictures_of_stages_show_the_same_blocks(questions: list[Question]) -> None:
    """Nothing is larger or smaller for being early: one outline, two colors."""
    for question in [question for question in questions if question.subtask == "OR"]:
        shots = [seen(picture).block >= 0 for picture in question.pictures]
        assert all((shot == shots[0]).all() for shot in shots)
        for picture in question.pictures:
            assert len({block.color for block in picture.blocks}) == 2


def test_nothing_hangs_free_in_a_picture_of_what_follows(questions: list[Question]) -> None:
    for question in questions:
        if question.evidence["kind"] in ("cf-color", "pd-push", "pd-next"):
            for picture in question.pictures:
                assert find_gaps(picture.blocks, HANGS_M) == ()


def test_texts_of_outcomes_are_always_all_offered(questions: list[Question]) -> None:
    for question in questions:
        if question.evidence["kind"] == "cf-count":
            assert sorted(question.options) == sorted(OUTCOME_TEXTS)


@pytest.fixture(scope="module")
def colored(questions: list[Question]) -> list[Question]:
    """Those about removals whose options are colored."""
    return [question for question in questions if question.evidence["kind"] == "cf-color"]


def test_options_in_colors_show_one_structure(colored: list[Question]) -> None:
    """Nothing is missing or moved in any of them."""
    assert colored
    for question in colored:
        places = {
            tuple((b.order, b.position_m, b.euler_deg) for b in picture.blocks)
            for picture in question.pictures
        }
        assert len(places) == 1
        assert len({tuple(b.color for b in one.blocks) for one in question.pictures}) == 5


def test_a_color_that_no_text_names_is_found_out(colored: list[Question]) -> None:
    question = colored[0]
    unnamed = next(color for color in COLORS if color not in question.evidence["slots"].values())
    first = question.pictures[1]
    block = next(b for b in first.blocks if b.order != question.evidence["removed"])
    strange = replace(block, color=unnamed)
    blocks = tuple(strange if one is block else one for one in first.blocks)
    pictures = (question.pictures[0], replace(first, blocks=blocks), *question.pictures[2:])
    found = problem_of(replace(question, pictures=pictures))
    assert found == "picture A shows other colors than the text names"


def test_a_changed_picture_is_found_out(questions: list[Question]) -> None:
    """The right picture put in a wrong one's place: two options are right, or none."""
    matching = next(q for q in questions if q.evidence["kind"] == "vp-match")
    right = matching.pictures[1 + matching.answer[0]]
    copied = [
        replace(right, label=picture.label) if picture.label in LETTERS else picture
        for picture in matching.pictures
    ]
    found = problem_of(replace(matching, pictures=tuple(copied)))
    assert found == "4 of 4 options are right"


@pytest.mark.slow
def test_two_processes_give_the_same_bytes(questions: list[Question]) -> None:
    lines = [StoredQuestion.of(q, SCENES[q.scene.id]).as_json() for q in questions]
    assert [StoredQuestion.of(q, SCENES[q.scene.id]).as_json() for q in made(jobs=2)] == lines


@pytest.mark.slow
def test_places_are_marked_of_which_one_holds() -> None:
    scenes = [task.scene for task in DATA.tasks][83::50]
    with open_workers(1) as workers:
        question = next(iter(make_questions(scenes, {"AD": 1}, 0, workers)))
    assert [mark.letter for mark in question.pictures[0].marks] == list(LETTERS)
    assert problem_of(question) is None
    wrong = ((question.answer[0] + 1) % len(LETTERS),)
    assert problem_of(replace(question, answer=wrong)) is not None
