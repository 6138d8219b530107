"""The field's nouns as frozen dataclasses and pure functions: no files, clock or network."""

from phyblock.domain.blocks import (
    BLOCK_TYPES,
    COLORS,
    KIT_PALETTE,
    SHAPES,
    BlockType,
    Color,
    Euler,
    euler_deg_to_matrix,
    quat_xyzw_to_matrix,
    symmetries,
    turn_deg,
)
from phyblock.domain.plan import Plan, PoseStep
from phyblock.domain.question import (
    CATEGORIES,
    LETTERS,
    SUBTASK_NAMES,
    SUBTASKS,
    Mark,
    Question,
    QuestionPicture,
    Subtask,
    is_picture_option,
)
from phyblock.domain.scene import MAX_CANDIDATES, Block, Candidate, CandidateSet, Scene

__all__ = [
    "BLOCK_TYPES",
    "CATEGORIES",
    "COLORS",
    "KIT_PALETTE",
    "LETTERS",
    "MAX_CANDIDATES",
    "SHAPES",
    "SUBTASKS",
    "SUBTASK_NAMES",
    "Block",
    "BlockType",
    "Candidate",
    "CandidateSet",
    "Color",
    "Euler",
    "Mark",
    "Plan",
    "PoseStep",
    "Question",
    "QuestionPicture",
    "Scene",
    "Subtask",
    "euler_deg_to_matrix",
    "is_picture_option",
    "quat_xyzw_to_matrix",
    "symmetries",
    "turn_deg",
]
