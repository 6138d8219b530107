"""Reply text -> what the model meant, with the rule that matched, or a named failure. Pure."""

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
from phyblock.parsing.move import (
    MOVE_PROBLEMS,
    MOVE_RULES,
    MoveProblem,
    ParsedMove,
    parse_move,
)
from phyblock.parsing.plan import PLAN_PROBLEMS, ParsedPlan, PlanProblem, parse_plan
from phyblock.parsing.pose_plan import (
    MOST_POSE_STEPS,
    POSE_PROBLEMS,
    POSE_READER_VERSION,
    ParsedPoses,
    PoseProblem,
    parse_poses,
    pose_form,
)
from phyblock.parsing.version import READER_VERSION, reader_version

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
