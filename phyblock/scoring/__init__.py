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
from phyblock.scoring.steps import (
    GATINGS,
    MOVE_OUTCOMES,
    Assembly,
    Gating,
    Move,
    MoveOutcome,
    attempted_counts,
    gated,
    placed_counts,
)
from phyblock.scoring.vqa import (
    Accuracy,
    Answered,
    LetterRates,
    MacroAccuracy,
    chance,
    circular,
    letter_rates,
    macro_accuracy,
    subtask_accuracies,
)

__all__ = [
    "ERROR_TYPES",
    "GATINGS",
    "LEVEL1_CRITERIA",
    "MATCHERS",
    "MOVE_OUTCOMES",
    "SETTINGS",
    "Accuracy",
    "Answered",
    "Assembly",
    "AssemblyScorer",
    "Counts",
    "Criterion",
    "ErrorType",
    "Gating",
    "Goal",
    "LetterRates",
    "Level1Criterion",
    "MacroAccuracy",
    "Match",
    "Matcher",
    "Move",
    "MoveOutcome",
    "Score",
    "Setting",
    "attempted_counts",
    "chance",
    "circular",
    "count_errors",
    "gated",
    "letter_rates",
    "level1_counts",
    "macro_accuracy",
    "match_plan",
    "micro",
    "placed_counts",
    "step_errors",
    "subtask_accuracies",
]
