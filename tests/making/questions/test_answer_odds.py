"""Which drafts chance keeps: of those kept, texts tell nothing of what is right."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from phyblock.making.questions.selection import Texts, keeping_odds

SHAPES = ("cube", "arch", "cylinder", "prism", "half cylinder")


def pool(count: int, odds: tuple[float, ...], seed: int) -> list[Texts]:
    """Drafts in which shapes are right as often as `odds` say, the more so of what is on top."""
    rng = np.random.default_rng(seed)
    made = []
    for number in range(count):
        word = "topmost" if rng.random() < 0.5 else "leftmost"
        chances = np.array(odds) ** (2 if word == "topmost" else 1)
        right = int(rng.choice(len(SHAPES), p=chances / chances.sum()))
        others = [int(i) for i in rng.permutation(len(SHAPES)) if i != right][:3]
        options = tuple(SHAPES[i] for i in (right, *others))
        made.append(Texts(f"s{number % 60}", "", f"What shape is the {word} block?", options))
    return made


@pytest.mark.parametrize("word", ["topmost", "leftmost"])
def test_of_the_drafts_kept_each_option_is_right_equally_often(word: str) -> None:
    texts = pool(3000, (0.4, 0.25, 0.15, 0.1, 0.1), 1)
    rng = np.random.default_rng(2)
    kept = [
        one
        for one, odds in zip(texts, keeping_odds(texts), strict=True)
        if word in one.question and rng.random() < odds
    ]
    before = [one for one in texts if word in one.question]
    assert max(abs(rate - 0.25) for rate in rates(before)) > 0.15
    assert max(abs(rate - 0.25) for rate in rates(kept)) < 0.08


def rates(texts: list[Texts]) -> list[float]:
    """How often each shape is right where it is offered."""
    right = Counter(one.options[0] for one in texts)
    offered = Counter(option for one in texts for option in one.options)
    return [right[shape] / offered[shape] for shape in SHAPES]


def test_drafts_that_tell_nothing_are_kept_and_so_are_options_that_are_no_texts() -> None:
    even = pool(800, (0.2,) * 5, 3)
    assert np.mean(keeping_odds(even)) > 0.7
    assert keeping_odds([Texts("s", "k", "Which picture?", ())] * 5) == [1.0] * 5
    assert keeping_odds([]) == []


@pytest.mark.parametrize("is_middle", [False, True])
def test_of_the_drafts_kept_no_look_is_right_more_often(is_middle: bool) -> None:
    """By the most of a measure, or by what is nearest to the others."""
    rng, seen = np.random.default_rng(4), []
    for number in range(1500):
        looks = rng.normal(size=(4, 2))
        off = -np.abs(looks[:, 1] - looks[:, 1].mean()) if is_middle else looks[:, 1]
        right = int(np.argmax(1.5 * off + rng.gumbel(size=4)))
        order = [right, *(i for i in range(4) if i != right)]
        rows = tuple(tuple(row) for row in looks[order].tolist())
        seen.append(
            (Texts(f"s{number % 60}", "k", "Which?", (), rows), int(off[right] == off.max()))
        )
    odds = keeping_odds([texts for texts, _ in seen])
    kept = [most for (_, most), odd in zip(seen, odds, strict=True) if rng.random() < odd]
    assert np.mean([most for _, most in seen]) > 0.4
    assert len(kept) > 200
    assert abs(np.mean(kept) - 0.25) < 0.08
