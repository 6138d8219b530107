"""Reply text -> what the model meant, with the rule that matched, or a named failure. Pure.

Names are imported when they are first used: a run that asks nothing reads nothing, and the patterns
of the readers take longer to compile than the rest of it to import.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from phyblock.parsing.answer import ParsedAnswer, parse_answer
    from phyblock.parsing.answer_form import AnswerForm
    from phyblock.parsing.asked import (
        choice_form,
        move_form,
        parse_asked_answer,
        parse_asked_move,
        parse_asked_plan,
        plan_form,
    )
    from phyblock.parsing.move import MOVE_RULES, ParsedMove, parse_move
    from phyblock.parsing.move_problem import MOVE_PROBLEMS, MoveProblem
    from phyblock.parsing.plan import PLAN_PROBLEMS, ParsedPlan, PlanProblem, parse_plan
    from phyblock.parsing.pose_plan import (
        MOST_POSE_STEPS,
        POSE_PROBLEMS,
        ParsedPoses,
        PoseProblem,
        parse_poses,
        pose_form,
    )
    from phyblock.parsing.version import POSE_READER_VERSION, READER_VERSION, reader_version

__all__ = [
    "MOST_POSE_STEPS",
    "MOVE_PROBLEMS",
    "MOVE_RULES",
    "PLAN_PROBLEMS",
    "POSE_PROBLEMS",
    "POSE_READER_VERSION",
    "READER_VERSION",
    "AnswerForm",
    "MoveProblem",
    "ParsedAnswer",
    "ParsedMove",
    "ParsedPlan",
    "ParsedPoses",
    "PlanProblem",
    "PoseProblem",
    "choice_form",
    "move_form",
    "parse_answer",
    "parse_asked_answer",
    "parse_asked_move",
    "parse_asked_plan",
    "parse_move",
    "parse_plan",
    "parse_poses",
    "plan_form",
    "pose_form",
    "reader_version",
]

_HOMES = {
    "ParsedAnswer": "answer",
    "parse_answer": "answer",
    "AnswerForm": "answer_form",
    "choice_form": "asked",
    "move_form": "asked",
    "parse_asked_answer": "asked",
    "parse_asked_move": "asked",
    "parse_asked_plan": "asked",
    "plan_form": "asked",
    "MOVE_PROBLEMS": "move_problem",
    "MOVE_RULES": "move",
    "MoveProblem": "move_problem",
    "ParsedMove": "move",
    "parse_move": "move",
    "PLAN_PROBLEMS": "plan",
    "ParsedPlan": "plan",
    "PlanProblem": "plan",
    "parse_plan": "plan",
    "MOST_POSE_STEPS": "pose_plan",
    "POSE_PROBLEMS": "pose_plan",
    "ParsedPoses": "pose_plan",
    "PoseProblem": "pose_plan",
    "parse_poses": "pose_plan",
    "pose_form": "pose_plan",
    "POSE_READER_VERSION": "version",
    "READER_VERSION": "version",
    "reader_version": "version",
}


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value: object = getattr(importlib.import_module(f"phyblock.parsing.{_HOMES[name]}"), name)
    globals()[name] = value
    return value
