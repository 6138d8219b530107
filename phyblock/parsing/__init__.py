"""Reply text -> what the model meant, with the rule that matched, or a named failure. Pure."""

from phyblock.parsing.answer import ParsedAnswer, parse_answer
from phyblock.parsing.move import (
    MOVE_PROBLEMS,
    MOVE_RULES,
    MoveProblem,
    ParsedMove,
    parse_move,
)
from phyblock.parsing.plan import ParsedPlan, parse_plan

__all__ = [
    "MOVE_PROBLEMS",
    "MOVE_RULES",
    "PLAN_PARSERS",
    "MoveProblem",
    "ParsedAnswer",
    "ParsedMove",
    "ParsedPlan",
    "PlanParser",
    "parse_answer",
    "parse_move",
    "parse_plan",
]
