"""The VQA track: what is sent of a question, in which order; rotated, blind, wrong pictures."""

from __future__ import annotations

import asyncio
import io
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image as PillowImage

from phyblock.data import QuestionSet, QuestionTask, read_builtin, read_questions
from phyblock.domain import LETTERS, Question
from phyblock.domain.question import rotated
from phyblock.errors import DataError, SpecError
from phyblock.models.request import Image, Request
from phyblock.resources import bundled
from phyblock.sim.pictures import PictureStyle
from phyblock.sim.question_pictures import question_key, question_png
from phyblock.tracks import TemplatePrompt
from phyblock.tracks.questions import ChoiceSubject, QuestionPictures, ShownQuestion, Vqa, VqaRules
from tests.vqa_set import write_questions
from tests.workspace import Workspace

STYLE = PictureStyle(size_px=128)


@pytest.fixture(scope="module")
def question_set(tmp_path_factory: pytest.TempPathFactory) -> QuestionSet:
    root = tmp_path_factory.mktemp("vqa")
    scenes = read_builtin(Workspace(root, root / "pictures").write_scenes())
    return read_questions(write_questions(root / "questions"), scenes)


def track_of(
    found: QuestionSet, folder: Path, rules: VqaRules, tasks: Sequence[QuestionTask] | None = None
) -> Vqa:
    pictures = QuestionPictures(folder, STYLE, rules.options_as, shop=1)
    prompt = TemplatePrompt(bundled("prompts", "vqa.j2"), "default")
    return Vqa(rules, found, found.tasks if tasks is None else tasks, prompt, pictures)


def ask(track: Vqa, *keys: str, seed: int = 0) -> list[Request]:
    async def all_of_them() -> list[Request]:
        items = [item for item in track.items if not keys or item.key in keys]
        return [await track.request(item, seed, {}, with_messages=True) for item in items]

    try:
        return asyncio.run(all_of_them())
    finally:
        track.close()


def user_parts(request: Request) -> tuple[str | Image, ...]:
    return request.messages[-1].parts


def images(request: Request) -> list[Image]:
    return [part for part in user_parts(request) if isinstance(part, Image)]


def text_of(request: Request) -> str:
    last = user_parts(request)[-1]
    assert isinstance(last, str)
    return last


@pytest.fixture(scope="module")
def pictures_of_vqa(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("pictures")


def test_every_picture_is_announced_and_sent_in_order(
    question_set: QuestionSet, pictures_of_vqa: Path
) -> None:
    track = track_of(question_set, pictures_of_vqa, VqaRules())
    names = ("sh-000", "ad-000", "vp-000", "or-000")
    asked = {request.key: request for request in ask(track, *names)}
    requests = [asked[name] for name in names]
    captions = [
        [part for part in user_parts(request)[:-1] if isinstance(part, str)] for request in requests
    ]
    assert captions == [
        ["Picture:"],
        ["First picture:", "Second picture, one block by itself:"],
        ["First picture:", "Picture A:", "Picture B:", "Picture C:", "Picture D:"],
        ["Picture A:", "Picture B:", "Picture C:", "Picture D:"],
    ]
    for request in requests:
        subject = request.subject
        assert isinstance(subject, ChoiceSubject)
        recipes = {picture.label: picture for picture in subject.question.pictures}
        for image in images(request):
            assert image.data == question_png(recipes[image.label], STYLE)
        parts = user_parts(request)[:-1]
        assert [isinstance(part, str) for part in parts] == [True, False] * (len(parts) // 2)


def test_the_text_says_question_options_and_form(
    question_set: QuestionSet, pictures_of_vqa: Path
) -> None:
    track = track_of(question_set, pictures_of_vqa, VqaRules(blind=True))
    requests = {request.key: request for request in ask(track)}
    for key, request in requests.items():
        subject = request.subject
        assert isinstance(subject, ChoiceSubject)
        text = text_of(request)
        assert f"Question: {subject.question.text}" in text
        assert "\n\n\n" not in text
        asked_form = "Answer: W, X, Y, Z" if key.startswith("or") else "Answer: X"
        assert asked_form in text.splitlines()
        if "<img1>" in subject.question.options:
            assert "<img" not in text
            assert "the pictures A, B, C and D." in text
        else:
            for letter, option in zip(LETTERS, subject.question.options, strict=True):
                assert f"{letter}. {option}" in text.splitlines()


def test_the_answer_stands_in_no_message(question_set: QuestionSet, pictures_of_vqa: Path) -> None:
    """Questions that differ in the right answer alone are asked alike."""
    turned = [
        replace(task, question=replace(task.question, answer=_other(task.question.answer)))
        for task in question_set.tasks
    ]
    rules = VqaRules(blind=True)
    asked = ask(track_of(question_set, pictures_of_vqa, rules))
    again = ask(track_of(question_set, pictures_of_vqa, rules, turned))
    assert [r.messages for r in asked] == [r.messages for r in again]


def _other(answer: tuple[int, ...]) -> tuple[int, ...]:
    return tuple((index + 1) % 4 for index in answer)


def test_blind_sends_no_picture(question_set: QuestionSet, pictures_of_vqa: Path) -> None:
    requests = ask(track_of(question_set, pictures_of_vqa, VqaRules(blind=True)))
    assert len(requests) == len(question_set.tasks)
    assert all(len(user_parts(request)) == 1 for request in requests)
    assert all("not available" in text_of(request) for request in requests)


def test_options_on_one_sheet(question_set: QuestionSet, pictures_of_vqa: Path) -> None:
    rules = VqaRules(options_as="letters")
    (request,) = ask(track_of(question_set, pictures_of_vqa, rules), "vp-000")
    scene, sheet = images(request)
    assert (scene.label, sheet.label) == ("scene", "options")
    subject = request.subject
    assert isinstance(subject, ChoiceSubject)
    with PillowImage.open(io.BytesIO(sheet.data)) as opened:
        whole = np.asarray(opened.convert("RGB"), dtype=np.int16)
    side = STYLE.size_px
    assert whole.shape[:2] == (sheet.height_px, sheet.width_px) == (2 * side + 2, 2 * side + 2)
    recipes = {picture.label: picture for picture in subject.question.pictures}
    for place, letter in enumerate(LETTERS):
        row, column = divmod(place, 2)
        cell = whole[row * (side + 2) :, column * (side + 2) :][:side, :side]
        with PillowImage.open(io.BytesIO(question_png(recipes[letter], STYLE))) as alone:
            lone = np.asarray(alone.convert("RGB"), dtype=np.int16)
        assert (cell[side // 4 :] == lone[side // 4 :]).all()
        assert (cell[: side // 8, : side // 8] != lone[: side // 8, : side // 8]).any()


def test_circular_asks_every_rotation_and_moves_pictures_with_their_letters(
    question_set: QuestionSet, pictures_of_vqa: Path
) -> None:
    track = track_of(question_set, pictures_of_vqa, VqaRules(circular=True))
    assert len(track.items) == 4 * len(question_set.tasks)
    keys = [f"vp-000-r{by}" for by in range(4)]
    shown = [{i.label: i.sha256 for i in images(request)} for request in ask(track, *keys)]
    for by in range(4):
        assert shown[by]["scene"] == shown[0]["scene"]
        for place, letter in enumerate(LETTERS):
            assert shown[by][letter] == shown[0][LETTERS[(place + by) % 4]]
    assert len(set(shown[0].values())) == 5


@given(first=st.integers(0, 3), second=st.integers(0, 3), data=st.data())
def test_a_rotation_keeps_what_is_right_and_rotations_add_up(
    question_set: QuestionSet, first: int, second: int, data: st.DataObject
) -> None:
    question = data.draw(st.sampled_from(question_set.tasks)).question
    turned = rotated(question, first)
    for before, after in zip(question.answer, turned.answer, strict=True):
        assert _meaning(turned, after) == _meaning(question, before)
    assert rotated(turned, second) == rotated(question, (first + second) % 4)
    assert rotated(question, 0) == question


def _meaning(question: Question, index: int) -> object:
    """What an option is: its picture, its place in the world, or its words."""
    letter = LETTERS[index]
    for picture in question.pictures:
        if picture.label == letter:
            return picture.blocks, picture.view_deg
        for mark in picture.marks:
            if mark.letter == letter:
                return mark.position_m
    return question.options[index]


def test_wrong_pictures_are_of_another_scene_and_depend_on_the_seed_alone(
    question_set: QuestionSet, pictures_of_vqa: Path
) -> None:
    own = {r.key: r for r in ask(track_of(question_set, pictures_of_vqa, VqaRules()))}
    rules = VqaRules(wrong_image=True)
    seen = [
        {r.key: r for r in ask(track_of(question_set, pictures_of_vqa, rules), seed=seed)}
        for seed in (0, 0, 1)
    ]
    assert own.keys() == seen[0].keys()
    for key, request in own.items():
        wrong = seen[0][key]
        assert [i.label for i in images(wrong)] == [i.label for i in images(request)]
        assert not {i.sha256 for i in images(wrong)} & {i.sha256 for i in images(request)}
        assert text_of(wrong) == text_of(request)
        assert wrong.messages == seen[1][key].messages
    assert any(seen[2][key].messages != seen[0][key].messages for key in own)


def test_wrong_pictures_have_the_marks_that_the_text_speaks_of(
    question_set: QuestionSet, pictures_of_vqa: Path
) -> None:
    """Of two other questions about places, one marks none: it never stands in."""
    first, second, third, *_ = [t for t in question_set.tasks if t.question.subtask == "AD"]
    scene, *rest = second.question.pictures
    bare = replace(second.question, pictures=(replace(scene, marks=()), *rest))
    found = QuestionSet("three", question_set.root, (first, replace(second, question=bare), third))
    track = track_of(found, pictures_of_vqa, VqaRules(wrong_image=True), [first])
    for seed in range(8):
        (request,) = ask(track, seed=seed)
        sent = {image.label: image.data for image in images(request)}
        shown = {picture.label: picture for picture in third.question.pictures}
        assert sent == {label: question_png(recipe, STYLE) for label, recipe in shown.items()}


def test_wrong_pictures_need_another_scene(question_set: QuestionSet, tmp_path: Path) -> None:
    alone = QuestionSet("one", tmp_path, question_set.tasks[:1])
    with pytest.raises(SpecError, match="about another scene"):
        track_of(alone, tmp_path, VqaRules(wrong_image=True))


def test_outlines_tell_the_sizes_of_pictures_that_are_not_drawn_yet(
    question_set: QuestionSet, tmp_path: Path
) -> None:
    sizes = {"images": [(128, 128)] * 5, "letters": [(128, 128), (258, 258)]}
    for options_as, wanted in sizes.items():
        track = track_of(question_set, tmp_path, VqaRules(options_as=options_as))  # type: ignore[arg-type]
        item = next(item for item in track.items if item.key == "vp-000")
        ((request, is_real),) = track.outlines(item)
        assert not is_real
        assert [(i.width_px, i.height_px) for i in images(request)] == wanted
        (asked,) = ask(track, "vp-000")
        assert [(i.width_px, i.height_px) for i in images(asked)] == wanted
        assert list(track.outlines(item)) == [(asked, True)]


def test_identity_follows_questions_prompt_and_pictures(
    question_set: QuestionSet, tmp_path: Path
) -> None:
    def identity(rules: VqaRules, style: PictureStyle = STYLE, n: int = 8) -> str:
        pictures = QuestionPictures(tmp_path, style, rules.options_as, 1)
        prompt = TemplatePrompt(bundled("prompts", "vqa.j2"), "default")
        return repr(Vqa(rules, question_set, question_set.tasks[:n], prompt, pictures).identity())

    base = identity(VqaRules())
    assert identity(VqaRules()) == base
    others = [
        identity(VqaRules(), PictureStyle(size_px=256)),
        identity(VqaRules(), n=7),
        identity(VqaRules(blind=True)),
        identity(VqaRules(circular=True)),
    ]
    assert base not in others
    assert len(set(others)) == len(others)


def test_questions_keep_their_background_unless_a_suite_gives_one(
    question_set: QuestionSet, tmp_path: Path
) -> None:
    asked = next(task.question for task in question_set.tasks if task.key == "vp-000")
    lawn = replace(asked, pictures=tuple(replace(p, background="lawn") for p in asked.pictures))
    for question, ground, drawn in (
        (asked, None, "checkerboard"),
        (lawn, None, "lawn"),
        (lawn, "white", "white"),
        (asked, "white", "white"),
    ):
        pictures = QuestionPictures(tmp_path, STYLE, "images", 1, ground)  # type: ignore[arg-type]
        style = replace(STYLE, background=drawn)
        bare = [replace(picture, background=None) for picture in asked.pictures]
        wanted = tuple(question_key(picture, style) for picture in bare)
        assert pictures.keys(ShownQuestion(question, {})) == wanted


def test_judging_reads_scores_and_says_what_was_right(question_set: QuestionSet) -> None:
    track = Vqa(VqaRules(), question_set, question_set.tasks)
    for item in track.items:
        right = item.question.answer_letters
        good = track.judge(item, f"I looked closely.\nAnswer: {', '.join(right)}")
        assert good.fields() == {
            "parse": {"rule": "answer_line", "letters": right},
            "scores": [],
            "answer": {"right": right, "given": right, "correct": True},
        }
        for text in (None, "I cannot tell."):
            bad = track.judge(item, text)
            assert not bad.is_read
            assert bad.fields()["answer"] == {"right": right, "given": None, "correct": False}


def test_a_picture_file_that_is_broken_is_named(question_set: QuestionSet, tmp_path: Path) -> None:
    broken = tmp_path / "broken.png"
    broken.write_bytes(b"no picture")
    task = QuestionTask(question_set.tasks[0].question, {"scene": broken})
    track = track_of(QuestionSet("one", tmp_path, (task,)), tmp_path, VqaRules())
    with pytest.raises(DataError, match=r"broken\.png"):
        ask(track)
