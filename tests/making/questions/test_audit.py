"""The audit of question sets: what is wrong with one is found, by question."""

from __future__ import annotations

from dataclasses import replace

import pytest

from phyblock.data import read_builtin, read_questions
from phyblock.domain import LETTERS, Question
from phyblock.domain.question import rotated
from phyblock.making.questions.audit import audit_questions, duplicates_of, referents
from tests.vqa_set import questions, write_questions
from tests.workspace import Workspace


@pytest.fixture(scope="module")
def asked(tmp_path_factory: pytest.TempPathFactory) -> list[Question]:
    root = tmp_path_factory.mktemp("audited")
    scenes = read_builtin(Workspace(root, root / "pictures").write_scenes())
    folder = write_questions(root / "questions", questions(per_subtask=8))
    return [task.question for task in read_questions(folder, scenes).tasks]


def of(asked: list[Question], subtask: str) -> list[Question]:
    return [question for question in asked if question.subtask == subtask]


def test_letters_are_counted_and_balance_is_judged(asked: list[Question]) -> None:
    even = [replace(q, answer=(n % 4,)) for n, q in enumerate(of(asked, "SH"))]
    (audit,) = audit_questions(even, with_texts=False, with_pictures=False)
    assert audit.letters == dict.fromkeys(LETTERS, 2)
    assert audit.is_balanced
    assert audit.text is None
    (skewed,) = audit_questions(
        [replace(q, answer=(0,)) for q in even], with_texts=False, with_pictures=False
    )
    assert skewed.letter_shares == (0.0, 1.0)
    assert not skewed.is_balanced


def test_a_repeat_is_found_in_any_order_of_its_options(asked: list[Question]) -> None:
    for subtask in ("SH", "VP", "AD"):
        first = of(asked, subtask)[0]
        again = replace(rotated(first, 1), id="again")
        found = duplicates_of([first, again])
        assert found == ({} if subtask == "AD" else {"again": first.id})
    assert duplicates_of(asked) == {}


def test_options_that_read_alike_are_found(asked: list[Question]) -> None:
    first, second, *rest = of(asked, "SH")
    alike = replace(first, options=("Cube", "cube ", "arch", "cuboid"))
    (audit,) = audit_questions([alike, second, *rest], with_texts=False, with_pictures=False)
    assert audit.ambiguous == (alike.id,)


def test_named_blocks_are_looked_for_in_the_picture(asked: list[Question]) -> None:
    question = next(q for q in of(asked, "RD") if q.scene.id == "t1")
    named = replace(
        question,
        options=("the red cube", "the green arch", "blue cube", "nothing"),
        evidence={"slots": {"block": "blue cube"}},
    )
    seen = referents(named)
    assert seen.keys() == {block.order for block in named.scene.blocks}
    assert all(0.5 < share <= 1 for share in seen.values())
    turned = replace(named, pictures=(replace(named.pictures[0], view_deg=(225.0, 30.0)),))
    assert referents(turned).keys() == seen.keys()
    assert referents(turned) != seen


def test_a_text_that_gives_the_answer_away_is_a_finding(asked: list[Question]) -> None:
    given = [
        replace(q, id=f"sh-{n}", answer=(q.options.index("cube"),))
        for n, q in enumerate(5 * of(asked, "SH"))
    ]
    (audit,) = audit_questions(given, with_pictures=False)
    assert audit.text is not None
    assert audit.text.accuracy == 1
    assert any("text probe" in finding for finding in audit.findings())


def test_a_picture_that_gives_the_answer_away_is_a_finding(asked: list[Question]) -> None:
    """The right one of four equal pictures lacks a block in every question."""
    given = []
    for number in range(40):
        first = of(asked, "VP")[number % 8]
        scene, *options = first.pictures
        answer = number % 4
        less = replace(options[0], blocks=options[0].blocks[:-1])
        shown = [
            replace(less if i == answer else options[0], label=letter)
            for i, letter in enumerate(LETTERS)
        ]
        given.append(replace(first, id=f"vp-{number}", pictures=(scene, *shown), answer=(answer,)))
    (audit,) = audit_questions(given, with_texts=False)
    assert audit.pictures is not None
    assert audit.pictures.n == 40
    assert audit.pictures.accuracy == 1
    assert any("pictures probe" in finding for finding in audit.findings())
