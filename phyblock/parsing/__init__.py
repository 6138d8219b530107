"""Reply text -> what the model meant, with the rule that matched, or a named failure. Pure."""

from phyblock.parsing.answer import ParsedAnswer, parse_answer
from phyblock.parsing.plan import PLAN_PARSERS, ParsedPlan, PlanParser, parse_plan

__all__ = [
    "PLAN_PARSERS",
    "ParsedAnswer",
    "ParsedPlan",
    "PlanParser",
    "parse_answer",
    "parse_plan",
]
