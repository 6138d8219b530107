"""Laws of every reader: any text is read or a named problem, in time that is linear in it."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from phyblock.parsing.answer import parse_answer
from phyblock.parsing.move import parse_move
from phyblock.parsing.plan import parse_plan
from phyblock.parsing.poses import parse_poses

TEXTS = ("a red cube", "a blue cube", "an arch", "a cylinder")
READERS: dict[str, Callable[[str], Any]] = {
    "plan": lambda text: parse_plan(text, 16),
    "official": lambda text: parse_plan(text, 16, "official"),
    "move": parse_move,
    "choice": lambda text: parse_answer(text, TEXTS, is_ordering=False),
    "order": lambda text: parse_answer(text, TEXTS, is_ordering=True),
    "poses": lambda text: parse_poses(text, 16),
}
_PIECES = (
    "Step1: Move block with index 7  \n|Step|step 12 & |Steps 1, 2 and 3|block |# Layer 1:\n|"
    "index |1. |- |* |> |**|_|`|~~|```json\n|```|\n|  \n|\t|\u00a0|\u200b|\u00e9|7 |1, |and |"
    '-> |(|)|[|]|{|}|"|\\"|\\n|{"plan": [|{"answer": |{"operation": "|\\boxed{|<answer>|'
    "<think>|</think>|plan |order: |Answer: |answer is |option A |A, B |C is right|not |"
    "Next plan: |Move(|Move block |done |move |at (1, 2, 3) |x = 1.5 |a red cube |mm |e|.|,|:|="
)
PIECES = (*_PIECES.split("|"), "twice", "x2", "|", "| 1 | 2 ", " " * 50, "7" * 40, "a" * 40)
SIZE = 100_000
MOST_RATIO = 3.0  # 2 is linear, 4 quadratic.
SMALL_S = 0.05  # Times below this say nothing.


def seconds(read: Callable[[str], object], text: str) -> float:
    """Return the CPU time of reading a text."""
    start = time.process_time()
    read(text)
    return time.process_time() - start


def check(read: Callable[[str], object], piece: str) -> None:
    """Fail where 100 KB take much more than twice the time of 50 KB, each time."""
    whole = (piece * (SIZE // len(piece) + 1))[:SIZE]
    for _ in range(6):
        took = seconds(read, whole)
        if took < SMALL_S or took < MOST_RATIO * seconds(read, whole[: SIZE // 2]):
            return
    pytest.fail(f"{len(whole)} characters take {took:.3f} s")


@pytest.mark.parametrize("name", READERS)
def test_a_text_of_one_piece_is_read_in_linear_time(name: str) -> None:
    for piece in PIECES:
        check(READERS[name], piece)


@pytest.mark.parametrize("name", READERS)
@settings(max_examples=10, deadline=None)
@given(st.lists(st.sampled_from(PIECES), min_size=2, max_size=8).map("".join))
@example("Step1: Move block with index 16  \n")
def test_a_text_of_many_pieces_is_read_in_linear_time(name: str, piece: str) -> None:
    check(READERS[name], piece)


@pytest.mark.parametrize("name", READERS)
@given(st.text())
def test_any_text_is_read_or_a_named_problem(name: str, text: str) -> None:
    parsed = READERS[name](text)
    assert (parsed.rule is None) == (parsed.problem is not None)
    if name == "move":
        assert (parsed.rule is None) == (parsed.move is None and not parsed.is_done)
    elif name in ("choice", "order"):
        assert (parsed.rule is None) == (parsed.letters is None)
        assert set(parsed.letters or "") <= set("ABCD")
