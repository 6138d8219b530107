"""Pure scoring: plans against AOV graphs, errors, losses, counts and micro averages."""

from phyblock.scoring.assembly import AssemblyScorer, Score
from phyblock.scoring.choices import chance, letter_rates
from phyblock.scoring.error_types import ERROR_TYPES, ErrorType, count_errors
from phyblock.scoring.goal import Goal
from phyblock.scoring.level1 import level1_counts
from phyblock.scoring.losses import BLOCK_OUTCOMES, BlockOutcome, block_outcomes
from phyblock.scoring.match import Match, match_plan, most_placed, step_errors
from phyblock.scoring.metrics import Counts, micro
from phyblock.scoring.nearest import steps_kept
from phyblock.scoring.pose import POSE_FRAMES, Laid, PoseFit, PoseFrame, PoseScore, PoseScorer
from phyblock.scoring.pose_end import blocks_reached
from phyblock.scoring.pose_errors import POSE_ERRORS, PoseError, pose_errors
from phyblock.scoring.pose_match import TOLERANCES_CM, TURN_TOLERANCE_DEG
from phyblock.scoring.steps import (
    MOVE_OUTCOMES,
    Assembly,
    Move,
    MoveOutcome,
    attempted_counts,
    placed_counts,
)

__all__ = [
    "BLOCK_OUTCOMES",
    "ERROR_TYPES",
    "MOVE_OUTCOMES",
    "POSE_ERRORS",
    "POSE_FRAMES",
    "TOLERANCES_CM",
    "TURN_TOLERANCE_DEG",
    "Assembly",
    "AssemblyScorer",
    "BlockOutcome",
    "Counts",
    "ErrorType",
    "Goal",
    "Laid",
    "Match",
    "Move",
    "MoveOutcome",
    "PoseError",
    "PoseFit",
    "PoseFrame",
    "PoseScore",
    "PoseScorer",
    "Score",
    "attempted_counts",
    "block_outcomes",
    "blocks_reached",
    "chance",
    "count_errors",
    "letter_rates",
    "level1_counts",
    "match_plan",
    "micro",
    "most_placed",
    "placed_counts",
    "pose_errors",
    "step_errors",
    "steps_kept",
]
