"""Why an operation of step planning could not be read out of a reply."""

from __future__ import annotations

from typing import Literal, get_args

from phyblock.parsing.answer_form import FormProblem

__all__ = ["MOVE_PROBLEMS", "MoveProblem"]

MoveProblem = Literal["empty", "no_move", "several_moves", "move_and_done", FormProblem]
MOVE_PROBLEMS: tuple[MoveProblem, ...] = get_args(MoveProblem)
