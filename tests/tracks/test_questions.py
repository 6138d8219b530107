"""The track of questions: selection, what is sent in which order, judging, baselines."""

import contextlib
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
from phyblock.sim.pictures import PictureStyle
from phyblock.sim.question_pictures import question_key
from phyblock.tracks import questions
from phyblock.tracks.questions import ChoiceSubject, Vqa
from tests.tracks.conftest import track_of
from tests.workspace import in_a_loop


def opened(found, shop, images=None, limit=None, **vqa):
    """The track on a set of questions that is in no file."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(questions, "open_questions", lambda *_: found)
        return track_of("vqa", shop=shop, images=images or {}, limit=limit, vqa=vqa)


@in_a_loop
async def ask(track):
    shown = [track.shown(item, 0) for item in track.items]
    return [await track.request(item, 0, {}, with_messages=True) for item in shown]


def test_the_answer_stands_in_no_message(question_set, shop):
    """Questions that differ in the right answer alone are asked alike."""

    def turned(task):
        answer = tuple((index + 1) % 4 for index in task.question.answer)
        return replace(task, question=replace(task.question, answer=answer))

    both = (question_set, replace(question_set, tasks=tuple(map(turned, question_set.tasks))))
    asked, again = (ask(opened(one, shop, blind=True)) for one in both)
    assert [r.messages for r in asked] == [r.messages for r in again]


@given(first=st.integers(0, 3), second=st.integers(0, 3), data=st.data())
def test_a_rotation_keeps_what_is_right_and_rotations_add_up(question_set, first, second, data):
    def right(question):
        """Return right options: pictures, places in the world, and words that name neither."""
        letters = [LETTERS[index] for index in question.answer]
        shown = {p.label: (p.blocks, p.view_deg) for p in question.pictures}
        shown |= {mark.letter: mark.position_m for p in question.pictures for mark in p.marks}
        words = dict(zip(LETTERS, question.options, strict=True))
        return [(words | shown)[letter] for letter in letters]

    question = data.draw(st.sampled_from(question_set.tasks)).question
    turned = rotated(question, first)
    assert right(turned) == right(question)
    assert rotated(turned, second) == rotated(question, (first + second) % 4)
    assert rotated(question, 0) == question


def test_questions_keep_their_background_unless_a_suite_gives_one(question_set):
    asked = next(task.question for task in question_set.tasks if task.key == "vp-000")
    lawn = replace(asked, pictures=tuple(replace(p, background="lawn") for p in asked.pictures))
    bare = [replace(picture, background=None) for picture in asked.pictures]
    grounds = ((asked, None, "checkerboard"), (lawn, None, "lawn"), (lawn, "white", "white"))
    for question, ground, wanted in grounds:
        style = PictureStyle(size_px=128, background=wanted)
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


def select(names, subtasks, limit):
    """The places of questions that are asked; a track that would ask none cannot be opened."""
    scenes = (Scene(f"s{number}", (number % 4 + 1,), (), ()) for number in range(len(names)))
    made = [
        Question(str(number), name, scene, "?", ("a", "b", "c", "d"), (0,))
        for number, (name, scene) in enumerate(zip(names, scenes, strict=True))
    ]
    with contextlib.suppress(SpecError):
        known = QuestionSet("drawn", Path(), tuple(map(QuestionTask, made)))
        track = opened(known, None, limit=limit, subtasks=subtasks)
        return [int(item.key) for item in track.items]
    return []


@given(
    st.lists(st.sampled_from(SUBTASKS[:4]), max_size=60),
    st.lists(st.sampled_from(SUBTASKS[:7]), min_size=1, unique=True),
    st.none() | st.integers(1, 40),
)
def test_no_more_than_wanted_of_each_and_in_all(names, subtasks, limit):
    chosen = select(names, subtasks, limit)
    assert {names[place] for place in chosen} <= {*subtasks}
    wanted = sum(map(names.count, subtasks))
    assert len(chosen) == min(wanted, limit or wanted)
    assert chosen == sorted({*chosen})
    # A higher limit asks all that a lower one asks.
    assert {*chosen} <= {*select(names, subtasks, limit and limit + 1)}
