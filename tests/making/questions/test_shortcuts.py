"""The audit of question sets: what is wrong with one is found, by question."""

from __future__ import annotations

from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest

from phyblock.datasets import read_builtin, read_questions
from phyblock.domain import LETTERS, Question
from phyblock.domain.rotation import rotated
from phyblock.making.questions.sheet import sheet_html
from phyblock.making.questions.shortcuts import audit_questions, duplicates_of, referents
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
    (audit,) = audit_questions(even, with_text_probe=False)
    assert audit.letters == dict.fromkeys(LETTERS, 2)
    assert audit.is_balanced
    assert audit.text_only is None
    (skewed,) = audit_questions([replace(q, answer=(0,)) for q in even], with_text_probe=False)
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
    (audit,) = audit_questions([alike, second, *rest], with_text_probe=False)
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


def test_scenes_and_bases_are_counted(asked: list[Question]) -> None:
    for audit in audit_questions(asked, with_text_probe=False):
        assert (audit.n, audit.scenes, audit.bases, audit.most_of_a_scene) == (8, 5, 5, 2)


class _Sheet(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.images: list[str] = []
        self.articles: list[str] = []
        self.folds = 0
        self.links: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        if tag == "img":
            self.images.append(found["src"] or "")
        elif tag == "article":
            self.articles.append(found["id"] or "")
        elif tag == "details":
            assert "open" not in found
            self.folds += 1
        self.links += [value or "" for name, value in attrs if name in ("href", "src")]


def test_the_sheet_holds_every_picture_and_hides_the_answers(
    asked: list[Question], tmp_path: Path
) -> None:
    chosen = [of(asked, subtask)[0] for subtask in ("SH", "VP", "OR", "AD")]
    hostile = replace(chosen[0], text="<script>alert(1)</script> & so on?")
    drawn: list[str] = []
    text = "".join(
        sheet_html("A sheet", [hostile, *chosen[1:]], lambda p: drawn.append(p.label) or b"png")  # type: ignore[func-returns-value]
    )
    (tmp_path / "sheet.html").write_text(text, encoding="utf-8")
    sheet = _Sheet()
    sheet.feed(text)
    assert sheet.articles == [question.id for question in chosen]
    assert drawn == ["scene", "scene", *LETTERS, *LETTERS, "scene", "block"]
    assert len(sheet.images) == len(drawn)
    assert sheet.folds == len(chosen)
    assert "<script>alert" not in text
    assert all(link.startswith(("data:image/png;base64,", "#")) for link in sheet.links)
