"""Reply text -> what the model meant, with the rule that matched, or a named failure. Pure."""

from phyblock.parsing.answer import ParsedAnswer, parse_answer
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
    "MoveProblem",
    "ParsedAnswer",
    "ParsedMove",
    "ParsedPlan",
    "PlanProblem",
    "parse_answer",
    "parse_move",
    "parse_plan",
    "reader_version",
]
