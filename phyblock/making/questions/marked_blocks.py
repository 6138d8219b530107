"""The block that a question marks, and which block shows at a mark."""

from __future__ import annotations

from dataclasses import replace

from phyblock.domain.question import QuestionPicture
from phyblock.making.questions.question_draft import UnfairError
from phyblock.sim.seeing import seen, seen_order

__all__ = ["TAKEN", "marked_order"]

TAKEN = "X"
"""The letter of the block that is taken away or pushed."""


def marked_order(picture: QuestionPicture, letter: str) -> int:
    """Order of the block that shows at a mark; UnfairError when there is none."""
    for mark in picture.marks:
        if mark.letter == letter:
            order = seen_order(picture, seen(replace(picture, marks=())), mark.position_m)
            if order is not None:
                return order
    raise UnfairError(f"no block is marked {letter}")
