"""What attacks see: cues of real pictures, rules of support, pictures that are cut."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from phyblock.datasets import read_builtin, read_questions
from phyblock.domain import Question, QuestionPicture
from phyblock.domain.blocks import Color
from phyblock.domain.rotation import rotated
from phyblock.domain.scene import Block
from phyblock.making.attacks import cut
from phyblock.making.attacks.cues import cues_of
from phyblock.making.attacks.looks import look_at
from phyblock.making.attacks.naive_support import naive_likings, resting_on, resting_only_on
from phyblock.making.attacks.observed import observe
from phyblock.making.questions.counterfactual import OUTCOME_TEXTS
from phyblock.sim import question_pictures
from phyblock.sim.camera import Camera
from tests.vqa_set import questions, write_questions
from tests.workspace import Workspace

FLAT = (0.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def asked(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Question]:
    """A question of every subtask."""
    root = tmp_path_factory.mktemp("looked")
    scenes = read_builtin(Workspace(root, root / "pictures").write_scenes())
    folder = write_questions(root / "questions", questions(per_subtask=1))
    tasks = read_questions(folder, scenes).tasks
    return {task.question.subtask: task.question for task in tasks}


@pytest.mark.parametrize("subtask", ["VP", "OR", "AD"])
def test_cues_go_with_the_options_wherever_they_stand(
    asked: dict[str, Question], subtask: str
) -> None:
    question = asked[subtask]
    before, after = cues_of(look_at(question)), cues_of(look_at(rotated(question, 1)))
    assert before.keys() == after.keys()
    assert before
    for name, values in before.items():
        np.testing.assert_allclose(after[name], np.roll(values, -1), rtol=1e-9, err_msg=name)


def test_options_that_are_texts_are_not_drawn(asked: dict[str, Question]) -> None:
    assert look_at(asked["SH"]).scene is None
    assert cues_of(look_at(asked["SH"])) == {}


def test_a_picture_like_the_scene_differs_in_nothing_and_fewer_blocks_cover_less(
    asked: dict[str, Question],
) -> None:
    scene = next(one for one in asked["VP"].pictures if one.label == "scene")
    framed = replace(scene, framed=scene.blocks)
    pictures = [replace(framed, label=letter) for letter in "ABC"]
    pictures.append(replace(framed, label="D", blocks=scene.blocks[:1]))
    cues = cues_of(look_at(replace(asked["VP"], pictures=(framed, *pictures))))
    assert cues["unlike the scene"][:3].tolist() == [0.0] * 3
    assert cues["unlike the scene"][3] > 0
    assert cues["colors unlike the scene"].argmax() == 3
    assert cues["colored area"].argmin() == 3
    assert cues["unlike the others"].argmax() == 3


def bridge() -> list[Block]:
    """A plank on two posts, a cube on the plank, and one that stands by itself."""

    def cube(order: int, x: float, z: float, *depend: int) -> Block:
        return Block(order, "cube", "red", (x, 0.0, z), FLAT, depend, 1)

    plank = Block(3, "cuboid3", "yellow", (0.0, 0.0, 0.0625), (0.0, 0.0, 90.0), (1, 2), 2)
    plank = replace(plank, euler_deg=FLAT)
    return [cube(1, -0.05, 0.025), cube(2, 0.05, 0.025), plank, cube(4, 0.0, 0.1, 3),
            cube(5, 0.3, 0.025)]  # fmt: skip


def test_what_rests_on_a_post_and_what_rests_on_it_alone() -> None:
    blocks = bridge()
    assert resting_on(blocks, 1) == {3, 4}
    assert resting_only_on(blocks, 1) == set()
    for rule in (resting_on, resting_only_on):
        assert rule(blocks, 3) == {4}
        assert rule(blocks, 4) == rule(blocks, 5) == set()


def removal(asked: dict[str, Question], options: tuple[str, ...], *others: object) -> Question:
    scene = replace(asked["CF"].scene, blocks=tuple(bridge()))
    shown = QuestionPicture("scene", scene.blocks, (45.0, 22.0))
    pictures = tuple(
        QuestionPicture(letter, tuple(blocks), (45.0, 22.0))  # type: ignore[arg-type]
        for letter, blocks in zip("ABCD", others, strict=False)
    )
    facts = {"removed": 1, "slots": {"color": "red", "other": "yellow", "taken": "blue"}}
    return replace(
        asked["CF"], scene=scene, options=options, pictures=(shown, *pictures), evidence=facts
    )


def test_a_rule_picks_the_text_and_the_picture_that_say_what_it_says(
    asked: dict[str, Question],
) -> None:
    told = removal(asked, OUTCOME_TEXTS[::-1])
    assert naive_likings(told, resting_on).tolist() == [0, 1, 0, 0]  # type: ignore[union-attr]
    assert naive_likings(told, resting_only_on).tolist() == [0, 0, 0, 1]  # type: ignore[union-attr]
    blocks = bridge()

    def colored(*moved: int) -> list[Block]:
        colors: list[Color] = ["blue" if b.order == 1 else "red" if b.order in moved else "yellow"
                               for b in blocks]  # fmt: skip
        return [replace(b, color=color) for b, color in zip(blocks, colors, strict=True)]

    images = tuple(f"<img{place}>" for place in range(1, 5))
    shown = removal(asked, images, colored(2, 5), colored(), colored(3, 4), colored(4))
    likings = naive_likings(shown, resting_on)
    assert likings is not None
    assert likings.argmax() == 2
    other = naive_likings(shown, resting_only_on)
    assert other is not None
    assert other.argmax() == 1


def test_a_rule_has_no_say_where_it_has_no_word(asked: dict[str, Question]) -> None:
    assert naive_likings(asked["SH"], resting_on) is None
    assert naive_likings(removal(asked, ("a", "b", "c", "d")), resting_on) is None


def test_what_the_planes_cut_off_is_counted(
    asked: dict[str, Question], monkeypatch: pytest.MonkeyPatch
) -> None:
    question = replace(asked["VP"], answer=(0,))
    assert cut.cuts_of(question) == ()
    monkeypatch.setattr(cut, "question_camera", _shallow(question_pictures.question_camera))
    cuts = cut.cuts_of(question)
    assert [one.label for one in cuts] == [picture.label for picture in question.pictures]
    assert all(one.at_far and not one.at_near and one.pixels > 0 for one in cuts)
    assert [one.label for one in cuts if one.is_wrong] == ["B", "C", "D"]
    assert observe(question).cuts == cuts


def _shallow(made: Callable[..., Camera]) -> Callable[..., Camera]:
    """Cameras whose far plane is 5 cm behind the near one."""

    def make(*given: object) -> Camera:
        camera = made(*given)
        return replace(camera, far_m=camera.near_m + 0.05)

    return make
