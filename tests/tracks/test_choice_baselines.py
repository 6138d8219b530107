"""Baselines on questions: chance, truth, and what the probes guess, in the asked form."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Mapping

import pytest

from phyblock.config.models import ModelConfig
from phyblock.domain import LETTERS, Question, Scene, Subtask
from phyblock.errors import SpecError
from phyblock.models import Request
from phyblock.models.replay import BaselineModel
from phyblock.parsing.answer import parse_answer
from phyblock.tracks.questions import ChoiceSubject

OPTIONS = ("cube", "arch", "cylinder", "cuboid")


def answer(
    name: str, subtask: Subtask, key: str, guesses: Mapping[str, tuple[int, ...]] | None = None
) -> str:
    right = (2, 0, 3, 1) if subtask == "OR" else (2,)
    question = Question("q", subtask, Scene("s", (1,), (), ()), "?", OPTIONS, right)
    model = BaselineModel(ModelConfig(name=name))
    subject = ChoiceSubject(question, (guesses or {}).__getitem__)
    reply = asyncio.run(model.ask(Request(key, 0, (), {}, "", subject)))
    letters = parse_answer(reply.text, OPTIONS, subtask == "OR").letters
    assert letters is not None
    return letters


def test_random_answers_are_about_even() -> None:
    found = Counter(answer("random", "SH", f"q{n}") for n in range(400))
    assert set(found) == set(LETTERS)
    assert all(70 <= count <= 130 for count in found.values())


def test_random_orders_are_permutations_of_all() -> None:
    found = {answer("random", "OR", f"q{n}") for n in range(300)}
    assert len(found) == 24
    assert {"".join(sorted(order)) for order in found} == {LETTERS}


def test_the_oracle_is_right() -> None:
    assert answer("oracle", "SH", "q") == "C"
    assert answer("oracle", "OR", "q") == "CADB"


@pytest.mark.parametrize("name", ["majority", "text-only"])
def test_probes_answer_as_they_guess(name: str) -> None:
    assert answer(name, "SH", "q", {name: (1,)}) == "B"
    assert answer(name, "OR", "q", {name: (3, 2, 1, 0)}) == "DCBA"


def test_a_baseline_of_plans_has_no_rule() -> None:
    with pytest.raises(SpecError, match="has no rule"):
        answer("all-candidates", "SH", "q")
