"""The track of questions: selection, what is sent in which order, judging, baselines."""

import contextlib
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.data.base import QuestionSet, QuestionTask
from phyblock.domain.question import LETTERS, SUBTASKS, Question, rotated
from phyblock.domain.scene import Scene
from phyblock.errors import SpecError
from phyblock.models.request import Image
from phyblock.sim.pictures import PictureStyle
from phyblock.sim.question_pictures import question_key
from phyblock.tracks import questions
from phyblock.tracks.questions import ChoiceSubject, Vqa
from tests.tracks.conftest import track_of
from tests.workspace import in_a_loop

STYLE = PictureStyle(size_px=128)
OPTIONS = ("cube", "arch", "cylinder", "cuboid")


def opened(found, shop, images=None, limit=None, **vqa):
    """The track on a set of questions that is in no file."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(questions, "open_questions", lambda *_: found)
        return track_of("vqa", shop=shop, images=images or {}, limit=limit, vqa=vqa)


@in_a_loop
async def ask(track, *keys, seed=0):
    items = [item for item in track.items if not keys or item.key in keys]
    shown = [track.shown(item, seed) for item in items]
    return [await track.request(item, seed, {}, with_messages=True) for item in shown]


def images(request):
    return [part for part in request.messages[-1].parts if isinstance(part, Image)]


def test_the_answer_stands_in_no_message(question_set, shop):
    """Questions that differ in the right answer alone are asked alike."""
    turned = []
    for task in question_set.tasks:
        answer = tuple((index + 1) % 4 for index in task.question.answer)
        turned.append(replace(task, question=replace(task.question, answer=answer)))
    rules = {"blind": True}
    asked = ask(opened(question_set, shop, **rules))
    again = ask(opened(QuestionSet("some", question_set.root, tuple(turned)), shop, **rules))
    assert [r.messages for r in asked] == [r.messages for r in again]


@given(first=st.integers(0, 3), second=st.integers(0, 3), data=st.data())
def test_a_rotation_keeps_what_is_right_and_rotations_add_up(question_set, first, second, data):
    question = data.draw(st.sampled_from(question_set.tasks)).question
    turned = rotated(question, first)
    for before, after in zip(question.answer, turned.answer, strict=True):
        assert _meaning(turned, after) == _meaning(question, before)
    assert rotated(turned, second) == rotated(question, (first + second) % 4)
    assert rotated(question, 0) == question


def _meaning(question, index):
    """Return an option: its picture, its place in the world, or its words."""
    letter = LETTERS[index]
    for picture in question.pictures:
        if picture.label == letter:
            return picture.blocks, picture.view_deg
        for mark in picture.marks:
            if mark.letter == letter:
                return mark.position_m
    return question.options[index]


def test_questions_keep_their_background_unless_a_suite_gives_one(question_set):
    asked = next(task.question for task in question_set.tasks if task.key == "vp-000")
    lawn = replace(asked, pictures=tuple(replace(p, background="lawn") for p in asked.pictures))
    bare = [replace(picture, background=None) for picture in asked.pictures]
    for question, ground, wanted in (
        (asked, None, "checkerboard"), (lawn, None, "lawn"), (lawn, "white", "white"),
    ):  # fmt: skip
        style = replace(STYLE, background=wanted)
        found = QuestionSet("one", question_set.root, (QuestionTask(question),))
        track = opened(found, None, {"background": ground})
        drawn = track.draw(track.items[0])
        assert [one.key for one in drawn] == [question_key(picture, style) for picture in bare]


def test_random_answers_are_spread_over_all_that_can_be_given_and_read(question_set):
    rng, found, track = np.random.default_rng(0), {}, opened(question_set, None)
    for item in track.items:
        # A reply that cannot be read is wrong.
        bad, right = track.judge(item, "I cannot tell."), item.question.answer_letters
        assert (bad.is_read, bad.fields["answer"]["given"]) == (False, None)
        assert track.judge(item, f"Answer: {right}").fields["answer"]["correct"]
        subject = ChoiceSubject(item.question, lambda: (0,))
        found[item.question.subtask] = {Vqa.baselines["random"](subject, rng) for _ in range(300)}
    sizes = {len(texts) for name, texts in found.items() if name != "OR"}
    assert (sizes, len(found["OR"])) == ({4}, 24)


def task_of(number, subtask):
    scene = Scene(f"s{number}", (number % 4 + 1,), (), ())
    question = Question(f"q{number}", subtask, scene, "?", ("a", "b", "c", "d"), (0,))
    return QuestionTask(question)


tasks = st.lists(st.sampled_from(SUBTASKS[:4]), max_size=60).map(
    lambda names: [task_of(number, name) for number, name in enumerate(names)]
)
some = st.lists(st.sampled_from(SUBTASKS[:7]), min_size=1, unique=True)


def select(found, subtasks, limit):
    """The questions that are asked; a track that would ask none cannot be opened."""
    with contextlib.suppress(SpecError):
        known = QuestionSet("drawn", Path(), tuple(found))
        track = opened(known, None, limit=limit, subtasks=subtasks)
        return [item.task for item in track.items]
    return []


@given(tasks, some, st.none() | st.integers(1, 40))
def test_no_more_than_wanted_of_each_and_in_all(given_tasks, subtasks, limit):
    chosen = select(given_tasks, subtasks, limit)
    found = Counter(one.question.subtask for one in given_tasks)
    counts = Counter(one.question.subtask for one in chosen)
    most = {name: found[name] for name in subtasks}
    assert all(counts[name] <= most.get(name, 0) for name in SUBTASKS)
    assert len(chosen) == min(sum(most.values()), limit or sum(most.values()))
    positions = [given_tasks.index(one) for one in chosen]
    assert positions == sorted(set(positions))
    # A higher limit asks all that a lower one asks.
    more = select(given_tasks, subtasks, limit and limit + 1)
    assert {one.key for one in chosen} <= {one.key for one in more}
