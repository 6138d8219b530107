"""Pure scoring: plans against AOV graphs, error types, counts and micro averages."""

from phyblock.scoring.assembly import AssemblyScorer, Criterion, Score
from phyblock.scoring.error_types import ERROR_TYPES, ErrorType, count_errors, step_errors
from phyblock.scoring.level1 import LEVEL1_CRITERIA, Level1Criterion, level1_counts
from phyblock.scoring.match import (
    MATCHERS,
    SETTINGS,
    Goal,
    Match,
    Matcher,
    Setting,
    match_plan,
)
from phyblock.scoring.metrics import Counts, micro

__all__ = [
    "ERROR_TYPES",
    "LEVEL1_CRITERIA",
    "MATCHERS",
    "SETTINGS",
    "AssemblyScorer",
    "Counts",
    "Criterion",
    "ErrorType",
    "Goal",
    "Level1Criterion",
    "Match",
    "Matcher",
    "Score",
    "Setting",
    "count_errors",
    "level1_counts",
    "match_plan",
    "micro",
    "step_errors",
]
