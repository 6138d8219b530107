"""Reply text -> what the model meant, with the rule that matched, or a named failure. Pure.

Names are imported when they are first used: a run that asks nothing reads nothing, and the patterns
of the readers take longer to compile than the rest of it to import.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from phyblock.lazy import lazy_names

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
    "ParsedAnswer": "phyblock.parsing.answer",
    "parse_answer": "phyblock.parsing.answer",
    "AnswerForm": "phyblock.parsing.answer_form",
    "choice_form": "phyblock.parsing.asked",
    "move_form": "phyblock.parsing.asked",
    "parse_asked_answer": "phyblock.parsing.asked",
    "parse_asked_move": "phyblock.parsing.asked",
    "parse_asked_plan": "phyblock.parsing.asked",
    "plan_form": "phyblock.parsing.asked",
    "MOVE_PROBLEMS": "phyblock.parsing.move_problem",
    "MOVE_RULES": "phyblock.parsing.move",
    "MoveProblem": "phyblock.parsing.move_problem",
    "ParsedMove": "phyblock.parsing.move",
    "parse_move": "phyblock.parsing.move",
    "PLAN_PROBLEMS": "phyblock.parsing.plan",
    "ParsedPlan": "phyblock.parsing.plan",
    "PlanProblem": "phyblock.parsing.plan",
    "parse_plan": "phyblock.parsing.plan",
    "MOST_POSE_STEPS": "phyblock.parsing.pose_plan",
    "POSE_PROBLEMS": "phyblock.parsing.pose_plan",
    "ParsedPoses": "phyblock.parsing.pose_plan",
    "PoseProblem": "phyblock.parsing.pose_plan",
    "parse_poses": "phyblock.parsing.pose_plan",
    "pose_form": "phyblock.parsing.pose_plan",
    "POSE_READER_VERSION": "phyblock.parsing.version",
    "READER_VERSION": "phyblock.parsing.version",
    "reader_version": "phyblock.parsing.version",
}
__getattr__ = lazy_names(__name__, _HOMES)
