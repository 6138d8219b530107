"""How a person answers a question: one option, or for ordering all in their order."""

from __future__ import annotations

from phyblock.domain import LETTERS, is_picture_option
from phyblock.tracks.by_hand import Choice, Picking, Spot
from phyblock.tracks.vqa.baselines import ChoiceSubject, choice_text

__all__ = ["pick_answer"]


def pick_answer(subject: ChoiceSubject) -> Picking:
    """The letters of the options, with the texts or the pictures that they are."""
    options = subject.question.options
    is_ordering = subject.question.subtask == "OR"
    picked = len(options) if is_ordering else 1
    return Picking(
        tuple(
            Choice(letter, "", (Spot(letter),))
            if is_picture_option(option)
            else Choice(letter, option)
            for letter, option in zip(LETTERS, options, strict=False)
        ),
        least=picked,
        most=picked,
        repeats=False,
        noun="place" if is_ordering else "option",
        write=lambda picks: choice_text([pick.place for pick in picks]),
    )
