"""Guessing without looking: what gives answers away is found, what does not is not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from phyblock.domain import LETTERS, Question, Scene
from phyblock.domain.question import rotated
from phyblock.tracks.baselines import FOLDS, PROBES, Folds, Guesses

WORDS = ("cube", "arch", "cylinder", "cuboid", "cone", "prism")


def question(
    number: int, options: tuple[str, ...], answer: tuple[int, ...], subtask: str = "SH"
) -> Question:
    scene = Scene(f"s{number}", (2,), (), (f"base{number % 40}",))
    text = f"Which one is it, {WORDS[number % 6]} or not?"
    return Question(f"{subtask.lower()}-{number}", subtask, scene, text, options, answer)  # type: ignore[arg-type]


def made_by(
    rule: Callable[[np.random.Generator], tuple[list[str], int]], n: int = 200
) -> list[Question]:
    rng = np.random.default_rng(3)
    found = []
    for number in range(n):
        options, right = rule(rng)
        found.append(question(number, tuple(options), (right,)))
    return found


def fair(rng: np.random.Generator) -> tuple[list[str], int]:
    return [str(word) for word in rng.permutation(WORDS)[:4]], int(rng.integers(4))


def cube_is_right(rng: np.random.Generator) -> tuple[list[str], int]:
    options, _ = fair(rng)
    options[0] = "cube"
    options[1:] = [word for word in rng.permutation(WORDS) if word != "cube"][:3]
    order = rng.permutation(4)
    return [str(options[int(place)]) for place in order], list(order).index(0)


def largest_is_right(rng: np.random.Generator) -> tuple[list[str], int]:
    numbers = rng.integers(0, 100_000, 4)
    return [f"{number} cm" for number in numbers], int(numbers.argmax())


def most_alike_is_right(rng: np.random.Generator) -> tuple[list[str], int]:
    a, b, c, d, e, f = (str(one) for one in rng.permutation(WORDS))
    options = [f"{a} {b}", f"{a} {c}", f"{d} {b}", f"{e} {f}"]
    order = rng.permutation(4)
    return [options[int(place)] for place in order], list(order).index(0)


def accuracy(probe: str, questions: list[Question]) -> float:
    guesses = Guesses(questions)
    return sum(guesses.guess(probe, one) == one.answer for one in questions) / len(questions)


@pytest.mark.parametrize("probe", list(PROBES))
def test_fair_questions_are_guessed_by_chance(probe: str) -> None:
    assert accuracy(probe, made_by(fair)) < 0.36


@pytest.mark.parametrize("probe", list(PROBES))
def test_an_answer_that_is_right_more_often_is_found(probe: str) -> None:
    assert accuracy(probe, made_by(cube_is_right)) == 1.0


@pytest.mark.parametrize("rule", [largest_is_right, most_alike_is_right])
def test_the_text_probe_finds_what_frequencies_do_not_tell(
    rule: Callable[[np.random.Generator], tuple[list[str], int]],
) -> None:
    questions = made_by(rule)
    assert accuracy("text-only", questions) > 0.9
    assert accuracy("majority", questions) < 0.5


def test_no_question_is_answered_by_its_own_scenes_answers() -> None:
    """Each base scene has a word of its own that is always right: it cannot be learned."""
    found = []
    for number in range(80):
        rng = np.random.default_rng(number)
        options = [f"word{number % 40}", *(f"only{number}-{n}" for n in range(3))]
        order = [int(place) for place in rng.permutation(4)]
        shown = tuple(options[place] for place in order)
        found.append(question(number, shown, (order.index(0),)))
    assert accuracy("majority", found) < 0.5


def test_what_is_learned_from_shares_no_base_scene_with_what_is_answered() -> None:
    plain = made_by(fair, 120)
    found = [
        replace(one, scene=replace(one.scene, parents=(f"base{n % 40}", f"base{n * 7 % 40}")))
        for n, one in enumerate(plain)
    ]
    folds = Folds(found)
    for fold in range(FOLDS):
        held_out = {base for q in found if folds.of(q) == fold for base in q.scene.parents[:1]}
        known = folds.known(fold, "SH")
        assert held_out
        assert known
        assert all(held_out.isdisjoint(question.scene.parents) for question in known)


def test_a_rotated_question_is_answered_with_the_same_words() -> None:
    questions = made_by(cube_is_right, 40)
    guesses = Guesses(questions)
    for one in questions:
        for by in range(4):
            turned = rotated(one, by)
            (guess,) = guesses.guess("majority", turned)
            assert turned.options[guess] == "cube"


def test_letters_of_pictures_and_orders_go_by_frequency() -> None:
    pictures = tuple(f"<img{i}>" for i in range(1, 5))
    questions = [question(n, pictures, (2,) if n % 3 else (0,)) for n in range(60)]
    orders = [question(n, pictures, (3, 1, 0, 2), "OR") for n in range(20)]
    guesses = Guesses([*questions, *orders])
    for probe in PROBES:
        assert {guesses.guess(probe, one) for one in questions} == {(2,)}
        assert {guesses.guess(probe, one) for one in orders} == {(3, 1, 0, 2)}


def test_a_set_of_one_question_is_answered_all_the_same() -> None:
    lone = question(0, WORDS[:4], (1,))
    for probe in PROBES:
        (guess,) = Guesses([lone]).guess(probe, lone)
        assert LETTERS[guess] in LETTERS
