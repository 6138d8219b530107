"""Attacks: what can be seen without understanding is found, and nothing where there is nothing."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.domain import Question, Scene
from phyblock.making.attacks.attacks import ATTACKS, Attack, all_attacks, attack, by_cue, by_rule
from phyblock.making.attacks.observed import Observed, credit
from phyblock.making.attacks.probes import boosted_cues, linear_cues

LIKINGS = st.lists(st.integers(-2, 2), min_size=4, max_size=4)
BY_NAME = {one.name: one for one in all_attacks()}


def observed(
    n: int, cue: str = "", *, subtask: str = "VP", least: bool = False, seed: int = 5
) -> list[Observed]:
    """Questions whose right option has the most of one cue (or the least), noise in all others."""
    rng = np.random.default_rng(seed)
    found = []
    for number in range(n):
        values = {name: rng.normal(size=4) for name in ("colored area", "height", "edges")}
        answer: tuple[int, ...] = (int(rng.integers(4)),)
        if subtask == "OR":
            answer = tuple(int(place) for place in np.argsort(-values[cue or "height"]))
            kind = "or-build" if number % 2 else "or-apart"
            answer = answer[::-1] if kind == "or-apart" else answer
        else:
            kind = "one"
            if cue:
                values[cue][answer[0]] = -9.0 if least else 9.0
        scene = Scene(f"s{number}", (2,), (), (f"base{number % 30}",))
        options = tuple(f"<img{place}>" for place in range(1, 5))
        question = Question(
            f"q{number}", subtask, scene, "?", options, answer, evidence={"kind": kind}  # type: ignore[arg-type]
        )  # fmt: skip
        found.append(Observed(question, values))
    return found


def reached(one: Attack, seen: list[Observed]) -> tuple[float, float, str]:
    (row,) = (row for row in attack(one, seen) if row.subtask and not row.kind)
    return row.most.value, row.least.value, row.verdict


@given(LIKINGS)
def test_guesses_by_likings_add_up_to_one_answer(likings: list[int]) -> None:
    liked = np.array(likings, dtype=float)
    assert sum(credit(liked, (place,)) for place in range(4)) == pytest.approx(1)
    orders = itertools.permutations(range(4))
    assert sum(credit(liked, order) for order in orders) == pytest.approx(1)


@given(LIKINGS, st.integers(0, 3))
def test_an_option_that_is_liked_better_is_never_taken_less(likings: list[int], more: int) -> None:
    liked = np.array(likings, dtype=float)
    better = liked.copy()
    better[more] += 1
    assert credit(better, (more,)) >= credit(liked, (more,))


@pytest.mark.parametrize("least", [False, True])
def test_a_cue_gives_the_answer_away_by_its_most_and_by_its_least(least: bool) -> None:
    most, inverted, verdict = reached(BY_NAME["area"], observed(60, "colored area", least=least))
    assert (most, inverted) == ((0.0, 1.0) if least else (1.0, 0.0))
    assert verdict == "missed"


@pytest.mark.parametrize("likes", [linear_cues, boosted_cues])
@pytest.mark.parametrize("least", [False, True])
def test_a_probe_finds_the_cue_and_its_side_by_itself(likes: object, least: bool) -> None:
    (probe,) = (one for one in ATTACKS if one.likes is likes)
    most, _, verdict = reached(probe, observed(80, "edges", least=least))
    assert most > 0.9
    assert verdict == "missed"


@pytest.mark.parametrize("name", ["area", "linear probe", "boosted probe"])
def test_where_nothing_tells_an_attack_guesses(name: str) -> None:
    most, least, verdict = reached(BY_NAME[name], observed(240))
    assert most < 0.36
    assert least < 0.36
    assert verdict in ("met", "over, in noise")


@pytest.mark.parametrize("made", [by_cue, by_rule])
def test_an_attack_by_a_name_that_is_not_there_is_refused(made: Callable[[str], object]) -> None:
    with pytest.raises(ValueError, match="'typo' is no"):
        made("typo")


def test_an_order_counts_the_way_round_that_its_kind_asks_for() -> None:
    seen = observed(60, "colored area", subtask="OR")
    assert reached(BY_NAME["area"], seen) == (1.0, 0.0, "missed")
    assert reached(BY_NAME["linear probe"], seen)[0] > 0.6
    kinds = {row.kind: row.n for row in attack(BY_NAME["area"], seen)}
    assert kinds == {"": 60, "or-apart": 30, "or-build": 30}


@settings(max_examples=10, deadline=None)
@given(st.permutations(range(4)))
def test_likings_go_with_the_options_wherever_they_stand(order: list[int]) -> None:
    seen = observed(40, "edges")
    moved = [
        replace(
            one,
            question=replace(one.question, answer=(order.index(one.question.answer[0]),)),
            cues={name: values[order] for name, values in one.cues.items()},
        )
        for one in seen
    ]
    for before, after in zip(linear_cues(seen), linear_cues(moved), strict=True):
        assert before is not None
        assert after is not None
        np.testing.assert_allclose(after, before[order], atol=1e-9)


def test_with_no_other_set_there_is_no_row_of_one() -> None:
    assert "text, unseen set" not in BY_NAME
    with_other = all_attacks([observed(1)[0].question])
    assert "text, unseen set" in {one.name for one in with_other}
    assert {one.name for one in all_attacks(with_texts=False)} < set(BY_NAME)
