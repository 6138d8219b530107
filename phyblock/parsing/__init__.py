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
from phyblock.parsing.version import READER_VERSION, reader_version

__all__ = [
    "MOVE_PROBLEMS",
    "MOVE_RULES",
    "PLAN_PROBLEMS",
    "READER_VERSION",
    "AnswerForm",
    "MoveProblem",
    "ParsedAnswer",
    "ParsedMove",
    "ParsedPlan",
    "PlanProblem",
    "choice_form",
    "move_form",
    "parse_answer",
    "parse_asked_answer",
    "parse_asked_move",
    "parse_asked_plan",
    "parse_move",
    "parse_plan",
    "plan_form",
    "reader_version",
]
