"""What a reader of the texts alone can tell of an option: its words, numbers, likeness to others.

These are the shortcuts that multiple-choice questions are known for: words that are right often,
the largest or the middle number, the option that shares most with the others, the longest one.
Letters are left out: how often each is right is counted, not learned.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping, Sequence

from phyblock.domain.question import Question
from phyblock.stable import plain_sum

__all__ = ["option_features", "text_features"]

_WORD = re.compile(r"[a-z]+|\d+(?:\.\d+)?")
_CROSSED = 0.25
_NUMBER = re.compile(r"\d+(?:\.\d+)?")


def option_features(question: Question) -> list[Mapping[str, float]]:
    """Features of each option of a question, by name; 0 where a name is missing."""
    return text_features(question.text, question.options)


def text_features(text: str, options: Sequence[str]) -> list[Mapping[str, float]]:
    """Features of each of the options beside one another and the text that asks for one."""
    words = [_words(option) for option in options]
    asked = set(_words(text))
    numbers = [_number(option) for option in options]
    lengths = [len(option) for option in options]
    return [
        {
            **_word_features(words[i], asked),
            **_likeness(words, i),
            **_rank("number", numbers, i),
            **_rank("length", lengths, i),
            "asked about": float(len(asked.intersection(words[i]))),
        }
        for i in range(len(options))
    ]


def _word_features(words: Sequence[str], asked: set[str]) -> dict[str, float]:
    pairs = [" ".join(pair) for pair in itertools.pairwise(words)]
    features = {f"option {word}": 1.0 for word in [*words, *pairs, " ".join(words)]}
    crossed = {f"asked {one} option {' '.join(words)}": _CROSSED for one in asked}
    return features | crossed


def _likeness(words: Sequence[Sequence[str]], i: int) -> dict[str, float]:
    """How much an option shares with the others, and whether it is the most or the least alike."""
    shared = [
        plain_sum(_overlap(one, other) for k, other in enumerate(words) if k != j)
        for j, one in enumerate(words)
    ]
    return {
        "likeness": shared[i],
        "most alike": float(shared[i] == max(shared) > min(shared)),
        "least alike": float(shared[i] == min(shared) < max(shared)),
    }


def _rank(name: str, values: Sequence[float | None], i: int) -> dict[str, float]:
    known = [value for value in values if value is not None]
    mine = values[i]
    if mine is None or len(known) < len(values) or len(set(known)) < 2:
        return {}
    return {f"{name} rank {sum(value < mine for value in known)}": 1.0}


def _overlap(one: Sequence[str], other: Sequence[str]) -> float:
    union = set(one) | set(other)
    return len(set(one) & set(other)) / len(union) if union else 0.0


def _words(text: str) -> list[str]:
    return _WORD.findall(text.lower())


def _number(text: str) -> float | None:
    found = _NUMBER.findall(text)
    return float(found[0]) if len(found) == 1 else None
